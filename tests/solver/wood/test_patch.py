"""Patches against the whole bundle, and the factor's fronts against a sparse solver."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from solver.contract import Need
from solver.wood import SOLVER
from solver.wood.bundle import lay
from solver.wood.contact import lag
from solver.wood.dissection import dissected
from solver.wood.equations import Equations, Step
from solver.wood.fronts import factored, solved
from solver.wood.hessian import Stiffness
from solver.wood.local import relaxed
from solver.wood.moment import begin
from solver.wood.newton import descend
from solver.wood.patch import cut_out, disturbed, surrounded

BLOCK = {"shape": "cylinder", "size": (0.02, 0.1, 0), "path": [{"time": 0, "position": (0.07, 0, 0.0165)}]}


def equations(**values):
    """Return a shaken bundle, touched by a block, and the equations of its next step."""
    params = SOLVER.parse({"rods": 19, "vertices": 14, "length": 0.15, "bodies": [BLOCK], "gravity": 9.81, **values})
    wood = lay(params, params.vertices)
    m = wood.motion
    rng = np.random.default_rng(3)
    free = m.held == 0
    m.x[free] += rng.normal(0, 2e-5, m.x.shape)[free]
    m.v[free] += rng.normal(0, 1e-2, m.x.shape)[free]
    state = begin(wood)
    lag(state)
    return Equations(state, Step(m.x.copy(), m.v.copy(), 1e-3, 0.0), params, None)


def test_a_patch_is_out_of_balance_as_the_whole_is():
    whole = equations()
    x = whole.state.wood.motion.x + np.random.default_rng(4).normal(0, 1e-5, whole.state.wood.motion.x.shape)
    x[whole.state.wood.motion.held == 1] = whole.state.wood.motion.x[whole.state.wood.motion.held == 1]
    r = whole.residual(x)
    touched = np.flatnonzero(np.abs(x[:, 0] - 0.07) < 0.006)[-1]
    inside = surrounded(whole.state.wood, np.array([touched]), 2, 10_000)
    assert 10 < inside.sum() < len(x) / 2
    patch = cut_out(whole.state, inside)
    step = whole.step._replace(xh=whole.step.xh[patch.vertices], vh=whole.step.vh[patch.vertices])
    small = Equations(patch.state, step, whole.params, None)
    found = small.residual(x[patch.vertices])
    scale = np.abs(r).max()
    assert found[patch.own] == pytest.approx(r[patch.free], abs=1e-12 * scale)
    assert not np.delete(found, patch.own, axis=0).any()
    # and so are its second derivatives
    way = np.zeros_like(x)
    way[patch.free] = np.random.default_rng(5).normal(size=(len(patch.free), 3))
    whole_product = whole.stiffness(False)(way)[patch.free]
    assert small.stiffness(False)(way[patch.vertices])[patch.own] == pytest.approx(
        whole_product, abs=1e-9 * np.abs(whole_product).max()
    )


def test_what_is_disturbed_holds_all_but_a_little():
    r = np.zeros((50, 3))
    r[7], r[20], r[33] = (3, 0, 0), (0, 4, 0), (0, 0, 0.1)
    assert sorted(disturbed(r, 0.2, 5)) == [7, 20]
    assert sorted(disturbed(r, 0.01, 5)) == [7, 20, 33]
    assert disturbed(r, 0.2, 1) is None


def test_a_break_is_relaxed_where_it_is():
    whole = equations(bodies=[], gravity=0.0, clamp="both")
    m = whole.state.wood.motion
    start = m.x.copy()
    m.x[:] = lay(whole.params, 14).motion.x
    rest = m.x.copy()
    # pulled out evenly by half a percent, then one rod is cut
    rest[:, 0] *= 1.005
    step = whole.step._replace(xh=rest.copy(), vh=np.zeros_like(rest))
    whole = Equations(whole.state, step, whole.params, None)
    whole.residual(rest)
    blocks = whole.stiffness(True)
    free = m.held == 0

    def jacobi(r):
        probe = np.zeros_like(r)
        probe[free] = 1.0
        return r / np.abs(blocks(probe) + 1e5)

    settled = descend(whole.residual, whole.stiffness, rest, jacobi, 1e-2, 4000, whole.limit, 0.0)
    assert settled.settled
    rods = whole.state.wood.rods
    middle = np.argmin(
        np.abs(settled.x[rods.a, 0] - 0.07) + np.abs(settled.x[rods.a, 1]) + np.abs(settled.x[rods.a, 2])
    )
    rods.alive[middle] = 0
    rods.whole[(rods.before == middle) | (rods.after == middle)] = 0
    state = begin(whole.state.wood)
    cut = Equations(state, step, whole.params, None)
    r = cut.residual(settled.x)
    norm = np.linalg.norm(r)
    assert norm > 1e2 * settled.norm
    found = relaxed(cut, settled.x, r, 1e-3 * norm, 0.0)
    left = np.linalg.norm(cut.residual(found))
    assert left < 0.5 * norm
    moved = np.flatnonzero(np.abs(found - settled.x).max(1) > 0)
    assert len(moved) < 0.7 * len(start)


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
