"""A surface from elsewhere becomes an equilibrium: forces balance, and what it looked like stays."""

from __future__ import annotations

import numpy as np
import pytest

from solver import registry
from solver.arrays import Floats
from solver.contract import InvalidInput, Need
from solver.dehydration.fresh.mesh import cubed_sphere
from solver.dehydration.relax import RESIDUAL, on_columns
from solver.lattice import directions, lattice
from store.lookup import ShapeTable
from store.starter import ROOT
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
    assert np.corrcoef(*radii)[0, 1] > 0.3
    assert float(found["moved"]) > 0


@pytest.mark.slow
def test_a_looked_up_shape_comes_to_balance_and_keeps_its_pattern() -> None:
    table = ShapeTable.open(ROOT, surfaces=registry.surface)
    shape = table.at({"te": 0.0375, "gamma": 22.0}, 0.2, resolution=64)
    found, said = relaxed(registry.get("dehydration"), table, shape)
    assert found.tier == "relaxed"
    assert said["residual"] <= RESIDUAL
    assert found.converged
    assert found.crossings == 0
    assert shape.position is not None
    assert found.position is not None
    radii = [np.linalg.norm(one, axis=-1).ravel() for one in (found.position, shape.position)]
    assert np.corrcoef(*radii)[0, 1] > 0.8
    assert said["moved"] < 1


def test_what_is_no_lattice_or_relaxes_nothing_is_refused() -> None:
    solver = registry.get("dehydration")
    with pytest.raises(InvalidInput, match="no lattice"):
        solver.relaxed(solver.parse(EIGHTH), np.zeros((4, 4, 3)), 0.2, NEED)
    wood = registry.get("wood")
    with pytest.raises(InvalidInput, match="relaxes no surfaces"):
        wood.relaxed(wood.parse({}, "twig"), np.zeros((4, 8, 3)), 0.0)
