"""A part of a shape is that part of the whole one, whichever way it was computed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from solver import registry
from store.errors import OutsideTable
from store.lookup import ShapeTable
from store.starter import ROOT
from store.surfaces import spectra, window
from store.surfaces.window import WHOLE, Patch, Window

QUERY, STAGE = {"te": 0.034, "gamma": 23.0}, 0.17

#: From a few points, by matrices, to most of the surface, cut out of the whole.
WINDOWS = [
    Window((0.6, 0.9), (0.2, 0.7)),
    Window((0.0, 1.2), (6.0, 0.4)),
    Window((2.5, math.pi), (1.0, 4.0), (1,)),
    Window((0.1, 3.1), (0.1, 6.2), (2, 0)),
    Window(components=(1,)),
]


@pytest.fixture(scope="module")
def table() -> ShapeTable:
    return ShapeTable.open(ROOT, surfaces=registry.surface)


@pytest.mark.parametrize("part", WINDOWS)
@pytest.mark.parametrize("n", [20, 64, 160])
def test_a_window_is_cut_out_of_the_whole(table: ShapeTable, part: Window, n: int) -> None:
    whole = table.at(QUERY, STAGE, resolution=n, fields=("position", "displacement"))
    shape = table.at(QUERY, STAGE, resolution=n, fields=("position", "displacement"), window=part)
    rows = [i for i, theta in enumerate(whole.colatitude) if part.colatitude[0] <= theta <= part.colatitude[1]]
    first, last = part.azimuth
    after = (whole.azimuth - first) % (2 * np.pi)
    reach = 2 * np.pi if last - first == 2 * np.pi else (last - first) % (2 * np.pi)
    columns = [j for j in np.argsort(after, kind="stable") if after[j] <= reach]
    for name in ("position", "displacement"):
        expected = getattr(whole, name)[rows][:, columns][..., list(part.components)]
        assert np.abs(getattr(shape, name) - expected).max() < 2e-6
    assert np.array_equal(shape.colatitude, whole.colatitude[rows])
    assert np.array_equal(shape.azimuth, whole.azimuth[columns])
    assert (shape.poles is None) == (len(rows) < n)


@pytest.mark.parametrize("band", [5, 12, 16, 30])
def test_matrices_and_transforms_agree(band: int) -> None:
    rng = np.random.default_rng(1)
    waves = spectra.spectrum(rng.standard_normal((3, band, 2 * band)))
    for n in (4, 11, 16, 40):
        found = window.series(waves, WHOLE.on(n))
        assert np.abs(found - spectra.synthesize(waves, n)).max() < 1e-12


def test_small_windows_alone_take_matrices() -> None:
    assert window._by_matrices(65, Patch(256, 0, 32, 0, 64, (0, 1, 2)))
    assert not window._by_matrices(65, Patch(256, 0, 256, 0, 256, (0, 1, 2)))


def test_a_window_between_two_lattice_points_holds_the_nearest() -> None:
    patch = Window((1.0, 1.0001), (2.0, 2.0001)).on(16)
    assert (patch.height, patch.width) == (1, 1)
    assert patch.top == round(16 / math.pi - 0.5)
    assert patch.left == round(32 / math.pi)


def test_no_normals_of_a_part(table: ShapeTable) -> None:
    for part in (WINDOWS[0], WINDOWS[4]):
        with pytest.raises(OutsideTable, match="whole surface"):
            _ = table.at(QUERY, STAGE, resolution=16, window=part).normals
