"""The compiled explicit kernel against a textbook twin."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numba
import numpy as np
import pytest

from solver.dehydration.kernel import (
    build_layout,
    element_report,
    internal_force,
    least_ratios,
    march,
    new_state,
    positions,
    strain_energy,
)

from ._kernel_twin import block_mesh, close, deformed, twin_energy, twin_gradient

BACKENDS = ("vector", "scalar")
pytestmark = pytest.mark.usefixtures("one_thread")


def assembled_twin(mesh, layout, state, theta, one_point):
    """(nodal gradient (nn, 3), per-element gradients (ne, 8, 3), energy) from the twin in float64.

    The mesh is a `block_mesh`: three elements a column, the core's two first.
    """
    fresh, position = positions(layout.fresh), positions(state)
    nodal, each, energy = np.zeros_like(fresh), [], 0.0
    elements = zip(mesh["connectivity"], mesh["is_exocarp"], mesh["mu"], mesh["kappa"], strict=True)
    for e, (nodes, skin, mu, kappa) in enumerate(elements):
        single = one_point and e % 3 < 2 - layout.full_levels
        kind = "exocarp" if skin else "one_point" if single else "core"
        arguments = (fresh[nodes], position[nodes], kind, mu, kappa, 1.0 if skin else theta)
        each.append(twin_gradient(*arguments))
        energy += twin_energy(*arguments)
        np.add.at(nodal, nodes, each[-1])
    return nodal, np.array(each), energy


@cache
def case(columns, one_point, full_levels):
    """A mesh, its layout, a state that nobody changes, and what the twin makes of them, which takes seconds."""
    rng = np.random.default_rng(5)
    mesh = block_mesh(rng, columns)
    layout = build_layout(**mesh, full_levels=full_levels)
    state, _ = deformed(layout, rng, 0.005)
    return mesh, layout, state, assembled_twin(mesh, layout, state, 0.9, one_point)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(("one_point", "full_levels"), [(False, 0), (True, 0), (True, 1), (True, 5)])
@pytest.mark.parametrize("columns", [(1, 1), (4, 5)])
def test_compiled_force_agrees_with_twin(backend, one_point, full_levels, columns):
    """One column fills a vector with 15 repetitions; 20 columns are a full strip and a quarter."""
    mesh, layout, state, (nodal, each, energy) = case(columns, one_point, full_levels)
    force = internal_force(layout, state, 0.9, one_point=one_point, backend=backend)
    close(force.nodal, nodal, 2e-5)
    free = ~mesh["fixed"]
    assert force.norm == pytest.approx(np.linalg.norm(nodal[free]), rel=1e-5)
    assert force.scale == pytest.approx(np.linalg.norm(each[free[mesh["connectivity"]]]), rel=1e-5)
    with np.errstate(all="raise"):
        assert strain_energy(layout, state, 0.9, one_point=one_point) == pytest.approx(energy, rel=1e-5)


@pytest.mark.parametrize("one_point", [False, True])
def test_back_ends_agree(one_point):
    rng = np.random.default_rng(6)
    layout = build_layout(**block_mesh(rng, (5, 5)))
    start, _ = deformed(layout, rng, 0.002, 1.0)
    results = []
    for backend in BACKENDS:
        state, velocity = start.copy(), np.zeros(start.shape, np.float32)
        march(layout, state, velocity, 40, theta=(1.0, 0.95), damping=0.05, one_point=one_point, backend=backend)
        results.append(state)
    moved = np.max(np.abs(results[0] - start))
    assert moved > 1e-3
    assert np.max(np.abs(results[0] - results[1])) < 1e-4 * moved
    assert all(np.all(result[:, 3] == 0) for result in results)
    assert all(np.array_equal(result[~layout.free], start[~layout.free]) for result in results)


def test_least_ratio_finds_the_inverted_element():
    rng = np.random.default_rng(7)
    mesh = block_mesh(rng, (3, 3))
    layout = build_layout(**mesh)
    state, _ = new_state(layout)
    ratios = element_report(layout, state, 1.0).least_ratio
    assert ratios.shape == (27,)
    assert np.allclose(ratios, 1.0, atol=1e-6)
    low, high = mesh["connectivity"][11][[0, 7]]
    state[[low, high], :3] = state[[high, low], :3]
    assert np.argmin(element_report(layout, state, 1.0).least_ratio) == 11
    assert element_report(layout, state, 1.0).least_ratio.min() < 0


def test_order_of_elements_and_of_their_nodes_does_not_matter():
    """Shuffled elements still form stacks; turned ones stand alone; the forces stay."""
    rng = np.random.default_rng(8)
    mesh = block_mesh(rng, (4, 5))
    layout = build_layout(**mesh)
    state, _ = deformed(layout, rng)
    expected = internal_force(layout, state, 0.9)
    order = rng.permutation(len(mesh["connectivity"]))
    shuffled = mesh | {name: mesh[name][order] for name in ("connectivity", "is_exocarp", "mu", "kappa")}
    again = build_layout(**shuffled)
    assert len(again.strips) == len(layout.strips)
    close(internal_force(again, state, 0.9).nodal, expected.nodal, 1e-5)
    # A quarter turn about zeta: (xi, eta) -> (eta, -xi).
    quarter = [4, 5, 0, 1, 6, 7, 2, 3]
    shuffled["connectivity"][::3] = shuffled["connectivity"][::3][:, quarter]
    turned = build_layout(**shuffled)
    assert len(turned.face_offsets) > len(layout.face_offsets)
    close(internal_force(turned, state, 0.9).nodal, expected.nodal, 1e-5)
    assert internal_force(turned, state, 0.9).scale == pytest.approx(expected.scale, rel=1e-5)


@pytest.mark.parametrize("columns", [(1, 1), (4, 5)])
def test_what_blows_up_stops_at_the_edge_of_the_range(columns):
    layout = build_layout(**block_mesh(np.random.default_rng(4), columns=columns))
    state, velocity = new_state(layout)
    speeds = np.array([1e6, -1e6, np.nan, 0.25])
    velocity[:, :3] = speeds[(np.arange(layout.nodes)[:, None] + np.arange(3)) % 4]
    expected = np.array([2**31 - 1, -(2**31), 0, 2**27])[(np.arange(layout.nodes)[:, None] + np.arange(3)) % 4]
    march(layout, state, velocity, 1, theta=(1.0, 1.0), damping=0.0, backend="vector")
    moved = (state.astype(np.int64) - layout.fresh)[:, :3] % 2**32
    assert np.all(moved[~layout.free] == 0)
    assert np.abs(moved - expected % 2**32)[layout.free].max() < 2**10  # forces of the fresh mesh are round-off


@pytest.mark.parametrize("backend", BACKENDS)
def test_same_bytes_on_one_and_two_threads(backend):
    if numba.config.NUMBA_NUM_THREADS < 2:
        pytest.skip("only one thread")
    rng = np.random.default_rng(9)
    layout = build_layout(**block_mesh(rng, (7, 9)))
    start, _ = deformed(layout, rng, 0.002, 1.0)
    results = []
    for threads in (1, 2, 2):
        numba.set_num_threads(threads)
        state, velocity = start.copy(), np.zeros(start.shape, np.float32)
        march(layout, state, velocity, 60, theta=(1.0, 0.9), damping=0.02, backend=backend)
        results.append(state.tobytes() + velocity.tobytes())
    assert all(a == b for a, b in pairwise(results))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mu": np.ones(3)}, "mu must have shape"),
        ({"kappa": np.zeros(27)}, "kappa must be positive"),
        ({"positions": np.full((64, 3), np.nan)}, "positions must be finite"),
        ({"connectivity": np.full((27, 8), 64)}, "connectivity must name nodes"),
        ({"positions": np.zeros((64, 3))}, "27 fresh elements are inverted or flat, element 0 worst"),
    ],
)
def test_inputs_that_are_no_mesh_are_refused(change, words):
    with pytest.raises(ValueError, match=words):
        build_layout(**(block_mesh(np.random.default_rng(14)) | change))


def test_misuse_is_refused():
    layout = build_layout(**block_mesh(np.random.default_rng(15)), one_point=False)
    state, velocity = new_state(layout)
    with pytest.raises(ValueError, match="without the one-point core"):
        march(layout, state, velocity, 1, theta=(1, 1), damping=0, one_point=True)
    with pytest.raises(ValueError, match="velocity must be"):
        march(layout, state, velocity.astype(float), 1, theta=(1, 1), damping=0)
    with pytest.raises(ValueError, match="negative"):
        march(layout, state, velocity, -1, theta=(1, 1), damping=0)


def test_least_ratios_alone_are_those_of_the_report():
    rng = np.random.default_rng(11)
    layout = build_layout(**block_mesh(rng, (5, 6)))
    state, _ = deformed(layout, rng, 0.002, 1.0)
    assert least_ratios(layout, state, 0.8).tobytes() == element_report(layout, state, 0.8).least_ratio.tobytes()
