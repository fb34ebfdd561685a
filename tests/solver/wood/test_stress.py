"""The stress list of the wood solver: every try ends well, or in a typed error."""

import pytest

from benchmarks.wood.rest import fragments
from benchmarks.wood.stress import CASES, tried
from solver.wood import SOLVER
from solver.wood.model.bundle import lay


@pytest.mark.parametrize("name", CASES)
def test_a_try_at_breaking_it_ends_well(name):
    assert tried(name)


def test_fragments_are_what_edges_and_bonds_join():
    wood = lay(SOLVER.parse({"rods": 9, "vertices": 8}), 8)
    assert fragments(wood).max() == 0
    wood.bonds.on[:] = 0
    assert fragments(wood).max() + 1 == len(wood.grid)
    # an edge cut inside, its rod's sixth
    wood.rods.alive[5] = 0
    assert fragments(wood).max() == len(wood.grid)
