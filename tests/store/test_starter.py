"""The table in the package: whole, small, and what its README says."""

from __future__ import annotations

import itertools
import shutil
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from solver import registry
from solver.dehydration.measures.penetration import of_lattice
from solver.geometry.crossings import crossings
from solver.lattice import closed_lattice
from store import seal, starter, tables
from store.checking import audit
from store.errors import StaleTable, UnknownJob
from store.families import stored
from store.generations import generation
from store.lookup import ShapeTable
from store.store import Store
from store.surfaces.measures import Measures
from sweeps.planning.plan import Plan


def test_it_serves_shapes_at_once() -> None:
    table = ShapeTable.open(starter.ROOT, surfaces=registry.surface)
    assert {axis: tuple(ends) for axis, ends in table.info.axes.items()} == {"te": (0.03, 0.04), "gamma": (10.0, 50.0)}
    shape = table.at({"te": 0.035, "gamma": 20.0}, 0.2, resolution=48, fields=("position",))
    radius = np.linalg.norm(shape.position, axis=-1)
    assert 0.7 < radius.min() < radius.max() < 1.04
    assert np.ptp(radius) > 0.1


def test_what_tables_say_of_their_trust_is_read_without_all_else(monkeypatch: pytest.MonkeyPatch) -> None:
    """The list of all tables asks for it before a page shows anything."""
    read: list[str] = []
    real = generation._column
    monkeypatch.setattr(generation, "_column", lambda variable: read.append(variable.name) or real(variable))
    store = Store(starter.ROOT)
    methods = set()
    for folder in sorted((starter.ROOT / "tables").iterdir()):
        path = tables.path_of(store, tables.info(store, folder.name))
        read.clear()
        judged = generation.judged(path)
        assert set(read) <= {"/neighbour_correlation", f"/left_out_{Measures._fields[0]}"}
        whole = generation.read(path)
        found, likeness = generation.left_out(whole), whole.get("neighbour_correlation")
        assert judged.method == (found[1] if found else None)
        assert judged.neighbour_correlation == (tuple(likeness.values.tolist()) if likeness else None)
        methods.add(judged.method)
    assert methods - {None}


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


FAMILIES = [name for name in Store.open(starter.ROOT).table_names() if name != "default"]


@pytest.mark.parametrize("name", FAMILIES)
def test_no_sample_of_a_family_crosses_itself_as_handed_over(name: str) -> None:
    """Packed and mirrored ones, too: what the runs say of their lattices, and the deepest stage counted anew."""
    store = Store.open(starter.ROOT)
    table = ShapeTable.open(store, name, surfaces=registry.surface)
    places = stored.samples(store, table.info)
    rows = [()] if places is None else places.tolist()
    assert len(rows) == table.info.samples
    for row in rows:
        place = dict(zip(table.info.axes, row, strict=True))
        for stage in table.stages:
            found = table.at(place, stage, resolution=8, fields=()).descriptors
            assert found["crossings"] == found["lattice_crossings"] == 0
            assert found["least_jacobian"] > 0
        shape = table.at(place, table.stages[-1], resolution=64, fields=("position",))
        assert shape.position is not None
        assert shape.poles is not None
        points = np.concatenate([shape.position.reshape(-1, 3), shape.poles], dtype=np.float64)
        assert crossings(points, closed_lattice(64)).count == shape.crossings == 0, place


def test_every_family_says_how_it_was_made() -> None:
    """By the plan that makes the rest of it, and with what packing lost."""
    store = Store.open(starter.ROOT)
    for name in FAMILIES:
        info = tables.info(store, name)
        plan = Plan.parse(tomllib.loads(info.plan or ""), name)
        assert {plan.solver.name, name} == {info.solver, plan.name}
        assert registry.get(info.solver).answers_from(info.version)
        assert info.dtype == "int16"


def test_a_version_that_only_went_another_way_is_answered_from() -> None:
    info = tables.info(Store.open(starter.ROOT), "sphere-02")
    now = replace(registry.get("dehydration"), version="99", tables_of=(info.version,))
    stored.check_version(info, now)
    with pytest.raises(StaleTable, match=r"this is 99"):
        stored.check_version(info, replace(now, tables_of=()))


@pytest.mark.parametrize("name", ["default", *FAMILIES])
def test_it_holds_the_run_whose_wrinkles_samples_start_from(name: str) -> None:
    store = Store.open(starter.ROOT)
    info = tables.info(store, name)
    pattern = info.template.get("pattern")
    plan = Plan.parse(tomllib.loads(info.plan or ""), name)
    if pattern is None:
        assert plan.first is None  # from bumps alone
        return
    assert plan.first is not None
    # of whichever version it is: another run of it comes to other wrinkles
    assert [job.key for job in plan.first.jobs()] == [pattern["key"]]
    found = store.find(pattern["key"])
    assert found is not None
    assert pattern["stage"] in found["stage"].values


def test_its_files_are_whole_and_small() -> None:
    store = Store.open(starter.ROOT)
    paths = [tables.path_of(store, tables.info(store, name)) for name in store.table_names()]
    assert all(seal.is_whole(path) for path in [*paths, *starter.ROOT.glob("shards/??/*.h5")])
    # what the package may take: spectra of 52 panels and of six fruits, each a grid of te by gamma
    assert sum(path.stat().st_size for path in paths) < 80e6


@pytest.mark.parametrize("given", [None, "nowhere"])
def test_it_stands_in_where_there_is_no_store(tmp_path: Path, given: str | None) -> None:
    assert starter.own_or_starter(None if given is None else tmp_path / given) == starter.ROOT
    Store.open(tmp_path / "own", create=True)
    assert starter.own_or_starter(tmp_path / "own") == tmp_path / "own"


@pytest.mark.parametrize("name", ["default", *FAMILIES])
def test_untouched_it_is_sound_and_says_once_that_its_runs_are_not_here(name: str) -> None:
    (finding,) = audit.verify(Store(starter.ROOT), name)
    assert finding.remark
    assert "None of the table's runs is here" in finding.message


def test_a_copy_is_made_smaller_of_its_own_spectra_and_served(tmp_path: Path) -> None:
    store = Store.open(tmp_path / "own", create=True)
    shutil.copytree(starter.ROOT / "tables" / "sphere-02", store.tables_dir / "sphere-02")
    whole = ShapeTable.open(store, "sphere-02", surfaces=registry.surface)
    made = tables.rebuild(store, registry.get("dehydration"), "sphere-02", resolution=24, dtype="float32")
    small = ShapeTable.open(store, "sphere-02", surfaces=registry.surface)
    assert (small.digest, small.resolution, made.samples) == (made.digest, 24, whole.info.samples)
    asked = {"gamma": 20.0}
    a, b = (table.at(asked, 0.2, resolution=24) for table in (whole, small))
    assert dict(a.descriptors) == dict(b.descriptors)
    assert np.sqrt(np.mean((np.asarray(a.position) - np.asarray(b.position)) ** 2)) < 0.02
    with pytest.raises(UnknownJob, match="without its runs"):
        tables.rebuild(store, registry.get("dehydration"), "sphere-02", resolution=96)
