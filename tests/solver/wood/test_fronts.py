"""The factor's fronts against a sparse solver."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from solver.contract import Need
from solver.wood import SOLVER
from solver.wood.forces.hessian import Stiffness
from solver.wood.model.bundle import lay
from solver.wood.stepping.dissection import dissected
from solver.wood.stepping.fronts import factored, solved


@pytest.mark.parametrize("double", [False, True])
def test_fronts_solve_as_a_sparse_solver_does(double):
    wood = lay(SOLVER.parse({"rods": 30, "vertices": 16}), 16)
    m = wood.motion
    free = m.held == 0
    pattern = Stiffness(wood.rods, wood.bonds, free)
    blocks = pattern.blocks(m.x, wood.rods, wood.bonds, 1e5)
    scale = 1 / np.sqrt(np.einsum("vii->vi", blocks[pattern.diagonal]))
    row = np.repeat(np.arange(pattern.size), np.diff(pattern.indptr))
    blocks *= scale[row][:, :, None] * scale[pattern.indices][:, None, :]
    fronts = factored(dissected(m.x[free], pattern.indptr, pattern.indices), blocks, double)
    matrix = sp.bsr_matrix((blocks, pattern.indices, pattern.indptr)).tocsc()
    right = np.random.default_rng(0).normal(size=(pattern.size, 3))
    x = right.astype(np.float32)
    solved(x, fronts)
    exact = spsolve(matrix, right.ravel()).reshape(-1, 3)
    # what is single is kept to 6e-8, times a condition of some thousands
    assert x == pytest.approx(exact, abs=2e-3 * np.abs(exact).max())


def test_what_is_not_positive_has_no_factor():
    wood = lay(SOLVER.parse({"rods": 7, "vertices": 8}), 8)
    free = wood.motion.held == 0
    pattern = Stiffness(wood.rods, wood.bonds, free)
    blocks = pattern.blocks(wood.motion.x, wood.rods, wood.bonds, -1e6)
    assert factored(dissected(wood.motion.x[free], pattern.indptr, pattern.indices), blocks) is None


def test_one_thread_s_bytes_are_any_number_s():
    """BLAS is held to one thread within a run."""
    from threadpoolctl import threadpool_limits

    values = {"rods": 9, "vertices": 10, "mode": "implicit", "step": 2e-3, "clamp": "start", "gravity": 9.81}
    found = []
    for threads in (1, 2):
        with threadpool_limits(threads, user_api="blas"):
            found.append(SOLVER.solve(SOLVER.parse(values), Need(stages=(0.02,), fields=("tip_position",))))
    assert found[0].tip_position.values.tobytes() == found[1].tip_position.values.tobytes()
