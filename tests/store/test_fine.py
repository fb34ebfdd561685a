"""Wrinkles finer than the coarsest lattice that shapes are compared on are compared, too."""

from __future__ import annotations

import numpy as np
from scipy.special import sph_harm_y

from solver import registry
from solver.arrays import Array
from solver.dehydration import SOLVER
from solver.lattice import directions, lattice
from store.blending import methods
from store.blending.blend import Blender, powers
from store.blending.methods.weights import Samples
from store.generations import trust
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
    samples, shapes = (
        Samples(np.array([[10.0], [20.0], [30.0]])),
        [SHAPES.of(SOLVER.parse({"te": 0.01}).model_dump())] * 3,
    )
    alike, other = (np.stack([wrinkled(m) for m in orders]) for orders in ((8, 8, 8), (8, 24, 40)))
    assert trust.correlations(alike, samples, shapes)[0] > 0.999
    assert abs(trust.correlations(other, samples, shapes)[0]) < 0.01
    method = methods.parse("linear")
    for stored, off in ((alike, 0.0), (other, 1.0)):
        blender = Blender(stored, samples, powers(stored))
        found = trust.leave_one_out(blender, stored, samples, shapes, method)
        # in the middle: a mean of the two beside it
        assert abs(1 - found[1, 0, -1] - off) < 0.01
