"""Sparse algebra against dense algebra."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import bsr_array

from solver.linalg.cholesky import factor
from solver.linalg.dissection import dissect
from solver.linalg.krylov import conjugate_gradients, times
from solver.linalg.multifrontal import analyse, factorise
from solver.linalg.patterns import of_cliques, of_pairs, places
from solver.linalg.substitution import substitute


def springs(seed: int = 0, n: int = 150):
    """A bundle of points coupled with their near ones: places (n, 3), pattern, blocks, the dense matrix."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(size=(n, 3)) * [8.0, 1.0, 1.0]
    pairs = np.argwhere(np.triu(np.linalg.norm(x[:, None] - x[None], axis=-1) < 0.7, 1))
    pattern = of_pairs(pairs, n)
    blocks = np.zeros((len(pattern.indices), 3, 3))
    blocks[pattern.diagonal] += 0.1 * np.eye(3)
    at = places(pairs, pattern.indptr, pattern.indices)
    for (i, j), where in zip(pairs, at, strict=True):
        way = (x[j] - x[i]) / np.linalg.norm(x[j] - x[i])
        blocks[where.ravel()] += np.outer(way, way) * np.array([1, -1, -1, 1])[:, None, None]
    dense = bsr_array((blocks, pattern.indices, pattern.indptr), shape=(3 * n, 3 * n)).toarray()
    return x, pattern, blocks, dense


def order(x, pattern, leaf_size, thin=False):
    row = np.repeat(np.arange(len(x)), np.diff(pattern.indptr))
    pairs = np.column_stack([row, pattern.indices])[row <= pattern.indices]
    return analyse(pairs, x[pairs].mean(axis=1), pattern.indptr, pattern.indices, leaf_size=leaf_size, thin=thin)


@pytest.mark.parametrize("leaf_size", [5, 40, 10_000])
def test_a_graph_is_factored_wherever_it_is_cut(leaf_size):
    x, pattern, blocks, dense = springs()
    assert np.abs(dense - dense.T).max() == 0
    right = np.random.default_rng(1).normal(size=len(dense))
    found = order(x, pattern, leaf_size)
    assert sorted(np.concatenate([f.nodes[: f.own] for f in found.fronts])) == list(range(len(x)))
    factor = factorise(found, blocks)
    assert factor.solve(right) == pytest.approx(np.linalg.solve(dense, right), rel=1e-9, abs=1e-9)
    assert factor.negative == 0


def test_inertia_is_counted_where_the_matrix_is_indefinite():
    x, pattern, blocks, dense = springs(2)
    blocks[pattern.diagonal] -= 0.9 * np.eye(3)
    shifted = dense - 0.9 * np.eye(len(dense))
    factor = factorise(order(x, pattern, 40), blocks)
    assert factor.negative == int((np.linalg.eigvalsh(shifted) < 0).sum()) > 0
    right = np.ones(len(dense))
    assert factor.solve(right) == pytest.approx(np.linalg.solve(shifted, right), rel=1e-7, abs=1e-7)


def test_conjugate_gradients_solve_and_notice_a_direction_that_curves_down():
    _, pattern, blocks, dense = springs(3)
    right = np.random.default_rng(4).normal(size=(len(dense) // 3, 3))
    assert times(pattern.indptr, pattern.indices, blocks, right).ravel() == pytest.approx(dense @ right.ravel())
    x, iterations, upwards = conjugate_gradients(*pattern, blocks, right, 1e-12, 2000)
    assert upwards
    assert 3 < iterations < 2000
    assert x.ravel() == pytest.approx(np.linalg.solve(dense, right.ravel()), rel=1e-7, abs=1e-7)
    # the diagonal, which preconditions, stays positive
    blocks[np.setdiff1d(np.arange(len(blocks)), pattern.diagonal)] *= 3
    assert not conjugate_gradients(*pattern, blocks, right, 1e-12, 2000)[2]


def test_patterns_of_pairs_and_of_cliques_are_the_same_and_know_their_places():
    cliques = np.array([[0, 1, 2], [2, 3, -1], [4, 2, 1]])
    found = of_cliques(cliques, 5)
    pairs = np.array([[0, 1], [0, 2], [1, 2], [2, 3], [4, 2], [4, 1]])
    for a, b in zip(found, of_pairs(pairs, 5), strict=True):
        assert np.array_equal(a, b)
    at = places(cliques, found.indptr, found.indices)
    row = np.repeat(np.arange(5), np.diff(found.indptr))
    for clique, where in zip(cliques, at, strict=True):
        for a, i in enumerate(clique):
            for b, j in enumerate(clique):
                if i < 0 or j < 0:
                    assert where[a, b] == -1
                else:
                    assert (row[where[a, b]], found.indices[where[a, b]]) == (i, j)
    assert places(np.array([[0, 4]]), found.indptr, found.indices)[0, 0, 1] == -1


@pytest.mark.parametrize("leaf_size", [3, 20, 10_000])
def test_single_factors_solve_for_motions_across_and_within(leaf_size):
    """Of two graph Laplacians with springs to the ground: dense algebra on each part of the right side."""
    x, pattern, _, _ = springs()
    rng, n = np.random.default_rng(2), len(x)
    row = np.repeat(np.arange(n), np.diff(pattern.indptr))
    ends = np.column_stack([row, pattern.indices])[row < pattern.indices]
    parts = np.concatenate([ends, np.repeat(np.arange(n)[:, None], 2, axis=1)])
    fronts = dissect(parts, x[parts].mean(axis=1), n, leaf_size)
    assert sorted(np.concatenate(_eliminated(fronts)).tolist()) == list(range(n))
    dense, factors = [], []
    for _ in range(2):
        stiff = rng.uniform(0.5, 2, len(ends))
        matrix = np.diag(rng.uniform(0.2, 1, n))
        for (i, j), k in zip(ends, stiff, strict=True):
            matrix[[i, j], [i, j]] += k
            matrix[[i, j], [j, i]] -= k
        work = factor(fronts, pattern.indptr, pattern.indices, matrix[row, pattern.indices])
        while True:
            try:
                next(work)
            except StopIteration as done:
                factors.append(done.value)
                break
        dense.append(matrix)
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    right, found = 1e6 * rng.normal(size=(n, 3)), np.empty((n, 3))
    substitute(right, normals, fronts, *factors, found)
    normal = (right * normals).sum(axis=1)
    across, within = np.linalg.solve(dense[0], normal), np.linalg.solve(dense[1], right - normal[:, None] * normals)
    # motions found within the surface of each vertex's neighbours may leave its own: that part is taken off
    wanted = within + (across - (within * normals).sum(axis=1))[:, None] * normals
    # the factors are of single precision
    assert np.abs(found - wanted).max() < 1e-4 * np.abs(wanted).max()


def _eliminated(fronts):
    starts = fronts.starts[:-1, 0]
    return [fronts.nodes[at : at + own] for at, own in zip(starts, fronts.own, strict=True)]


def test_a_factor_of_what_is_not_finite_is_refused():
    x, pattern, _, _ = springs()
    row = np.repeat(np.arange(len(x)), np.diff(pattern.indptr))
    pairs = np.column_stack([row, pattern.indices])[row <= pattern.indices]
    fronts = dissect(pairs, x[pairs].mean(axis=1), len(x), 20)
    data = np.where(row == pattern.indices, np.nan, 0.0)
    with pytest.raises(np.linalg.LinAlgError):
        list(factor(fronts, pattern.indptr, pattern.indices, data))


def test_fronts_that_only_join_are_kept_and_empty_ones_left_out():
    """Spokes of one hub, each pair eight times as contact has them: the hub is in all fronts and eliminated last."""
    spokes = 16
    pairs = np.repeat(np.stack([np.zeros(spokes, int), np.arange(1, spokes + 1)], -1), 8, axis=0)
    pattern = of_pairs(pairs, spokes + 1)
    centres = np.stack([pairs[:, 1], np.zeros(len(pairs)), np.zeros(len(pairs))], -1).astype(float)
    found = analyse(pairs, centres, pattern.indptr, pattern.indices, leaf_size=2)
    assert len(found.fronts) < 2 * spokes
    assert any(not front.own for front in found.fronts)
    blocks = np.zeros((len(pattern.indices), 3, 3))
    blocks[:] = -np.eye(3)
    blocks[pattern.diagonal] = 20 * np.eye(3)
    dense = bsr_array((blocks, pattern.indices, pattern.indptr), shape=(3 * (spokes + 1),) * 2).toarray()
    right = np.random.default_rng(0).normal(size=len(dense))
    assert np.abs(dense @ factorise(found, blocks).solve(right) - right).max() < 1e-12


def test_thin_cuts_leave_less_to_eliminate_of_a_wide_and_short_graph():
    """Layers of 10 by 2 points, each bound to the next two layers: a cut across the layers' short side is thinnest."""
    at = np.stack(np.meshgrid(np.arange(12) * 0.9, np.arange(10), np.arange(2), indexing="ij"), -1).reshape(-1, 3)
    reach = np.abs(at[:, None] - at[None]) / [0.9, 1, 1]
    pairs = np.argwhere(np.triu((reach[..., 0] <= 3) & (reach[..., 1:] <= 1).all(-1), 1))
    pattern = of_pairs(pairs, len(at))
    blocks = np.zeros((len(pattern.indices), 3, 3))
    blocks[:] = -np.eye(3)
    blocks[pattern.diagonal] = 100 * np.eye(3)
    dense = bsr_array((blocks, pattern.indices, pattern.indptr), shape=(3 * len(at),) * 2).toarray()
    right, work = np.random.default_rng(0).normal(size=3 * len(at)), []
    for thin in (False, True):
        found = order(at, pattern, 60, thin)
        sizes = np.array([[len(front.nodes), front.own] for front in found.fronts])
        work.append(int((sizes[:, 0] ** 3 - (sizes[:, 0] - sizes[:, 1]) ** 3).sum()))
        assert sizes[:, 1].sum() == len(at)
        # where nothing is eliminated two parts are joined: else a front only hands on what comes from within
        assert all(front.own or len(front.children) == 2 for front in found.fronts)
        x = factorise(found, blocks).solve(right)
        assert np.abs(dense @ x - right).max() < 1e-12
    assert work[1] < 0.8 * work[0]
