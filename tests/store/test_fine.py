"""Wrinkles finer than the coarsest lattice that shapes are compared on are compared, too."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import sph_harm_y

from solver import registry
from solver.arrays import Array
from solver.dehydration import SOLVER
from solver.dehydration.measures.harmonics import quadrature, remove_low
from solver.lattice import directions, lattice
from store.blending import methods
from store.blending.blend import Blender, powers
from store.blending.methods.weights import Samples
from store.generations import trust
from store.lookup import ShapeTable
from store.starter import ROOT
from store.surfaces import spectra
from store.surfaces.measures import lattice_for

DEGREE, BAND = 72, 80
SHAPES = registry.surface(SOLVER.name)


def wrinkled(order: int) -> Array:
    """Spectra (stage, component, m, k, part) of a sphere with waves of one degree."""
    theta, phi = lattice(BAND)
    heights = 0.05 * sph_harm_y(DEGREE, order, theta, phi).real
    waves = spectra.spectrum(heights[..., None] * directions(theta, phi))
    return np.ascontiguousarray(np.moveaxis(waves, -1, 0)).view(float).reshape(1, 3, BAND + 1, BAND + 1, 2)


def test_waves_above_the_coarsest_lattice_are_alike_or_not() -> None:
    assert SHAPES is not None
    assert lattice_for(0) < DEGREE
    samples = Samples(np.array([[10.0], [20.0], [30.0]]))
    shapes = [SHAPES.of(SOLVER.parse({"te": 0.01}).model_dump())] * 3
    alike, other = (np.stack([wrinkled(m) for m in orders]) for orders in ((8, 8, 8), (8, 24, 40)))
    assert trust.correlations(alike, samples, shapes)[0] > 0.999
    assert abs(trust.correlations(other, samples, shapes)[0]) < 0.01
    method = methods.parse("linear")
    for stored, off in ((alike, 0.0), (other, 1.0)):
        blender = Blender(stored, samples, powers(stored))
        found = trust.leave_one_out(blender, stored, samples, shapes, method)
        # in the middle: a mean of the two beside it
        assert abs(1 - found[1, 0, -1] - off) < 0.01


@pytest.mark.parametrize(("name", "point"), [("sphere-01", {"gamma": 17.0}), ("jujube1", {"te": 0.018, "gamma": 8.0})])
def test_a_coarse_lattice_says_what_it_holds(name: str, point: dict[str, float]) -> None:
    """At least that share of the height, as the solver's own harmonics measure it; and not much more."""
    table = ShapeTable.open(ROOT, name, surfaces=registry.surface)
    for stage in (0.0, 0.07, 0.2, 0.3):
        said = [table.at(point, stage, resolution=n, fields=("displacement",)) for n in (16, 24, 48, 1024)]
        shares = [one.held for one in said]
        assert None not in shares
        assert shares == sorted(shares)
        assert shares[-1] == table.at(point, stage, fields=()).held == 1.0
        if stage == 0:
            assert shares[0] == 1.0
            continue
        heights = [height(one.displacement) for one in (*said[:-1], table.at(point, stage, fields=("displacement",)))]
        assert shares[0] < 0.9
        # of waves of higher degrees a lattice holds the parts that are no finer along either angle: up to .22 measured
        for share, found in zip(shares[:-1], heights[:-1], strict=True):
            assert share - 0.01 < found / heights[-1] < share + 0.25


def height(displacement: Array | None) -> float:
    """Root mean square of wrinkles (n, 2n, 3)."""
    assert displacement is not None
    n = len(displacement)
    weights = np.repeat(quadrature(n)[:, None], 2 * n, axis=1)
    wrinkles = [remove_low(displacement[..., k].astype(float), 3) for k in range(3)]
    return float(np.sqrt(sum((weights * one**2).sum() for one in wrinkles) / weights.sum()))
