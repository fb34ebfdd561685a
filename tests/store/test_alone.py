"""Products by blocks are products, and no block is one that BLAS divides among threads."""

from __future__ import annotations

import numpy as np
import pytest

from store.surfaces import alone


@pytest.mark.parametrize("shape", [(3, 5, 7), (270, 16, 361), (3, 512, 2881), (1024, 24, 48), (9, 300_001, 2)])
def test_a_product_by_blocks_is_the_product(shape: tuple[int, int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    n, k, m = shape
    generator = np.random.default_rng(5)
    a, b = generator.standard_normal((n, k)), generator.standard_normal((k, m))
    made, matmul = [], np.matmul

    def counted(x: np.ndarray, y: np.ndarray, out: np.ndarray) -> np.ndarray:
        made.append(x.shape[0] * x.shape[1] * y.shape[1])
        return matmul(x, y, out=out)

    monkeypatch.setattr(np, "matmul", counted)
    found = alone.product(a, b)
    np.testing.assert_allclose(found, np.einsum("ik,kj->ij", a, b), rtol=1e-9, atol=1e-9 * np.sqrt(k))
    assert sum(made) == (n * k * m if n * k * m > alone.MOST else 0)
    # a row or a column alone may be more
    assert all(size <= max(alone.MOST, k * min(n, m)) for size in made)


def test_a_total_is_a_sum() -> None:
    parts, terms = np.array([0.5, -2.0]), np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    np.testing.assert_array_equal(alone.total(parts, terms), [-7.5, -9.0, -10.5])
