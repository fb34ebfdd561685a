"""What of Liu et al. 2014 the package answers, by HTTP, without running anything: Figs. 7 to 10 and Table 1.

`MISSING` is what it does not hold yet: this fails when something is missing that is not in that list, and when
something in it is there.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from benchmarks.dehydration.claims.shown import FIGURES, FRUITS, SKINS
from store import starter

from .conftest import SHAPE, client_of

#: Figure -> skin -> values of its other axis that no table in the package holds; and the fruits of Table 1.
MISSING: dict[str, dict[float, tuple[float, ...]]] = {}
MISSING_FRUITS: tuple[str, ...] = ()


@pytest.fixture(scope="module")
def package() -> Iterator[httpx.Client]:
    with client_of(starter.ROOT, jobs_workers=0) as client:
        yield client


def is_answered(client: httpx.Client, asked: dict[str, Any]) -> bool:
    answer = client.get(SHAPE, params={**asked, "s": 0.2, "resolution": 16, "format": "json"})
    if answer.status_code != 200:
        assert answer.json()["type"] == "urn:wizen:problem:outside-table", answer.text
        assert answer.json()["nearest"]["distance"] > 0
        assert "wizen solve dehydration" in answer.json()["links"]["command"]
        return False
    said = answer.json()
    assert all(
        said["params"][name] == pytest.approx(value, rel=2e-3) for name, value in asked.items() if name != "preset"
    )
    return True


def test_the_figures_have_52_fruits() -> None:
    """Some panels show the same fruit: the sphere with a stone of 0.4 and gamma 10 is in Figs. 7, 8 and 9."""
    fruits = {tuple(sorted(fruit(te, x).items())) for _, axis, fruit in FIGURES.values() for te in SKINS for x in axis}
    assert len(fruits) == 52
    r2, r3 = (FIGURES["fig10"][2](0.04, 0.6)[name] for name in ("r2", "r3"))
    assert (r2, r3) == (0.8321, 0.6547)


@pytest.mark.parametrize("figure", FIGURES)
def test_panels_of_the_maps(package: httpx.Client, figure: str) -> None:
    _, axis, fruit = FIGURES[figure]
    missing = {te: tuple(x for x in axis if not is_answered(package, fruit(te, x))) for te in SKINS}
    assert {te: values for te, values in missing.items() if values} == MISSING.get(figure, {})


def test_fruits_of_table_1(package: httpx.Client) -> None:
    assert tuple(name for name in FRUITS if not is_answered(package, {"preset": name})) == MISSING_FRUITS
