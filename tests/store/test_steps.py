"""Compiled or not, a look-up's steps do the same operations: the same bytes."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest

from solver import registry
from store import starter
from store.lookup import ShapeTable
from store.surfaces import steps
from store.surfaces.steps import PLAIN

from .conftest import ROOT

KINDS = [np.float32, np.float64]


@pytest.fixture
def compiled() -> steps.Steps:
    from store.surfaces.steps_compiled import COMPILED

    return COMPILED


@pytest.fixture
def as_it_was() -> Iterator[None]:
    way = steps.now()
    yield
    steps.use(way)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("terms", [0, 1, 24])
def test_sums_are_those_of_numpy(kind: type, terms: int, compiled: steps.Steps) -> None:
    rng = np.random.default_rng(terms)
    parts, waves = (rng.standard_normal(shape).astype(kind) for shape in (terms, (terms, 5001)))
    found = compiled.total(parts, waves)
    np.testing.assert_array_equal(found, PLAIN.total(parts, waves))
    np.testing.assert_allclose(found, parts @ waves, atol=1e-4)


def test_a_ramp_is_that_of_numpy(compiled: steps.Steps) -> None:
    rng = np.random.default_rng(0)
    values, low, high = (rng.standard_normal(count).astype(np.float32) for count in (8, 900, 900))
    place = rng.integers(0, 7, 900).astype(np.int32)
    found = compiled.ramp(values, place, low, high)
    np.testing.assert_array_equal(found, PLAIN.ramp(values, place, low, high))
    np.testing.assert_allclose(found, 1 + values[place] * low + values[place + 1] * high, rtol=1e-5)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("band", "kept"), [(5, 3), (6, 6), (12, 13), (1, 2)])
def test_rows_are_those_of_numpy(kind: type, band: int, kept: int, compiled: steps.Steps) -> None:
    rng, waves = np.random.default_rng(band), band + 1
    parts = rng.standard_normal((3, waves, waves, 2)).astype(kind)
    factor = rng.standard_normal((waves, waves)).astype(np.float32)
    added = []
    for way in (PLAIN, compiled):
        even, odd = (np.full((kept, 3, 2, count), np.nan, kind) for count in (-(-waves // 2), waves // 2))
        way.gather(parts, factor, even, odd)
        whole = parts.copy()
        way.scatter(whole, even, odd)
        added.append((even, odd, whole))
    for plain, quick in zip(*added, strict=True):
        np.testing.assert_array_equal(quick, plain)
    # what a factor adds, added, is the factor
    truth = parts.copy()
    truth[:, :kept] *= factor[:kept, :, None]
    np.testing.assert_allclose(added[1][2], truth, atol=2e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_positions_are_those_of_numpy(kind: type, compiled: steps.Steps) -> None:
    rng, n = np.random.default_rng(0), 9
    planes, low = (rng.standard_normal((3, n, 2 * n)).astype(kind) for _ in range(2))
    ratio, x, z = (rng.standard_normal((n, 2 * n)).astype(kind) for _ in range(3))
    y = rng.standard_normal((n, 1)).astype(kind)
    found = [np.empty((n, 2 * n, 3), kind) for _ in range(2)]
    for way, out in zip((PLAIN, compiled), found, strict=True):
        way.lift(planes, ratio, low, x, y, z, out)
    np.testing.assert_array_equal(found[1], found[0])
    fresh = np.stack(np.broadcast_arrays(x, y, z), axis=-1)
    np.testing.assert_allclose(found[0], np.moveaxis(planes * ratio + low, 0, -1) + fresh, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_volumes_are_those_of_numpy(kind: type, compiled: steps.Steps) -> None:
    rng = np.random.default_rng(0)
    points, poles = (rng.standard_normal(shape).astype(kind) for shape in ((9, 18, 3), (2, 3)))
    np.testing.assert_array_equal(compiled.six(points, poles), PLAIN.six(points, poles))


@pytest.mark.parametrize(("name", "n"), [("default", 32), ("default", 33), ("plum2", 24)])
def test_a_look_up_gives_the_same_bytes(name: str, n: int, compiled: steps.Steps, as_it_was: None) -> None:
    """A plum is not round: its fresh surface is no product of colatitude and azimuth."""
    table, found = ShapeTable.open(starter.ROOT, name, surfaces=registry.surface), []
    middle = {axis: low + 0.4 * (high - low) for axis, (low, high) in table.axes.items()}
    for way in (PLAIN, compiled):
        steps.use(way)
        found.append(table.at(middle, 0.17, resolution=n).position)
    assert found[0] is not None
    assert found[1] is not None
    assert found[0].tobytes() == found[1].tobytes()


def test_what_is_loaded_for_folds_does_the_steps() -> None:
    """And nobody else loads it: a look-up does without."""
    code = """
import sys
from solver import registry
from store import starter
from store.lookup import ShapeTable
from store.surfaces import apart, steps
table = ShapeTable.open(starter.ROOT, surfaces=registry.surface)
table.at({"te": 0.034, "gamma": 23.0}, 0.1, resolution=16)
assert steps.now() is steps.PLAIN and "numba" not in sys.modules
apart.compiled()
assert steps.now() is not steps.PLAIN
"""
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)
