"""The onset of buckling against exact references and closed forms, on both roads."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.special import eval_legendre, sph_harm_y
from threadpoolctl import threadpool_info, threadpool_limits

from solver.contract import Cancelled, Context, InvalidInput
from solver.dehydration import SOLVER, DehydrationParams
from solver.dehydration.bifurcation import AxisymmetricMode, Onset, base_state, full, onset
from solver.dehydration.bifurcation.base import Meridian
from solver.dehydration.bifurcation.meridional_elements import deformation, forces, moduli, tangents, volume_rates
from solver.dehydration.bifurcation.mirrored import mirrored_mode
from solver.dehydration.bifurcation.pencil import Pencil, Perturbations
from solver.dehydration.bifurcation.radial_elements import radial_mesh, smooth
from solver.dehydration.bifurcation.result import dominant_degree
from solver.dehydration.bifurcation.search import Valley
from solver.dehydration.fresh.closed_form import sphere_radius
from solver.fruit import directions
from solver.linalg.banded import pattern

REFERENCE = json.loads((Path(__file__).parent / "core_shell_sphere.json").read_text())


def sphere(stone: float = 0.4, te: float = 0.04, gamma: float = 10.0) -> DehydrationParams:
    return DehydrationParams.parse({"stone": (stone, stone), "te": te, "gamma": gamma})


def of(case: dict[str, Any]) -> DehydrationParams:
    return sphere(case["stone_radius"], case["exocarp_thickness"], case["gamma"])


@pytest.mark.parametrize("case", REFERENCE["bifurcation"])
def test_spheres_buckle_where_the_exact_reference_says(case: dict[str, Any]) -> None:
    found = onset(of(case))
    assert found.s_cr == pytest.approx(case["s_cr"], rel=1e-9)
    assert (found.degree, found.path, found.kappa_ratio) == (case["l_cr"], "radial", None)
    assert all(tie.s_cr > case["s_cr"] for tie in found.ties)
    softer = onset(of(case), kappa_ratio=1000.0)
    assert softer.s_cr == pytest.approx(case["s_cr_kappa_over_mu_1000"], rel=1e-7)
    assert softer.degree == case["l_cr_kappa_over_mu_1000"]


@pytest.mark.parametrize("case", REFERENCE["base_state"][:3])
def test_the_smooth_sphere_with_finite_bulk_modulus(case: dict[str, Any]) -> None:
    mesh = radial_mesh(case["A"], case["t"], case["gamma"])
    state = smooth(mesh, 1 - case["theta"], 1000.0)
    interface = state.radii[np.argmin(np.abs(mesh.position - 1))]
    assert (interface, state.radii[-1]) == pytest.approx((case["r_i_kappa1000"], case["r_o_kappa1000"]), rel=1e-9)
    rigid = smooth(mesh, 1 - case["theta"], None)
    expected = sphere_radius(mesh.position, case["theta"], case["A"])
    np.testing.assert_allclose(rigid.radii, expected, rtol=1e-6)


# what a bulk modulus changes shows on thicker skins, too, at half the time
@pytest.mark.parametrize(
    ("index", "kappa_ratio"),
    [
        pytest.param(2, None, marks=pytest.mark.slow),
        pytest.param(2, 1000.0, marks=pytest.mark.slow),
        (5, None),
        (5, 1000.0),
        (7, None),
        pytest.param(7, 1000.0, marks=pytest.mark.slow),
    ],
)
def test_the_meridional_road_agrees_with_the_reference(index: int, kappa_ratio: float | None) -> None:
    case = REFERENCE["bifurcation"][index]
    exact = case["s_cr"] if kappa_ratio is None else case["s_cr_kappa_over_mu_1000"]
    found = onset(of(case), road="meridional", kappa_ratio=kappa_ratio)
    assert found.s_cr == pytest.approx(exact, rel=3e-3)
    assert found.degree is not None
    assert abs(found.degree - case["l_cr"]) <= 1
    assert found.path == "meridional"


def test_the_meridional_road_converges() -> None:
    exact = onset(sphere()).s_cr
    assert exact is not None
    errors = []
    for split in (1, 2):
        space = Perturbations(Meridian(sphere(), 3.0, None, split))
        states = [space.meridian.at(factor * exact) for factor in (0.94, 0.98, 1.02)]
        errors.append(abs(Pencil.exact(space, states).critical(0)[0].s / exact - 1))
    assert np.log2(errors[0] / errors[1]) > 3.0
    assert errors[1] < 2e-3


@pytest.mark.parametrize(
    ("gamma", "error", "moduli"),
    [
        pytest.param(10.0, -0.0019, (None, 1000.0), marks=pytest.mark.slow),
        (10.0, -0.0019, (1000.0,)),
        (30.0, -0.0014, (None,)),
        pytest.param(30.0, -0.0014, (None, 1000.0), marks=pytest.mark.slow),
    ],
)
def test_the_full_road_is_as_near_whatever_the_bulk_modulus(
    gamma: float, error: float, moduli: tuple[float | None, ...]
) -> None:
    """The limit of two coarse meshes is off by `error`, measured; one-sided differences of tangents see the modulus."""
    errors = []
    for kappa_ratio in moduli:
        found = full.crossings(sphere(0.4, 0.12, gamma), kappa_ratio=kappa_ratio, quality="preview")[1]
        exact = onset(sphere(0.4, 0.12, gamma), kappa_ratio=kappa_ratio).s_cr
        assert exact is not None
        errors.append(found[0].shrinkage / exact - 1)
    assert errors == pytest.approx([error] * len(moduli), abs=1e-3)
    assert errors[0] == pytest.approx(errors[-1], abs=2e-4)


@pytest.mark.parametrize(
    ("te", "gamma"),
    [
        # a coarse mesh has degree 9 come first, and its first look at the other is so late that it is taken again
        (0.06, 10.0),
        (0.08, 50.0),
        *(
            pytest.param(te, gamma, marks=pytest.mark.slow)
            for te in (0.04, 0.05, 0.06, 0.07, 0.08, 0.1)
            for gamma in (10.0, 50.0)
            if (te, gamma) not in ((0.06, 10.0), (0.08, 50.0))
        ),
    ],
)
def test_the_full_road_finds_the_first_of_modes_that_come_almost_at_once(te: float, gamma: float) -> None:
    exact, found = (onset(sphere(0.4, te, gamma), road=road) for road in (None, "full"))  # type: ignore[arg-type]
    assert found.s_cr == pytest.approx(exact.s_cr, rel=2e-3)
    assert found.degree == exact.degree
    assert [tie.s_cr for tie in found.ties] == sorted(tie.s_cr for tie in found.ties)


def test_turns_about_a_held_centre_are_no_onset() -> None:
    """A fruit without a stone is held in its middle, and has hardly any stiffness against turning about it."""
    exact, found = onset(sphere(0.0, 0.2)), onset(sphere(0.0, 0.2), road="meridional")
    assert found.s_cr == pytest.approx(exact.s_cr, rel=1e-3)
    assert (found.degree, found.reason) == (exact.degree, "")
    # whose modes runs start from: it stays as it is, and says so
    assert "a turn of the whole" in onset(sphere(0.0, 0.2), road="meridional", quality="preview").reason


def test_thick_skins_about_elliptic_equators_buckle() -> None:
    """A pea's equator is nearly round; even waves alone, or a look from past the onset, had it stay smooth to .6."""
    pea = SOLVER.parse({"te": 0.1}, "pea")
    assert isinstance(pea, DehydrationParams)
    rounder = SOLVER.parse({"te": 0.1, "radii": (*pea.radii[:7], pea.radii[3])}, "pea")
    assert isinstance(rounder, DehydrationParams)
    found = full.crossings(pea, quality="preview")[1]
    assert found[0].shrinkage == pytest.approx(onset(rounder).s_cr, rel=0.01)


@pytest.mark.slow
def test_a_finer_mesh_that_is_past_the_onset_looks_from_before_it() -> None:
    """Of plum 2 under a skin of .06: on the power law through its onsets under skins of .05 and .08, to 3 %."""
    plum = SOLVER.parse({"te": 0.06}, "plum2")
    assert isinstance(plum, DehydrationParams)
    found = full.crossings(plum, quality="preview")[1]
    slope = math.log(0.1078 / 0.0850) / math.log(0.08 / 0.05)
    assert found[0].shrinkage == pytest.approx(0.0850 * (0.06 / 0.05) ** slope, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["jujube2", "raisin"])
def test_the_full_road_agrees_with_the_meridional_one_under_oblique_skins(preset: str) -> None:
    """Upright columns: along rays elements are slanted by up to 40 degrees."""
    params = SOLVER.parse({"te": 0.05}, preset)
    assert isinstance(params, DehydrationParams)
    truth = onset(params, kappa_ratio=1e5).s_cr
    found = full.crossings(params)[1]
    assert truth is not None
    assert found[0].shrinkage == pytest.approx(truth, rel=2e-3)


@pytest.mark.slow
def test_a_patch_of_plum_1() -> None:
    """What finer meshes make of it, to 74 elements an edge, is .0842; along rays it came out as .0850."""
    params = SOLVER.parse({}, "plum1")
    assert isinstance(params, DehydrationParams)
    model, found = full.crossings(params)
    assert model.mesh.foot is not None
    assert found[0].shrinkage == pytest.approx(0.0842, rel=3e-3)


@pytest.mark.slow
def test_bands_agree_with_the_meridional_road_where_waves_run_round_the_axis() -> None:
    """To what two meshes of 2.9 and 4.2 elements leave; that road's own seven onsets lie within 1.7e-3."""
    params = SOLVER.parse({}, "wolfberry")
    assert isinstance(params, DehydrationParams)
    truth = onset(params, kappa_ratio=1e5, quality="preview").s_cr
    model, found = full.crossings(params, quality="preview")
    assert model.mesh.band is not None
    assert truth is not None
    assert found[0].shrinkage == pytest.approx(truth, rel=3e-3)


@pytest.mark.slow
def test_bands_are_for_waves_round_the_axis_of_large_meshes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also for the modes that runs start from; fruits whose crests follow parallels have patches."""
    taken = list[str]()

    def seen(self: Any, *_: object) -> Any:
        taken.append(type(self).__name__)
        raise Cancelled("seen")

    monkeypatch.setattr(full.Rings, "run", seen)
    monkeypatch.setattr(full._Search, "run", seen)
    wolfberry, plum = SOLVER.parse({"r8": 0.38, "mirrors": "xz"}, "wolfberry"), SOLVER.parse({}, "plum1")
    assert isinstance(wolfberry, DehydrationParams)
    assert isinstance(plum, DehydrationParams)
    for params, find in ((wolfberry, onset), (wolfberry, mirrored_mode), (plum, onset)):
        with pytest.raises(Cancelled):
            find(params)
    assert taken == ["Rings", "Rings", "_Search"]


def test_both_roads_agree_on_the_linear_method_which_misses_the_exact_onset() -> None:
    radial, meridional = (
        onset(sphere(), method="linear", road=road, quality="preview")  # type: ignore[arg-type]
        for road in ("radial", "meridional")
    )
    assert radial.s_cr == pytest.approx(0.0976, abs=1e-4)
    assert meridional.s_cr == pytest.approx(radial.s_cr, rel=2e-3)
    thin = sphere(0.4, 0.002, 1000.0)
    assert onset(thin, method="linear").s_cr == pytest.approx(onset(thin).s_cr, rel=0.06)


@pytest.mark.parametrize("s", [0.07, 0.3, -0.2])
def test_the_smooth_shape_of_a_sphere_is_the_closed_form(s: float) -> None:
    rng = np.random.default_rng(1)
    rays = rng.normal(size=(500, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    rays[:2] = [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]
    fresh = np.linspace(0.4, 1.04, 500)
    moved = base_state(sphere(), s)(rays * fresh[:, None])
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), sphere_radius(fresh, 1 - s, 0.4), atol=1.2e-3)
    np.testing.assert_allclose(np.cross(moved, rays), 0, atol=1e-6)


def test_the_smooth_shape_converges_with_third_order() -> None:
    errors = []
    for split in (1, 2, 4):
        state = Meridian(sphere(), 2.0, None, split).at(0.06)
        mesh = state.meridian.mesh
        rays = np.full((400, 3), [0.6, 0.8, 0.0])
        fresh = np.linspace(0.4, 1.04, 400)
        moved = state(rays * fresh[:, None])
        errors.append(np.abs(np.linalg.norm(moved, axis=1) - sphere_radius(fresh, 0.94, 0.4)).max())
        assert mesh.position[:, 0].min() == 0.0
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert slopes.min() > 2.3
    assert slopes[-1] > 2.6


def test_points_of_the_stone_stay_and_other_fruits_keep_their_volume() -> None:
    params = SOLVER.parse({}, "raisin")
    assert isinstance(params, DehydrationParams)
    state = base_state(params, 0.05, quality="preview")
    inside = np.array([[0.1, 0.05, 0.0], [0.0, 0.0, 0.0], [0.0, -0.2, 0.1]])
    np.testing.assert_array_equal(state(inside), inside)
    mesh = state.meridian.mesh
    f = deformation(mesh, state.moved)
    volume = (mesh.weight * np.linalg.det(f)).sum()
    assert volume == pytest.approx((mesh.weight * mesh.shrunk(0.05)).sum(), rel=1e-6)
    # rotating fresh points about the axis rotates moved ones
    x = params.surface(np.full(5, 1.0), np.linspace(0, 6, 5))
    np.testing.assert_allclose(np.ptp(np.hypot(*state(x)[:, [0, 2]].T)), 0, atol=1e-12)


def test_a_fruit_that_is_not_a_sphere() -> None:
    params = SOLVER.parse({"te": 0.05}, "jujube2")
    assert isinstance(params, DehydrationParams)
    found = onset(params, quality="preview")
    finer = onset(params)
    assert found.path == "meridional"
    assert found.s_cr == pytest.approx(finer.s_cr, rel=2e-2)
    assert isinstance(finer.mode, AxisymmetricMode)
    assert finer.wavenumber == finer.mode.wavenumber
    assert np.abs(finer.mode.profile).max() == pytest.approx(1.0)


def test_the_tangent_is_the_derivative_of_the_forces() -> None:
    mesh = Meridian(sphere(te=0.1), 1.0, 100.0).mesh
    rng = np.random.default_rng(2)
    moved = mesh.position * [0.95, 1.02] + 1e-3 * rng.normal(size=mesh.position.shape) * (mesh.position[:, :1] > 0)
    p = rng.normal(size=mesh.weight.shape)
    step = rng.normal(size=mesh.position.shape) * (mesh.position[:, :1] > 0)
    small = 1e-6
    ahead, back = (forces(mesh, deformation(mesh, moved + h * step), p, 0.1)[0] for h in (small, -small))
    f = deformation(mesh, moved)
    k0, _, _ = tangents(mesh, moduli(mesh, f, p, 0.1))
    a, c = step[mesh.nodes][..., 0], step[mesh.nodes][..., 1]
    nodal = np.stack([a, a, np.sqrt(2) * c], axis=-1) / np.sqrt(2)  # P, Q, c of a motion without b
    out = np.einsum("eij,ej->ei", k0, nodal.reshape(-1, 27)).reshape(-1, 9, 3)
    rate = (ahead - back) / (2 * small)
    np.testing.assert_allclose((out[..., 0] + out[..., 1]) / np.sqrt(2), rate[..., 0], atol=1e-6 * np.abs(rate).max())
    np.testing.assert_allclose(out[..., 2], rate[..., 1], atol=1e-6 * np.abs(rate).max())


def test_rigid_motions_cost_nothing() -> None:
    mesh = Meridian(sphere(te=0.1), 1.0, 100.0).mesh
    f = deformation(mesh, mesh.position)
    terms = tangents(mesh, moduli(mesh, f, np.zeros(mesh.weight.shape), 0.0))
    b0, b1 = volume_rates(mesh, f)
    radius, height = np.moveaxis(mesh.position[mesh.nodes], -1, 0)
    zero, one = np.zeros_like(radius), np.ones_like(radius)
    # a, b, c of: a shift along y (m = 0); a shift along x, and a turn about z (m = 1); a strain in the xz plane (m = 2)
    motions = [(0, zero, zero, one), (1, one, -one, zero), (1, height, -height, -radius)]
    for m, a, b, c in motions:
        nodal = np.stack([(a + b) / np.sqrt(2), (a - b) / np.sqrt(2), c], axis=-1).reshape(-1, 27)
        tangent = terms[0] + m * terms[1] + m * m * terms[2]
        np.testing.assert_allclose(np.einsum("eij,ej->ei", tangent, nodal), 0, atol=1e-10)
        np.testing.assert_allclose(np.einsum("eaj,ej->ea", b0 + m * b1, nodal), 0, atol=1e-12)
    shear = np.stack([zero, np.sqrt(2) * radius, zero], axis=-1).reshape(-1, 27)
    tangent = terms[0] + 2 * terms[1] + 4 * terms[2]
    energy = np.einsum("ei,eij,ej->", shear, tangent, shear) / 2
    # u = (x, -z): H:H + tr(H H) = 4 pointwise; the form is twice the average over azimuth, the energy half the form
    assert energy == pytest.approx((mesh.weight * mesh.shear[:, None]).sum() * 4, rel=1e-10)


def test_thick_soft_skins_do_not_buckle() -> None:
    found = onset(sphere(0.8, 0.2, 1.0))
    assert found.s_cr is None
    assert found.mode is None
    assert "does not buckle up to s = 0.6" in found.reason
    assert json.loads(json.dumps(found.summary()))["s_cr"] is None


@pytest.mark.parametrize(
    ("te", "gamma"),
    [pytest.param(0.002, 1.0, marks=pytest.mark.slow), (0.002, 1000.0), (0.2, 1.0), (0.2, 1000.0)],
)
def test_corners_of_the_parameters(te: float, gamma: float) -> None:
    found = onset(sphere(0.3, te, gamma))
    assert found.s_cr is None or 0 < found.s_cr < 0.6


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"method": "guess"}, "unknown method"),
        ({"quality": "superb"}, "unknown quality"),
        ({"kappa_ratio": 1.0}, "5 to 1e6"),
        ({"road": "sideways"}, "no 'sideways' road"),
    ],
)
def test_what_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(InvalidInput, match=said):
        onset(sphere(), **changes)


def test_a_road_must_fit_the_shape() -> None:
    with pytest.raises(InvalidInput, match="no 'radial' road"):
        onset(DehydrationParams.parse({"r2": 0.9}), road="radial")
    with pytest.raises(InvalidInput, match="circular equator"):
        base_state(DehydrationParams.parse({"r8": 0.9}), 0.1)


def test_it_can_be_cancelled() -> None:
    for road in ("radial", "meridional"):
        with pytest.raises(Cancelled):
            onset(sphere(), road=road, context=Context(cancelled=lambda: True))  # type: ignore[arg-type]


@pytest.mark.parametrize(("degree", "wavenumber"), [(14, 0), (9, 3), (12, 12), (7, 2)])
def test_a_mode_can_be_read_anywhere(degree: int, wavenumber: int) -> None:
    grid = np.linspace(0, np.pi, 200)
    profile = sph_harm_y(degree, wavenumber, grid, 0.0).real
    mode = AxisymmetricMode(grid, profile / np.abs(profile).max(), wavenumber)
    assert dominant_degree(mode, 30) == degree
    colatitude, azimuth = np.array([0.3, 1.2, 2.9]), np.array([0.1, 4.0, -2.0])
    heights = mode(directions(colatitude, azimuth))
    np.testing.assert_allclose(heights, mode.on(colatitude, azimuth), atol=1e-12)
    exact = sph_harm_y(degree, wavenumber, colatitude, 0.0).real / np.abs(profile).max() * np.cos(wavenumber * azimuth)
    np.testing.assert_allclose(heights, exact, atol=2e-4)


def test_the_mode_of_a_sphere_is_a_spherical_harmonic() -> None:
    found: Onset = onset(sphere())
    assert found.mode is not None
    assert found.degree is not None
    at = np.linspace(0, np.pi, 50)
    expected = eval_legendre(found.degree, np.cos(at))
    np.testing.assert_allclose(found.mode.on(at, np.zeros(50)), expected, atol=1e-4)


def test_valleys() -> None:
    calls = []
    valley = Valley(lambda n: calls.append(n) or float((n - 37) ** 2), 0, 100)  # type: ignore[func-returns-value]
    assert valley.descend(60) == 37
    assert len(calls) == len(set(calls)) < 25


def test_banded_solves_agree_with_dense_ones() -> None:
    rng = np.random.default_rng(3)
    unknowns = np.array([[-1, 0, 1], [0, 1, 2], [1, 2, 3]])
    elements = rng.normal(size=(3, 3, 3))
    elements += elements.swapaxes(1, 2)
    stored = pattern(unknowns, 4)
    entries = stored.assemble(elements)
    dense = np.zeros((5, 5))
    for numbers, element in zip(unknowns, elements, strict=True):
        dense[np.ix_(numbers, numbers)] += element
    dense = dense[:4, :4]
    np.testing.assert_allclose(stored.matrix(entries).toarray(), dense)
    right = rng.normal(size=4)
    np.testing.assert_allclose(stored.solve(entries, right), np.linalg.solve(dense, right))
    assert stored.factor(-np.abs(entries)) is None


def test_the_solver_answers_it_as_well() -> None:
    import solver.dehydration

    found = solver.dehydration.onset(DehydrationParams.parse({"te": 0.04}), kappa_ratio=1000.0)
    assert found.s_cr == pytest.approx(0.08054538543842547, rel=1e-6)


def test_mirrors_are_said_to_be_left_aside() -> None:
    whole, part = (onset(DehydrationParams.parse({"te": 0.1, **more})) for more in ({}, {"mirrors": "xyz"}))
    assert part.s_cr == whole.s_cr
    assert "mirrors" not in whole.reason
    assert "the whole fruit's onset: with mirrors = xyz" in part.reason


def test_no_product_of_matrices_is_left_to_two_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    threads: list[int] = []

    def looked(params: DehydrationParams, **words: Any) -> Onset:
        threads.extend(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")
        raise Cancelled("seen")

    monkeypatch.setattr(full, "onset_full", looked)
    with threadpool_limits(2, user_api="blas"):
        had = [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]
        with pytest.raises(Cancelled):
            onset(sphere(), road="full")
    assert set(had) == {2}
    assert set(threads) == {1}
