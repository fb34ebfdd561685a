"""What is returned is in balance on the mesh, and against the rest state, that are returned with it."""

import numpy as np
import pytest

from solver import shell
from solver.contract import Context
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams

RIM = {"kind": "surface", "where": {"kind": "rim", "width": 0.3}, "stretch": (1.5, 1.0)}


def largest_force(engine: Engine, state, count: int = 60) -> float:
    """Largest force over mu l at random places, from differences of the energy of the returned arrays alone."""
    p = engine.params
    material = shell.Material(p.thickness, p.poisson)
    stiffness = shell.hinge_stiffness(state.g, state.mesh, material.flexural)

    def energy(x):
        nothing = np.zeros_like(x)
        return shell.membrane(x, state.mesh.triangles, state.g, material.lame, nothing) + shell.bending(
            x, state.mesh.hinges, state.rest, stiffness, nothing
        )

    generator, found, small = np.random.default_rng(3), 0.0, 1e-5 * state.length
    # where rest edges are shortest the last remeshing was: half of the places lie there
    edges = state.mesh.edges
    rest = np.linalg.norm(state.x[edges[:, 0]] - state.x[edges[:, 1]], axis=1)
    near = edges[np.argsort(rest)[: count // 2]].ravel()
    for vertex in [*generator.choice(near, count // 2), *generator.integers(0, len(state.x), count // 2)]:
        for axis in range(3):
            if state.held[vertex, axis]:
                continue
            move = np.zeros_like(state.x)
            move[vertex, axis] = small
            found = max(found, abs(energy(state.x + move) - energy(state.x - move)) / (2 * small))
    return found / state.length


@pytest.mark.parametrize("plasticity", [0.0, 0.5])
def test_what_is_returned_is_settled_on_its_own_mesh(plasticity):
    words = {"shape": "disc", "thickness": 0.05, "step": 0.1, "plasticity": plasticity, "yield_strain": 0.01}
    engine = Engine(GrowthParams.parse(words | {"tools": [RIM]}), 200, 1e-3, history=False)
    begun = len(engine.state.x)
    state = engine.reach(0.8, Context())
    assert len(state.x) > begun, "the mesh was cut on the way"
    assert largest_force(engine, state) <= 1.05e-3
    assert largest_force(engine, engine.reach(0.85, Context())) <= 1.05e-3, "between whole steps as well"
