"""A new colony's total, and the links that organisms spread along, against closed forms and plain loops."""

import numpy as np
import pytest

from solver.decay import SOLVER
from solver.decay.fields.diffusion import linked
from solver.decay.fields.layer import Layer
from solver.decay.fields.rates import daily
from solver.decay.surfaces.surface import geodesic, triangulated


@pytest.mark.parametrize("share", [1.0, 0.3])
@pytest.mark.parametrize("cells", [4, 12, 30])
def test_a_colony_has_the_total_of_its_bump_on_every_mesh(cells, share):
    """The integral of (1 - r^2/R^2)^2 over a disc is pi R^2 / 3; the coarsest mesh has no vertex in it but one."""
    params = SOLVER.parse({"climate": "paper"})
    sphere, radius = triangulated(*geodesic(cells)), 0.15
    layer = Layer(sphere, daily(params.rot, params, 30.0), np.ones(len(sphere.points)), np.ones(len(sphere.points)))
    centre = np.array([0.6, 0.0, 0.8])
    state = layer.seeded(layer.fresh, centre, radius, share=share)
    total = share * params.rot.d2 * np.pi * radius**2 / 3
    assert sphere.area @ state.u == pytest.approx(total, rel=1e-12)
    assert state.added * sphere.area.sum() == pytest.approx(total, rel=1e-12)
    assert np.linalg.norm(sphere.points[state.u > 0] - centre, axis=1).max() < max(radius, 1.2 / cells)


def open_(rot: float) -> float:
    """Return how open the gate is: a cubic from 0 at 0.002 to 1 at 0.02."""
    x = float(np.clip((rot - 0.002) / 0.018, 0, 1))
    return 3 * x**2 - 2 * x**3


def test_links_pass_what_the_gate_lets_through():
    sphere = triangulated(*geodesic(4))
    chance = np.random.default_rng(0)
    c, rot = chance.uniform(0, 1, len(sphere.points)), chance.uniform(0, 0.03, len(sphere.points))
    c[::7] = 0
    listed = np.sort(chance.permutation(len(c))[:120])
    links = linked(c, rot, listed, sphere.start, sphere.near, sphere.weight, sphere.area)
    found, wanted = np.zeros((2, 120, 120))
    for p, i in enumerate(listed):
        for k in range(links.first[p], links.first[p + 1]):
            found[p, links.to[k]] = links.share[k]
        for k in range(sphere.start[i], sphere.start[i + 1]):
            j = sphere.near[k]
            if j in listed and c[i] > 0 and c[j] > 0 and open_(rot[i]) > 0 and open_(rot[j]) > 0:
                mean = 2 / (1 / c[i] + 1 / c[j])
                gate = open_((rot[i] + rot[j]) / 2)
                wanted[p, np.searchsorted(listed, j)] = sphere.weight[k] * mean * gate / sphere.area[i]
    assert (wanted > 0).sum() > 100
    assert found == pytest.approx(wanted, rel=1e-12, abs=1e-15)
    # what leaves one arrives at the other
    flow = found * sphere.area[listed, None]
    assert flow == pytest.approx(flow.T, rel=1e-12, abs=1e-15)
