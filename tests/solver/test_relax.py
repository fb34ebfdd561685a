"""A surface from elsewhere becomes an equilibrium: forces balance, and what it looked like stays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from solver import registry
from solver.arrays import Floats
from solver.contract import InvalidInput, Need, Unstable
from solver.dehydration import SOLVER, relax
from solver.dehydration.fresh.mesh import cubed_sphere
from solver.dehydration.motion import Motion
from solver.dehydration.relax import RESIDUAL, on_columns
from solver.lattice import closed_lattice, directions, lattice
from store.lookup import ShapeTable
from store.starter import ROOT
from store.store import Store
from sweeps.refining import balance
from sweeps.relaxing import relaxed

NEED = Need(quality="preview", resolution=32, fields=("position", "lattice_crossings", "crossings"))
EIGHTH = {"te": 0.04, "gamma": 10.0, "mirrors": "xyz"}


def ridged(radius: float, depth: float) -> Floats:
    """Return a sphere (32, 64, 3) with ridges that mirror themselves in all three planes."""
    theta, phi = lattice(32)
    bumps = np.cos(8 * theta) * np.cos(8 * phi) * np.sin(theta) ** 2
    return directions(theta, phi) * (radius + depth * bumps)[..., None]


def test_a_lattice_is_read_at_columns_as_at_its_own_points() -> None:
    surface = ridged(0.9, 0.05)
    assert np.abs(on_columns(surface, directions(*lattice(32)).reshape(-1, 3)) - surface.reshape(-1, 3)).max() < 1e-9
    nodes = cubed_sphere(12).directions
    assert np.abs(on_columns(directions(*lattice(64)), nodes) - nodes).max() < 2e-3


def test_a_ridged_surface_comes_to_balance() -> None:
    """These ridges are nobody's equilibrium: they grow and move, without crossing."""
    solver = registry.get("dehydration")
    given = ridged(0.83, 0.03)
    found = solver.relaxed(solver.parse(EIGHTH), given, 0.2, NEED).isel(stage=0)
    assert found.attrs["path"] == "relaxed"
    assert float(found["residual"]) <= RESIDUAL == 5e-3
    assert bool(found["converged"])
    assert int(found["crossings"]) == int(found["lattice_crossings"]) == 0
    radii = [np.linalg.norm(one, axis=-1).ravel() for one in (found["position"].values, given)]
    # they move by six times their height: .33 with the march of default, .19 with the longer steps of a preview
    assert np.corrcoef(*radii)[0, 1] > 0.1
    assert float(found["moved"]) > 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("te", "gamma", "alike"),
    [
        (0.0325, 13.0, 0.97),
        # the nearest balance of this blend lies farther away
        (0.0375, 22.0, 0.9),
        # a run of the table itself, which on a coarser mesh slides away for thousands of steps
        (0.03, 10.0, 0.99),
    ],
)
def test_a_looked_up_shape_comes_to_balance_and_keeps_its_pattern(te: float, gamma: float, alike: float) -> None:
    table = ShapeTable.open(ROOT, surfaces=registry.surface)
    shape = table.at({"te": te, "gamma": gamma}, 0.2, resolution=64)
    found, said = relaxed(registry.get("dehydration"), table, shape)
    assert found.tier == "relaxed"
    assert said["residual"] <= RESIDUAL == 5e-3
    assert found.converged
    assert found.crossings == 0
    assert shape.position is not None
    assert found.position is not None
    radii = [np.linalg.norm(one, axis=-1).ravel() for one in (found.position, shape.position)]
    assert np.corrcoef(*radii)[0, 1] > alike
    assert said["moved"] < 1


def volume(position: Floats) -> float:
    """What the triangles of a lattice and its mean poles enclose."""
    whole = np.concatenate([position.reshape(-1, 3), position[[0, -1]].mean(axis=1)])
    a, b, c = (whole[closed_lattice(len(position))[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6


def test_what_is_relaxed_keeps_the_volume_of_what_does_not_shrink() -> None:
    """Only the flesh shrinks, by (1 - s)^3; skin and stone are incompressible."""
    solver = registry.get("dehydration")
    params = solver.parse(EIGHTH)
    found = solver.relaxed(params, ridged(0.83, 0.03), 0.2, NEED).isel(stage=0)
    stone = min(params.model_dump()["stone"]) ** 3
    exact = 4 / 3 * np.pi * (0.8**3 * (1 - stone) + stone + 1.04**3 - 1)
    # a lattice of 32 colatitudes cuts off some .5 %
    assert volume(found["position"].values.astype(float)) / exact == pytest.approx(1, abs=0.015)


def test_a_run_stays_where_its_fruit_keeps_its_bumps() -> None:
    """About the onset they hold up wrinkles that a smooth fruit does not have: off it, a run in balance moves away."""
    solver = registry.get("dehydration")
    params, smooth = (solver.parse({**EIGHTH, "imperfection": height}) for height in (0.01, 0.0))
    need = NEED.model_copy(update={"resolution": 48})
    run = solver.solve(params, need.model_copy(update={"stages": (0.07,)})).isel(stage=0)
    surface = run["position"].values.astype(float)
    kept, lost = (solver.relaxed(fruit, surface, 0.07, need, steps=600).isel(stage=0) for fruit in (params, smooth))
    assert float(kept["moved"]) < 0.12
    assert float(lost["moved"]) > 0.4
    rough = [float(np.linalg.norm(one["position"].values, axis=-1).std()) for one in (run, kept, lost)]
    assert rough[1] == pytest.approx(rough[0], rel=0.05)
    assert rough[2] < 0.6 * rough[0]


def test_a_run_of_a_table_is_as_rough_as_before() -> None:
    """About the onset wrinkles give way softly: let go too soon, this one lost 2 % of its roughness on the way."""
    table = ShapeTable.open(ROOT, "plum2", surfaces=registry.surface)
    distance = balance.distance(SOLVER, table, {"te": 0.03, "gamma": 14.0}, 0.1, "nearest", Store.open(ROOT))
    assert distance is not None
    assert distance.residual <= RESIDUAL
    assert abs(distance.rgh - 1) < 0.005
    assert distance.moved < 0.012  # .024 under a damping of .2, which holds back what is slow inside


def test_how_far_a_long_fruit_moves_is_told_over_its_wrinkles() -> None:
    """Not over how far it is from a sphere, which is five times as much here."""
    solver = registry.get("dehydration")
    outline = [1.0, 0.8321, 0.6547, 0.6, 0.6547, 0.8321, 1.0, 0.6]
    long = {**EIGHTH, "radii": outline, "stone": [0.3, 0.3], "imperfection": 0.01}
    need = NEED.model_copy(update={"resolution": 48, "fields": ("position", "roughness")})
    run = solver.solve(solver.parse(long), need.model_copy(update={"stages": (0.1,)})).isel(stage=0)
    surface = run["position"].values.astype(float)
    found = solver.relaxed(solver.parse({**long, "te": 0.045}), surface, 0.1, need, steps=600).isel(stage=0)
    before, after = (np.linalg.norm(one["position"].values, axis=-1) for one in (run, found))
    area = np.sin((np.arange(48) + 0.5) * np.pi / 48)[:, None].repeat(96, axis=1)
    rms = np.sqrt(np.cov((after - before).ravel(), aweights=area.ravel(), ddof=0))
    assert before.std() > 4 * float(run["roughness"])
    assert float(found["moved"]) == pytest.approx(rms / float(run["roughness"]), rel=0.15)


@pytest.mark.parametrize(("steps", "most"), [(500, 800), (1, 800)])
def test_so_many_steps_and_no_more(steps: int, most: int) -> None:
    """What it takes to put a surface on, to calm it and to look at it once is always taken."""
    solver = registry.get("dehydration")
    found = solver.relaxed(solver.parse(EIGHTH), ridged(0.83, 0.03), 0.2, NEED, steps=steps).isel(stage=0)
    assert steps <= int(found["iterations"]) < most
    assert float(found["residual_placed"]) > float(found["residual"])


def test_what_blows_up_is_pushed_on_in_more_increments(monkeypatch: pytest.MonkeyPatch) -> None:
    real, tried = relax._put_on, []

    def put_on(motion: Motion, target: Floats, stage: float, increments: int) -> Any:
        tried.append(increments)
        found = real(motion, target, stage, increments)
        if increments < enough:
            raise Unstable("the run blew up.", advice="")
        return found

    monkeypatch.setattr(relax, "_put_on", put_on)
    solver, enough = registry.get("dehydration"), 15
    found = solver.relaxed(solver.parse(EIGHTH), ridged(0.83, 0.03), 0.2, NEED, steps=1).isel(stage=0)
    assert tried == [5, 15]
    # those that led nowhere are not counted
    assert 300 <= int(found["iterations"]) < 300 + 25 * 20 + 200
    enough = 1000
    with pytest.raises(Unstable, match="blew up"):
        solver.relaxed(solver.parse(EIGHTH), ridged(0.83, 0.03), 0.2, NEED, steps=1)
    assert tried == [5, 15, 5, 15, 45]


@pytest.mark.slow
def test_a_raisin_is_no_smaller_when_it_is_relaxed() -> None:
    """Only the flesh shrinks, and where it is at rest; let go before, its pressures took .7 % off its volume."""
    table = ShapeTable.open(ROOT, "raisin", surfaces=registry.surface)
    shape = table.at({"te": 0.0093, "gamma": 7.0}, 0.2, resolution=96)
    found, said = relaxed(SOLVER, table, shape)
    assert found.converged
    assert found.position is not None
    assert shape.position is not None
    assert volume(found.position.astype(float)) == pytest.approx(volume(shape.position.astype(float)), rel=2e-3)
    assert said["moved"] < 0.05


@pytest.mark.slow
def test_deep_folds_of_a_plum_are_relaxed() -> None:
    """Pushed on in five increments, elements below them blow up.

    It moves by as much of its wrinkles; .05 was asked of how far it is from a sphere, which is nine times as much.
    """
    table = ShapeTable.open(ROOT, "plum1", surfaces=registry.surface)
    distance = balance.distance(SOLVER, table, {"te": 0.0125, "gamma": 7.0}, 0.3, "nearest", Store.open(ROOT))
    assert distance is not None
    assert distance.moved < 0.08


def test_what_is_no_lattice_or_relaxes_nothing_is_refused() -> None:
    solver = registry.get("dehydration")
    with pytest.raises(InvalidInput, match="no lattice"):
        solver.relaxed(solver.parse(EIGHTH), np.zeros((4, 4, 3)), 0.2, NEED)
    wood = registry.get("wood")
    with pytest.raises(InvalidInput, match="relaxes no surfaces"):
        wood.relaxed(wood.parse({}, "twig"), np.zeros((4, 8, 3)), 0.0)


def test_the_worst_element_is_the_same_whether_energies_are_asked_for_or_not() -> None:
    """Least J/Jd with and without the energy, which take ways of their own."""
    solver = registry.get("dehydration")
    plain, more = (
        solver.relaxed(
            solver.parse(EIGHTH), ridged(0.83, 0.03), 0.2, NEED.model_copy(update={"fields": fields}), steps=1
        ).isel(stage=0)
        for fields in (("least_jacobian",), ("least_jacobian", "strain_energy"))
    )
    assert float(plain["least_jacobian"]) == float(more["least_jacobian"])
    assert 0.4 < float(plain["least_jacobian"]) < 1.0
    assert float(more["strain_energy"]) > 0
    assert "strain_energy" not in plain
