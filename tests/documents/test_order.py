"""The order of convergence that a table states is that of values whose order is known."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.dehydration.precision.order import order, table

LIMIT = np.array([0.02, 0.04, 0.05, 0.055, 0.06])
MESHES = (18, 26, 36, 48)


@pytest.mark.parametrize("p", [1.0, 2.0, 3.0])
def test_a_known_order_is_found(p: float) -> None:
    grows = np.array([1, -2, 3, 1, 2])  # from above and from below
    found = order([(n, [(LIMIT * (1 + grows * n**-p)).tolist()] * 2) for n in MESHES])
    assert found.value == pytest.approx(p, abs=0.011)
    assert found.error == pytest.approx(0, abs=1e-9)
    assert found.limit == pytest.approx(LIMIT, rel=1e-3)


def test_seeds_that_differ_leave_it_uncertain() -> None:
    rng = np.random.default_rng(3)
    found = order([(n, LIMIT * (1 + 30 * n**-2.0) * (1 + 0.02 * rng.standard_normal((3, 5)))) for n in MESHES])
    assert found.error > 0.2
    assert abs(found.value - 2) < 2.5 * found.error


def test_two_meshes_have_no_order() -> None:
    with pytest.raises(ValueError, match="three meshes"):
        order([(n, [LIMIT.tolist()] * 2) for n in MESHES[:2]])


def test_a_table_has_a_line_for_each_mesh_and_one_for_the_limit() -> None:
    def run(n: int, seed: int) -> dict[str, object]:
        roughness = (LIMIT * (1 + 30 * n**-2.0) * (1 + 0.01 * seed)).tolist()
        more = {"elements": 10 * n, "cpu": 1.0, "roughness": roughness, "version": "10"}
        return {"te": 0.04, "gamma": 10.0, "n": n, "seed": seed, **more}

    runs = [run(n, seed) for n in MESHES for seed in (0, 1)]
    lines = table({"version": "10", "runs": [*runs, {**run(20, 0), "version": "9"}]}).splitlines()
    assert [line.split(" | ")[2] for line in lines[2:]] == ["18", "26", "36", "48", "limit"]
    assert "2.0 +- 0.0" in lines[-1]
