"""The table in the package: whole, small, and what its README says."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from solver import registry
from solver.dehydration.measures.penetration import of_lattice
from store import seal, starter, tables
from store.lookup import ShapeTable
from store.store import Store


def test_it_serves_shapes_at_once() -> None:
    table = ShapeTable.open(starter.ROOT, surfaces=registry.surface)
    assert {axis: tuple(ends) for axis, ends in table.info.axes.items()} == {"te": (0.03, 0.04), "gamma": (10.0, 50.0)}
    shape = table.at({"te": 0.035, "gamma": 20.0}, 0.2, resolution=48, fields=("position",))
    radius = np.linalg.norm(shape.position, axis=-1)
    assert 0.7 < radius.min() < radius.max() < 1.04
    assert np.ptp(radius) > 0.1


def test_every_stage_of_it_was_free_of_crossings_and_inversion() -> None:
    table = ShapeTable.open(starter.ROOT, surfaces=registry.surface)
    for te in (0.03, 0.035, 0.04):
        for gamma in (10.0, 17.0, 30.0, 50.0):
            for stage in table.stages:
                found = table.at({"te": te, "gamma": gamma}, stage, resolution=8, fields=()).descriptors
                assert found["crossings"] == found["lattice_crossings"] == 0
                assert found["least_jacobian"] > 0


def test_no_sample_of_it_crosses_itself_as_handed_over() -> None:
    """Triangles of the files, counted by code that shares nothing with contact; the deepest stage is the worst."""
    table = ShapeTable.open(starter.ROOT, surfaces=registry.surface)
    for te, gamma in itertools.product((0.03, 0.035, 0.04), (10.0, 17.0, 30.0, 50.0)):
        shape = table.at({"te": te, "gamma": gamma}, 0.3, resolution=64, fields=("position",))
        assert of_lattice(np.asarray(shape.position, float)).count == 0, (te, gamma)


def test_its_file_is_whole_and_small() -> None:
    store = Store.open(starter.ROOT)
    path = tables.path_of(store, tables.info(store))
    assert seal.is_whole(path)
    assert path.stat().st_size < 20e6


@pytest.mark.parametrize("given", [None, "nowhere"])
def test_it_stands_in_where_there_is_no_store(tmp_path: Path, given: str | None) -> None:
    assert starter.own_or_starter(None if given is None else tmp_path / given) == starter.ROOT
    Store.open(tmp_path / "own", create=True)
    assert starter.own_or_starter(tmp_path / "own") == tmp_path / "own"
