"""The implicit elements: derivatives, patches, twins, symmetry, loading, the factorisation and what users call."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.sparse import bsr_array

from solver.contract import Cancelled, Context, InvalidInput, NotConverged
from solver.dehydration import SOLVER
from solver.dehydration.implicit import (
    Band,
    BaseState,
    Equilibrium,
    Patch,
    base_state,
    build_band_mesh,
    build_model,
    build_quadratic_mesh,
    carried,
    equilibrium,
    graded_layers,
)
from solver.dehydration.implicit.buckling import parities
from solver.dehydration.implicit.hexahedron import PRESSURE
from solver.dehydration.implicit.location import interpolate, locate
from solver.dehydration.implicit.newton import masked
from solver.dehydration.params import DehydrationParams
from solver.fem import HEX27

from ._implicit_twin import block, twin_energy, twin_force

FRUIT = DehydrationParams.parse({"te": 0.1})
PLUM = DehydrationParams(radii=(1, 0.98, 0.93, 0.9, 0.93, 0.98, 1, 0.63), stone=(0.3, 0.3), exocarp_thickness=0.1)


def sphere_model(n=2, layers=2, symmetry="octant", kappa=100.0, loading=None):
    return build_model(FRUIT, build_quadratic_mesh(FRUIT, n, graded_layers(layers, 1.0), symmetry), kappa, loading)


@pytest.mark.parametrize("anisotropic", [False, True])
def test_force_and_energy_agree_with_the_twin(anisotropic):
    rng = np.random.default_rng(0)
    case = block(rng, 1)
    stretch = np.full((1, 27, 3), 0.9) if not anisotropic else rng.uniform(0.8, 1.2, (1, 27, 3))
    swept = case.sweep(case.positions + 0.03 * rng.normal(size=case.positions.shape), stretch, rng)
    assert swept.energy == pytest.approx(twin_energy(case, swept.deformed, stretch), rel=1e-12)
    expected = twin_force(case, swept.deformed, stretch)
    assert np.abs(swept.force - expected).max() < 1e-11 * np.abs(expected).max()


def test_residual_is_the_gradient_and_tangent_the_derivative_with_second_order_slopes():
    rng = np.random.default_rng(1)
    model = sphere_model()
    stretch = model.stretch(0.06)
    deformed = equilibrium(model, 0.06).deformed + 1e-3 * rng.normal(size=model.mesh.positions.shape)
    at = model.sweep(deformed, stretch)
    tangent = model.sweep(deformed, stretch, at.pressure).data
    loose = model.pattern.free >= 0
    direction = rng.normal(size=deformed.shape) * loose[:, None]
    size = 3 * int(loose.sum())
    matrix = bsr_array((tangent, model.pattern.indices, model.pattern.indptr), shape=(size, size))
    product = (matrix @ direction[loose].ravel()).reshape(-1, 3)
    work, errors = np.sum(at.force * direction), []
    for h in (4e-4, 2e-4):
        ahead, back = (model.sweep(deformed + sign * h * direction, stretch) for sign in (1, -1))
        by_force = (ahead.force - back.force)[loose] / (2 * h)
        errors.append((abs((ahead.energy - back.energy) / (2 * h) - work), np.abs(by_force - product).max()))
    slopes = np.log2(np.array(errors[0]) / np.array(errors[1]))
    assert np.allclose(slopes, 2, atol=0.1)
    assert abs(matrix - matrix.T).max() < 1e-11 * abs(matrix).max()


def test_factorisation_solves_and_counts_negative_eigenvalues():
    model = sphere_model(4)
    data = model.sweep(model.mesh.positions, model.stretch(0.0), np.zeros((len(model.mesh.connectivity), 8))).data
    right = np.random.default_rng(2).normal(size=model.free.size)
    held = masked(model.pattern, data, model.free)
    matrix = bsr_array((held, model.pattern.indices, model.pattern.indptr), shape=(right.size,) * 2)
    factor = model.factor(data)
    assert factor.negative == 0
    assert np.abs(matrix @ factor.solve(right) - right).max() < 1e-10
    for shift in (0.3, 1.0):
        shifted = data.copy()
        rows = np.repeat(np.arange(len(model.free)), np.diff(model.pattern.indptr))
        for i in range(3):
            shifted[rows == model.pattern.indices, i, i] -= shift
        held = masked(model.pattern, shifted, model.free)
        dense = bsr_array((held, model.pattern.indices, model.pattern.indptr), shape=(right.size,) * 2).toarray()
        factor = model.factor(shifted)
        assert factor.negative == int(np.sum(np.linalg.eigvalsh(dense) < 0)) > 0
        assert np.abs(dense @ factor.solve(right) - right).max() < 1e-8


@pytest.mark.parametrize("params", [FRUIT, PLUM], ids=["octant", "plum"])
def test_parts_between_symmetry_planes_give_the_whole_fruit(params):
    whole = base_state(params, 0.04, n=2, layers=2, symmetry="whole")
    rng = np.random.default_rng(3)
    points = whole.nodes[rng.integers(0, len(whole.nodes), 60)]
    for symmetry, share in (("quarter", 4), ("octant", 8)):
        part = base_state(params, 0.04, n=2, layers=2, symmetry=symmetry)
        assert part.energy * share == pytest.approx(whole.energy, rel=1e-9)
        assert np.abs(part(points) - whole(points)).max() < 1e-8


def test_parities_count_every_component_once():
    """Fresh modes of the whole split into those of the parities: their free components add up to the whole's."""
    octant, whole = sphere_model(2), sphere_model(2, symmetry="whole")
    assert sum(int(free.sum()) for _, free in parities(octant)) == int(whole.free.sum())


def test_a_state_can_be_asked_anywhere():
    state = base_state(PLUM, 0.05, n=4, layers=3)
    assert np.abs(state(state.nodes) - state.displaced).max() < 1e-9
    theta, phi = np.meshgrid(np.linspace(0, np.pi, 7), np.linspace(-np.pi, np.pi, 9), indexing="ij")
    surface = state.surface(theta, phi)
    assert surface.shape == (7, 9, 3)
    assert np.linalg.norm(surface - PLUM.surface(theta, phi), axis=-1).max() < 0.1
    # the stone stays
    rays = np.random.default_rng(4).normal(size=(20, 3))
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    stone = rays * PLUM.stone_distance(rays)[:, None]
    assert np.abs(state(stone) - stone).max() < 1e-4


def test_loading_may_be_a_field_anisotropic_and_swelling():
    def wetter_at_x(points, s):
        return (1 - s * (1 + 0.5 * points[:, :1])) * np.array([1.0, 1.02, 1.0])

    state = base_state(FRUIT, 0.04, n=2, layers=2, loading=wetter_at_x)
    assert state.mesh.planes == ()
    ends = state(np.array([[1.0, 0, 0], [-1.0, 0, 0]]))
    assert ends[0, 0] + ends[1, 0] < -1e-3
    swollen = base_state(FRUIT, -0.05, n=2, layers=2)
    assert np.linalg.norm(swollen(np.array([[1.0, 0, 0]]))) > 1.03
    uniform = base_state(FRUIT, 0.04, n=2, layers=2, loading=lambda points, s: 1 - s, symmetry="octant")
    assert np.array_equal(uniform.displaced, base_state(FRUIT, 0.04, n=2, layers=2).displaced)


def test_failures_are_typed():
    with pytest.raises(InvalidInput, match="even n"):
        base_state(FRUIT, 0.05, n=3)
    with pytest.raises(InvalidInput, match="not positive"):
        base_state(FRUIT, 0.05, n=2, layers=2, loading=lambda points, s: -1.0)
    with pytest.raises(Cancelled):
        base_state(FRUIT, 0.05, n=2, layers=2, context=Context(cancelled=lambda: True))
    with pytest.raises(NotConverged) as failure:
        base_state(FRUIT, 0.97, n=2, layers=1)
    assert failure.value.last_stage is not None
    assert failure.value.residual is not None
    assert failure.value.advice


def test_newton_is_quadratic_and_history_is_kept():
    state = base_state(FRUIT, 0.05, n=2, layers=2, kappa_ratio=1e5)
    (stage, history), *more = state.residuals
    assert stage == 0.05
    assert not more
    assert len(history) <= 7
    assert state.state.steps == len(history) - 1
    assert PRESSURE.shape == (27, 8)


def test_a_patch_follows_the_whole_it_is_cut_from():
    """Its edge stays where the whole's state puts it, and inside equilibrium finds the whole's state again."""
    whole = base_state(FRUIT, 0.05, n=4, layers=graded_layers(2, 1.0), kappa_ratio=100.0)
    patch = Patch(np.array([1.1, 0.0, 0.0]), 0.7)
    mesh = build_quadratic_mesh(FRUIT, 4, graded_layers(2, 1.0), "octant", patch=patch)
    assert 0 < len(mesh.stacks) < len(whole.mesh.stacks)
    model = build_model(FRUIT, mesh, 100.0)
    start = carried(whole, model)
    disturbed = start.deformed.copy()
    inside = np.flatnonzero(model.pattern.free >= 0)
    disturbed[inside] += 1e-3 * model.free * np.sin(40 * mesh.positions[inside])
    found = equilibrium(model, 0.05, guess=dataclasses.replace(start, deformed=disturbed))
    edge = np.repeat(mesh.cut, mesh.levels)
    assert edge.any()
    np.testing.assert_allclose(found.deformed, whole(mesh.positions), atol=1e-9)
    for _, free in parities(model):
        assert not free[edge[inside]].any()
    disturbed[inside] += 0.3 * model.free * np.sin(40 * mesh.positions[inside])
    with pytest.raises(NotConverged, match="near a guess"):
        equilibrium(model, 0.05, guess=dataclasses.replace(start, deformed=disturbed), alone=True)


def test_a_band_follows_the_whole_it_is_cut_from():
    """Its sides and its foot, above the stone, stay where the whole's state puts them."""
    core = graded_layers(2, 1.0)
    whole = base_state(FRUIT, 0.05, n=8, layers=core, kappa_ratio=100.0)
    mesh = build_band_mesh(FRUIT, Band(0.6, 1.2, 0.3, np.pi / 2, 4, 8), core[1:], "quarter", 1, None)
    assert len(mesh.stacks) == 32
    assert mesh.breaks[0] == core[1]
    model = build_model(FRUIT, mesh, 100.0)
    found = equilibrium(model, 0.05, guess=carried(whole, model), alone=True).deformed
    np.testing.assert_allclose(found, whole(mesh.positions), atol=1e-4)
    assert np.linalg.norm(found - mesh.positions, axis=1)[:: mesh.levels].min() > 1e-3
    # points of its elements are found in them, and none beside or below it
    local = np.array([[0.3, -0.4, 0.5]])
    points = np.matmul(HEX27.shape(local), mesh.positions[mesh.connectivity])[:, 0]
    element, at = locate(FRUIT, mesh, points)
    np.testing.assert_array_equal(element, np.arange(len(points)))
    np.testing.assert_allclose(at, np.repeat(local, len(points), axis=0), atol=1e-6)
    around = FRUIT.surface(np.array([0.5, 1.3, 0.9, 0.9]), np.array([1.0, 1.0, 0.2, 1.0])) * [[1], [1], [1], [0.6]]
    np.testing.assert_array_equal(interpolate(FRUIT, mesh, np.ones_like(mesh.positions), around), 0.0)


def test_a_thin_skin_is_carried_to_a_patch_as_thick_as_it_was():
    """By share of depth: faces of the coarse mesh miss the fruit by as much as its skin is thick."""
    thin = SOLVER.parse({"r8": 0.38}, "wolfberry")
    assert isinstance(thin, DehydrationParams)
    core, foot = np.array([0.0, 0.5, 0.8, 0.95, 1.0]), 0.95
    coarse = build_quadratic_mesh(thin, 8, core, "quarter", 2, foot=foot)
    fine = build_quadratic_mesh(thin, 60, core, "quarter", 2, Patch(np.array([0.071, 0.783, 0.198]), 0.1), foot)
    assert coarse.foot == fine.foot == foot

    def swollen(mesh):
        """Return nodes whose skin has become a tenth thicker, along its columns."""
        columns = mesh.positions.reshape(-1, mesh.levels, 3).copy()
        columns[:, -4:] += 0.1 * (columns[:, -4:] - columns[:, -5:-4])
        return columns.reshape(-1, 3)

    state = Equilibrium(0.0, swollen(coarse), np.zeros((len(coarse.connectivity), PRESSURE.shape[1])))
    found = carried(BaseState(thin, build_model(thin, coarse, 100.0), state), build_model(thin, fine, 100.0)).deformed
    missed = np.linalg.norm(found - swollen(fine), axis=1).max()
    assert missed < 0.01 * 0.1 * thin.exocarp_thickness
