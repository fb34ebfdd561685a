"""What of Liu et al. 2014 the package answers, by HTTP, without running anything: Figs. 7 to 10 and Table 1.

`MISSING` is what it does not hold yet: this fails when something is missing that is not in that list, and when
something in it is there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from store import starter

from .conftest import SHAPE, client_of

SKINS = (0.01, 0.02, 0.03, 0.04)
FRUITS = ("raisin", "wolfberry", "jujube1", "jujube2", "plum1", "plum2")

#: Figure -> skin -> values of its other axis that no table in the package holds; and the fruits of Table 1.
MISSING: dict[str, dict[float, tuple[float, ...]]] = {}
MISSING_FRUITS: tuple[str, ...] = ()


def sphere(te: float, gamma: float) -> dict[str, float]:
    return {"te": te, "gamma": gamma, "rs1": 0.4, "rs2": 0.4}


def stone(te: float, radius: float) -> dict[str, float]:
    return {"te": te, "gamma": 10, "rs1": radius, "rs2": radius}


def long_stone(te: float, length: float) -> dict[str, float]:
    return {"te": te, "gamma": 10, "rs1": length, "rs2": 0.4}


def prolate(te: float, r4: float) -> dict[str, float]:
    """An ellipse with half-axes 1 (along the poles) and r4, at every 30 degrees."""
    r2, r3 = (round(1 / math.hypot(math.cos(a), math.sin(a) / r4), 4) for a in (math.pi / 6, math.pi / 3))
    radii = {"r2": r2, "r3": r3, "r4": r4, "r5": r3, "r6": r2, "r8": r4}
    return {"te": te, "gamma": 10, "rs1": 0.3, "rs2": 0.3, **radii}


#: Figure -> its other axis, and the fruit at a skin and a value of it.
FIGURES: dict[str, tuple[tuple[float, ...], Any]] = {
    "fig7": ((10, 30, 50), sphere),
    "fig8": ((0.3, 0.4, 0.5, 0.6), stone),
    "fig9": ((0.4, 0.5, 0.6, 0.7), long_stone),
    "fig10": ((0.6, 0.7, 0.8, 0.9), prolate),
}


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
    fruits = {tuple(sorted(fruit(te, x).items())) for axis, fruit in FIGURES.values() for te in SKINS for x in axis}
    assert len(fruits) == 52
    r2, r3 = (prolate(0.04, 0.6)[name] for name in ("r2", "r3"))
    assert (r2, r3) == (0.8321, 0.6547)


@pytest.mark.parametrize("figure", FIGURES)
def test_panels_of_the_maps(package: httpx.Client, figure: str) -> None:
    axis, fruit = FIGURES[figure]
    missing = {te: tuple(x for x in axis if not is_answered(package, fruit(te, x))) for te in SKINS}
    assert {te: values for te, values in missing.items() if values} == MISSING.get(figure, {})


def test_fruits_of_table_1(package: httpx.Client) -> None:
    assert tuple(name for name in FRUITS if not is_answered(package, {"preset": name})) == MISSING_FRUITS
