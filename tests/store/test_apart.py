"""Shapes between samples, as they are handed over: out of contact, the same in parts, and stored ones untouched."""

from __future__ import annotations

import numpy as np
import pytest

from solver import registry
from solver.arrays import Floats
from solver.geometry import apart
from solver.geometry.crossings import crossings
from solver.lattice import closed_lattice
from store.lookup import ShapeTable
from store.starter import ROOT
from store.surfaces.window import Window

#: Questions to the table in the package whose blends cross themselves.
ASKED = ({"te": 0.0385, "gamma": 34.2}, {"te": 0.0386, "gamma": 11.3})


@pytest.fixture(scope="module")
def table() -> ShapeTable:
    return ShapeTable.open(ROOT, surfaces=registry.surface)


@pytest.mark.parametrize("n", [32, 64, 96])
@pytest.mark.parametrize("point", ASKED)
def test_no_shape_between_samples_crosses_itself(table: ShapeTable, point: dict[str, float], n: int) -> None:
    shape = table.at(point, 0.295, resolution=n, fields=("position", "displacement"))
    assert shape.position is not None
    assert shape.poles is not None
    assert shape.displacement is not None
    counted = crossings(np.concatenate([shape.position.reshape(-1, 3), shape.poles]), closed_lattice(n)).count
    assert counted == shape.crossings == 0
    fresh = table.at(point, 0.0, resolution=n).position
    assert np.abs(shape.position - fresh - shape.displacement).max() < 1e-6
    if n == 64:
        alone = table.at(point, 0.295, resolution=n, fields=("displacement",))
        np.testing.assert_array_equal(alone.displacement, shape.displacement)
        assert (alone.position, alone.poles, alone.crossings) == (None, None, 0)
        part = Window(colatitude=(0.5, 1.0), azimuth=(1.0, 2.0))
        cut = table.at(point, 0.295, resolution=n, fields=("displacement",), window=part)
        patch = part.on(n)
        np.testing.assert_allclose(cut.displacement, alone.displacement[patch.rows][:, patch.columns], atol=1e-6)
        blend = table.at(point, 0.295, resolution=n, fields=("displacement",), apart=False)
        assert 0 < np.abs(shape.displacement - blend.displacement).max() < 0.1
        assert blend.crossings is None


def test_what_is_rounded_afterwards_does_not_cross_again() -> None:
    """In the dimple at the end of jujube 1 needles around the pole lay 2e-8 r1 apart, a share of their own size."""
    shape = ShapeTable.open(ROOT, "jujube1", surfaces=registry.surface).at(
        {"te": 0.02, "gamma": 10.0}, 0.3, resolution=300
    )
    assert shape.exact
    assert shape.position is not None
    assert shape.poles is not None
    counted = crossings(np.concatenate([shape.position.reshape(-1, 3), shape.poles], dtype=float), closed_lattice(300))
    assert counted.count == shape.crossings == 0


def test_a_fine_lattice_takes_few_rounds(table: ShapeTable, monkeypatch: pytest.MonkeyPatch) -> None:
    """Slivers and the needles around a pole overlap by next to nothing: one once took 538 rounds, 9 s."""
    rounds: list[int] = []

    def counted(
        x: Floats, topology: apart.Topology, most: int = 240, looked: apart.Looked | None = None, least: float = 0.0
    ) -> apart.Apart:
        found = put_apart(x, topology, most, looked, least)
        rounds.append(found.rounds)
        return found

    put_apart = apart.put_apart
    monkeypatch.setattr(apart, "put_apart", counted)
    for te, gamma, s in (
        (0.0379, 34.2, 0.28),
        (0.0323, 43.6, 0.295),
        (0.0373, 24.6, 0.295),
    ):
        shape = table.at({"te": te, "gamma": gamma}, s, resolution=256)
        assert shape.position is not None
        assert shape.poles is not None
        assert crossings(np.concatenate([shape.position.reshape(-1, 3), shape.poles]), closed_lattice(256)).count == 0
    assert 0 < max(rounds) < 100


def test_a_part_is_that_of_the_whole_out_of_contact(table: ShapeTable) -> None:
    part = Window((1.0, 2.0), (0.5, 4.0), (0, 2))
    whole = table.at(ASKED[0], 0.295, resolution=64).position
    found = table.at(ASKED[0], 0.295, resolution=64, window=part).position
    patch = part.on(64)
    assert whole is not None
    assert found is not None
    assert np.abs(found - whole[patch.rows][:, patch.columns][..., [0, 2]]).max() < 2e-6


def test_a_stored_result_stays_as_it_is(table: ShapeTable) -> None:
    stored = table.at({"te": 0.04, "gamma": 17.0}, 0.3, resolution=64, fields=("position", "displacement"))
    blend = table.at({"te": 0.04, "gamma": 17.0}, 0.3, resolution=64, fields=("displacement",), apart=False)
    assert stored.exact
    assert stored.crossings == 0
    assert np.array_equal(stored.displacement, blend.displacement)
