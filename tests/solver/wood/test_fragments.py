"""Fragments against SciPy's graphs."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from solver.wood import SOLVER
from solver.wood.model.bundle import lay
from solver.wood.model.fragments import fragments


def test_fragments_are_the_components_of_a_graph_of_edges_and_bonds():
    """Most edges and bonds broken at random."""
    values = {"rods": 12, "vertices": 8, "clamp": "none", "fracture": "none", "mass_scaling": 4.0}
    wood = lay(SOLVER.parse(values), 8)
    r, b, m = wood.rods, wood.bonds, wood.motion
    chance = np.random.default_rng(5)
    r.alive[:] = chance.uniform(size=len(r.alive)) < 0.6
    b.on[:] = chance.uniform(size=len(b.on)) < 0.1
    edge, bond = (r.alive == 1) & (r.k > 0), b.on == 1
    i, j = np.append(r.a[edge], r.a[b.i[bond]]), np.append(r.b[edge], r.a[b.j[bond]])
    count, label = connected_components(coo_array((np.ones(len(i)), (i, j)), shape=(len(m.mass),) * 2), directed=False)
    found = fragments(r, b, m.held, m.mass, 4.0, 0.0)
    assert 5 < count < 60
    # the same parts, whatever their numbers
    assert len(found.gain) == count == len(set(zip(found.of.tolist(), label.tolist(), strict=True)))
    assert np.sort(found.heavy) == pytest.approx(np.sort(np.bincount(label, m.mass)), rel=1e-12)
