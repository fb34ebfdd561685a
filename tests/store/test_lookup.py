from __future__ import annotations

import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import FrozenInstanceError
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from solver import registry
from solver.contract import InvalidGeometry
from solver.dehydration import SOLVER
from solver.fruit import Fruit, colatitudes, lattice
from store import tables
from store.errors import MissingStore, OutsideTable
from store.lookup import ShapeTable
from store.store import Store
from store.surfaces import spectra

from .conftest import GAMMA, TE, amplitude, answer, displacement, fill, make, question, spec


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory, _filled_once: Path) -> Path:
    store = Store.open(shutil.copytree(_filled_once, tmp_path_factory.mktemp("home") / "store"))
    tables.build(store, SOLVER)
    return store.root


@pytest.fixture(scope="module")
def table(home: Path) -> ShapeTable:
    return ShapeTable.open(home, surfaces=registry.surface)


def both(table: ShapeTable, query: dict[str, float], stage: float, **options: Any) -> tuple[np.ndarray, np.ndarray]:
    shape = table.at(query, stage, fields=("position", "displacement"), **options)
    assert shape.position is not None
    assert shape.displacement is not None
    return shape.position, shape.displacement


def test_what_a_table_says_of_itself(table: ShapeTable, home: Path) -> None:
    info = tables.info(Store.open(home))
    assert table.axes == {"te": (0.03, 0.05), "gamma": (10.0, 30.0)}
    assert (table.stages, table.size, table.resolution, table.digest) == ((0.1, 0.2, 0.3), 9, 16, info.digest)
    assert table.fixed["rs1"] == 0.4


@pytest.mark.parametrize("stage", [0.1, 0.2, 0.3])
@pytest.mark.parametrize("te", TE)
def test_a_sample_is_returned_as_it_is(table: ShapeTable, te: float, stage: float) -> None:
    key, dataset = make(te=te, gamma=20.0)
    shape = table.at({"te": te, "gamma": 20.0}, stage, fields=("displacement",))
    assert shape.exact
    assert shape.converged
    assert shape.nearest == 0.0
    assert dict(shape.weights) == {key: 1.0}
    np.testing.assert_allclose(shape.displacement, dataset.displacement.sel(stage=stage), atol=1e-7)
    assert shape.descriptors["mean_radius"] == pytest.approx(float(dataset.mean_radius.sel(stage=stage)))
    assert shape.position is None
    assert shape.poles is None


@pytest.mark.parametrize("n", [8, 16, 33, 64])
def test_any_resolution_in_closed_form(table: ShapeTable, n: int) -> None:
    position, u = both(table, {"te": 0.04, "gamma": 20}, 0.2, resolution=n)
    truth = displacement(0.04, 20, 0.2, n)
    fresh = Fruit.parse({"te": 0.04}).surface(*lattice(n))
    assert position.shape == u.shape == (n, 2 * n, 3)
    assert position.dtype == u.dtype == np.float32
    np.testing.assert_allclose(u, truth, atol=1e-7)
    np.testing.assert_allclose(position, fresh + truth, atol=3e-7)


def test_weighting_spectra_is_weighting_displacements(table: ShapeTable) -> None:
    query, stage, n = {"te": 0.0327, "gamma": 17.0}, 0.2, 16
    shape = table.at(query, stage, fields=("displacement",), method="idw", m=6)
    points = {make(te=te, gamma=g)[0]: (te, g) for te in TE for g in GAMMA}
    distance = {k: np.hypot((te - 0.0327) / 0.02, (g - 17.0) / 20) for k, (te, g) in points.items()}
    nearest = sorted(distance, key=distance.__getitem__)[:6]
    assert set(shape.weights) == set(nearest)
    inverse = {k: distance[k] ** -2.0 for k in nearest}
    for k in nearest:
        assert shape.weights[k] == pytest.approx(inverse[k] / sum(inverse.values()))
    assert sum(shape.weights.values()) == pytest.approx(1)
    assert shape.nearest == pytest.approx(distance[nearest[0]])
    assert not shape.exact
    direct = sum(w * displacement(*points[k], stage, n) for k, w in shape.weights.items())
    np.testing.assert_allclose(shape.displacement, direct, atol=1e-6 * np.abs(direct).max())
    radii = sum(w * (1 + points[k][0] - 0.5 * stage) for k, w in shape.weights.items())
    assert shape.descriptors["mean_radius"] == pytest.approx(radii)


def test_linear_between_stages_and_from_the_fresh_shape(table: ShapeTable) -> None:
    query = {"te": 0.036, "gamma": 14.0}
    u = {s: both(table, query, s, method="idw")[1] for s in (0.0, 0.05, 0.1, 0.17, 0.2, 0.3)}
    assert not u[0.0].any()
    np.testing.assert_allclose(u[0.05], u[0.1] / 2, atol=1e-7)
    np.testing.assert_allclose(u[0.17], 0.3 * u[0.1] + 0.7 * u[0.2], atol=1e-7)
    fresh = table.at(query, 0.0)
    assert fresh.exact
    np.testing.assert_allclose(fresh.position, Fruit.parse({"te": 0.036}).surface(*lattice(16)), atol=2e-7)
    # of the fresh shape only what vanishes on it is known
    assert dict(fresh.descriptors) == {"roughness": 0.0, "buckle_count": 0.0}
    assert set(table.at(query, 0.1).descriptors) == {"roughness", "buckle_count", "mean_radius"}
    # there are no buckles until there are some
    assert set(table.at(query, 0.05).descriptors) == {"roughness"}
    half, whole = (table.at(query, s).descriptors["roughness"] for s in (0.05, 0.1))
    assert half == pytest.approx(whole / 2)


@pytest.mark.parametrize("stages", [(-0.2, -0.1, 0.1, 0.3), (-0.2, 0.0, 0.3), (-0.3, -0.1), (0.1, 0.3), (0.0, 0.3)])
def test_swelling_and_drying_both_start_at_the_fresh_shape(store: Store, stages: tuple[float, ...]) -> None:
    fill(store, te=[0.03, 0.04], stages=stages)
    tables.build(store, SOLVER)
    table = ShapeTable.open(store, surfaces=registry.surface)
    low, high = min(0.0, *stages), max(0.0, *stages)
    assert (table.stages, table.reach) == (stages, (low, high))
    for stage in (*stages, low, low / 1.9, low / 2.7, 0.0, high / 3.7, high):
        shape = table.at({"te": 0.04}, stage, fields=("displacement", "position"), method="linear")
        truth = displacement(0.04, 10.0, stage, 16)
        np.testing.assert_allclose(shape.displacement, truth, atol=1e-7)
        np.testing.assert_allclose(shape.position, Fruit.parse({"te": 0.04}).surface(*lattice(16)) + truth, atol=3e-7)
        roughness = np.hypot.reduce([amplitude(i, 0.04, 10.0, stage) for i in range(3)])
        assert shape.descriptors["roughness"] == pytest.approx(roughness, abs=1e-12)
        assert shape.exact == (stage in (*stages, 0.0))
        # next to the fresh shape only what vanishes on it is known
        between = any(x < stage < y for x, y in pairwise(stages) if x * y >= 0)
        assert ("mean_radius" in shape.descriptors) == (stage in stages or between)
    for off in (low - 0.01, high + 0.01):
        with pytest.raises(OutsideTable, match=f"stage {low:g} to {high:g}"):
            table.at({"te": 0.04}, off)


def test_a_linear_truth_is_hit_at_the_centre_of_a_cell(table: ShapeTable) -> None:
    _, u = both(table, {"te": 0.035, "gamma": 15.0}, 0.3, method="idw", m=4)
    np.testing.assert_allclose(u, displacement(0.035, 15.0, 0.3, 16), atol=2e-7)
    assert amplitude(0, 0.035, 15.0, 0.3) > 0


def test_poles_and_normals(table: ShapeTable) -> None:
    shape = table.at({"te": 0.04, "gamma": 20}, 0.3, resolution=32)
    assert shape.poles is not None
    fresh_poles = np.array([[0, 1.04, 0], [0, -1.04, 0]])
    truth = fresh_poles + spectra.poles(spectra.spectrum(displacement(0.04, 20, 0.3, 16)))
    np.testing.assert_allclose(shape.poles, truth, atol=2e-7)
    assert shape.normals is shape.normals
    assert shape.normals.shape == (32, 64, 3)
    np.testing.assert_allclose(np.linalg.norm(shape.normals, axis=-1), 1, atol=1e-6)
    with pytest.raises(OutsideTable, match="position"):
        _ = table.at({"te": 0.04, "gamma": 20}, 0.3, fields=("displacement",)).normals


def test_only_what_is_asked_for_is_computed(table: ShapeTable, monkeypatch: pytest.MonkeyPatch) -> None:
    def unwanted(*_: Any) -> None:
        raise AssertionError("nobody asked for this")

    for name in ("add_fresh", "lift"):
        monkeypatch.setattr(f"store.surfaces.surface.{name}", unwanted)
    query = {"te": 0.033, "gamma": 20.0}
    assert table.at(query, 0.2, fields=("displacement",), apart=False).displacement is not None
    monkeypatch.setattr("store.surfaces.window.transforms.borrow", unwanted)
    assert table.at(query, 0.2, fields=()).descriptors["roughness"] > 0


def test_the_answer_cannot_be_changed(table: ShapeTable) -> None:
    shape = table.at({"te": 0.033, "gamma": 20.0}, 0.2)
    with pytest.raises(FrozenInstanceError):
        shape.stage = 0.3  # type: ignore[misc]
    np.testing.assert_array_equal(shape.colatitude, colatitudes(16))
    assert shape.units["position"] == shape.units["roughness"] == "1"
    assert "array" not in repr(shape)


@pytest.mark.parametrize(
    ("query", "word"),
    [
        ({"te": 0.04}, "gamma 10 to 30"),
        ({}, "te, gamma must be given"),
        ({"te": 0.04, "gama": 20}, "did you mean 'gamma'"),
        ({"te": 0.0299, "gamma": 20}, "outside the table's 0.03 to 0.05"),
        ({"te": 0.04, "gamma": 30.1}, "run a sweep"),
        ({"te": float("nan"), "gamma": 20}, "finite"),
        ({"te": "thick", "gamma": 20}, "finite"),
        ({"te": 0.04, "gamma": float("inf")}, "finite"),
        ({"te": 0.04, "gamma": 20, "rs1": 0.3}, "0.4 in the whole table"),
        ({"te": 0.04, "gamma": 20, "seed": 1}, "0 in the whole table"),
        ({"te": 0.04, "gamma": 20, "imperfection_kind": "modes"}, "imperfection_kind is waves in the whole table"),
    ],
)
def test_queries_off_the_table(table: ShapeTable, query: dict[str, Any], word: str) -> None:
    with pytest.raises(OutsideTable, match=word):
        table.at(query, 0.2)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"stage": 0.31}, "stage = 0.31"),
        ({"stage": -0.01}, "stage"),
        ({"stage": float("nan")}, "finite"),
        ({"fields": ("positions",)}, "did you mean 'position'"),
        ({"resolution": 3}, "4 to 1024"),
        ({"resolution": 2000}, "4 to 1024"),
        ({"m": 0}, "m >= 1"),
        ({"eta": -1.0}, "eta > 0"),
        ({"eta": float("nan")}, "eta > 0"),
    ],
)
def test_needs_off_the_table(table: ShapeTable, options: dict[str, Any], word: str) -> None:
    with pytest.raises(OutsideTable, match=word):
        table.at({"te": 0.04, "gamma": 20}, **{"stage": 0.2, **options})


def test_what_is_no_number_may_be_said_as_the_table_holds_it(table: ShapeTable) -> None:
    held = {name: value for name, value in table.fixed.items() if not isinstance(value, int | float)}
    assert held["imperfection_kind"] == "waves"
    query = {"te": 0.033, "gamma": 20.0}
    said = table.at({**query, **held}, 0.2)
    np.testing.assert_array_equal(said.position, table.at(query, 0.2).position)


def test_round_off_is_forgiven(table: ShapeTable) -> None:
    assert table.at({"te": 0.05 + 1e-17, "gamma": 30 + 1e-14, "rs1": 0.1 * 4}, 0.1 * 3).exact
    assert table.at({"te": 0.04 + 1e-14, "gamma": 20, "seed": 0}, 0.2 + 1e-16).exact


def test_continuous_at_a_sample(table: ShapeTable) -> None:
    _, at = both(table, {"te": 0.04, "gamma": 20.0}, 0.2)
    for step in (1e-4, 1e-5, 1e-6):
        _, near = both(table, {"te": 0.04, "gamma": 20.0 + 20 * step}, 0.2, method="idw")
        assert np.abs(near - at).max() <= 2 * step**2 + 2e-8


def test_larger_eta_trusts_the_nearest_more(table: ShapeTable) -> None:
    weights = [
        max(table.at({"te": 0.041, "gamma": 21}, 0.2, method="idw", eta=e).weights.values()) for e in (1, 2, 4, 200)
    ]
    assert all(a < b for a, b in pairwise(weights))
    assert weights[-1] == pytest.approx(1)


def test_threads_get_what_one_gets(table: ShapeTable) -> None:
    queries = [({"te": float(te), "gamma": 17.0}, n) for te in np.linspace(0.03, 0.05, 12) for n in (12, 16, 24)]

    def ask(question: tuple[dict[str, float], int]) -> np.ndarray:
        return both(table, question[0], 0.17, resolution=question[1])[0]

    alone = [ask(question) for question in queries]
    with ThreadPoolExecutor(8) as pool:
        for _ in range(5):
            for got, expected in zip(pool.map(ask, queries), alone, strict=True):
                np.testing.assert_array_equal(got, expected)


def test_one_sample_is_a_table(store: Store) -> None:
    fill(store, te=[0.04])
    tables.build(store, SOLVER)
    table = ShapeTable.open(store, surfaces=registry.surface)
    assert table.axes == {}
    assert table.at({}, 0.2).exact
    assert table.at({"te": 0.04}, 0.2).exact
    with pytest.raises(OutsideTable, match="whole table"):
        table.at({"te": 0.05}, 0.2)


def test_double_precision(store: Store) -> None:
    fill(store, te=[0.03, 0.04])
    tables.build(store, SOLVER, dtype="float64", resolution=8)
    position, _ = both(ShapeTable.open(store, surfaces=registry.surface), {"te": 0.034}, 0.2)
    assert position.dtype == np.float64
    assert position.shape == (8, 16, 3)


def test_a_fruit_that_cannot_be(store: Store) -> None:
    # each axis within its bounds, but a thin fruit around a large stone
    raisin = (1.0, 0.7, 0.5, 0.45, 0.5, 0.7, 1.0, 0.45)
    fill(store, rs2=[0.3, 0.8])
    fill(store, rs2=[0.3], radii=raisin)
    tables.build(store, SOLVER)
    table = ShapeTable.open(store, surfaces=registry.surface)
    thin = {f"r{i}": raisin[i - 1] for i in range(2, 9) if f"r{i}" in table.axes}
    assert table.at({**thin, "rs2": 0.3}, 0.2).exact
    with pytest.raises(InvalidGeometry, match="stone"):
        table.at({**thin, "rs2": 0.8}, 0.2)


def test_a_shape_has_converged_only_where_all_that_it_is_made_of_had(store: Store) -> None:
    """One stage of one run had not: whatever leans on it says so, and nothing else does."""
    for te in (0.03, 0.04, 0.05):
        params, need = question(te=te)
        job = spec(te=te)
        result = answer(params, need)
        if te == 0.04:
            result["converged"][1] = 0
        store.ledger.want([job])
        store.ledger.done(store.ledger.claim("tester", 60, [job.key]), store.put(job.key, result), 1.0)
    tables.build(store, SOLVER)
    table = ShapeTable.open(store, surfaces=registry.surface)
    # te, stage, and whether run 0.04 takes part at stage 0.2
    for te, stage, leans in [
        (0.04, 0.2, True),
        (0.04, 0.25, True),
        (0.04, 0.15, True),
        (0.035, 0.2, True),
        (0.046, 0.17, True),
        (0.04, 0.1, False),
        (0.04, 0.05, False),
        (0.03, 0.2, False),
        (0.035, 0.3, False),
        (0.035, 0.0, False),
    ]:
        shape = table.at({"te": te}, stage, fields=(), method="linear")
        assert shape.converged is not leans, (te, stage)


def test_no_store(tmp_path: Path) -> None:
    with pytest.raises(MissingStore):
        ShapeTable.open(tmp_path / "nowhere", surfaces=registry.surface)
