"""The neo-Hookean law against differences and linear elasticity, and the four fused roads against the law."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from solver.decay.body import material as decay
from solver.dehydration.bifurcation import meridional_elements, radial_elements
from solver.dehydration.implicit.assembly import assemble, build_pattern
from solver.fem import HEX27
from solver.material import Law, at_pressure, isochoric, logarithmic

from ._kernel_twin import KINDS, algebra_forces

LAWS = [isochoric(1.3, 40.0), isochoric(0.7, 5.0, 0.8), at_pressure(1.1, -0.4, 0.9), logarithmic(0.9, 6.0)]


def gradients(count: int = 5, seed: int = 0) -> np.ndarray:
    """Deformation gradients (n, 3, 3), none near being crushed."""
    return np.eye(3) * 0.95 + 0.12 * np.random.default_rng(seed).normal(size=(count, 3, 3))


@pytest.mark.parametrize("law", LAWS)
def test_stress_and_tangent_are_the_derivatives_of_the_energy(law: Law) -> None:
    """Complex steps would be exact, but determinants of complex matrices are not: sixth-order differences instead."""
    rng, weights = np.random.default_rng(1), {1: 0.75, 2: -0.15, 3: 1 / 60}
    for f in gradients():
        way, h = rng.normal(size=(3, 3)), 3e-3
        slope = sum(w * (law.function(f + k * h * way) - law.function(f - k * h * way)) for k, w in weights.items()) / h
        assert np.sum(law.gradient(f) * way) == pytest.approx(slope, rel=1e-9, abs=1e-9)
        bend = sum(w * (law.gradient(f + k * h * way) - law.gradient(f - k * h * way)) for k, w in weights.items()) / h
        assert np.einsum("ijkl,kl->ij", law.hessian(f), way) == pytest.approx(bend, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize(
    ("law", "mu", "bulk"), [(isochoric(1.3, 40.0), 1.3, 40.0), (logarithmic(0.9, 6.0), 0.9, 6.0 + 0.6)]
)
def test_fresh_it_is_linear_elasticity(law: Law, mu: float, bulk: float) -> None:
    fresh = np.eye(3)
    assert law.function(fresh) == pytest.approx(0, abs=1e-13)
    assert law.gradient(fresh) == pytest.approx(0, abs=1e-13)
    h = np.random.default_rng(2).normal(size=(3, 3))
    strain = (h + h.T) / 2
    stress = 2 * mu * strain + (bulk - 2 / 3 * mu) * np.trace(strain) * np.eye(3)
    assert np.einsum("ijkl,kl->ij", law.hessian(fresh), h) == pytest.approx(stress, rel=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_it_is_objective_and_isotropic(law: Law) -> None:
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    f = gradients()
    assert law.function(turn @ f) == pytest.approx(law.function(f), rel=1e-12)
    assert law.function(f @ turn) == pytest.approx(law.function(f), rel=1e-12)
    assert law.gradient(turn @ f) == pytest.approx(turn @ law.gradient(f), rel=1e-11, abs=1e-12)


def test_a_sphere_that_dries_freely_is_at_rest() -> None:
    theta = 0.9
    law = isochoric(2.0, 30.0, theta**3)
    assert law.function(theta * np.eye(3)) == pytest.approx(0, abs=1e-13)
    assert law.gradient(theta * np.eye(3)) == pytest.approx(0, abs=1e-13)


# ------------------------------------------------------------------------------------------ the four roads


@pytest.mark.parametrize("kind", KINDS)
def test_the_kernel_s_forces_are_the_law_s(kind: str) -> None:
    """An affine deformation of one parallelepiped: sum over its nodes of force (x) fresh position is V P."""
    theta, mu, kappa = 0.9, 1.7, 40.0
    corners = np.array([[a >> 2 & 1, a >> 1 & 1, a & 1] for a in range(8)]) - 0.5
    shape = np.eye(3) + 0.2 * np.random.default_rng(4).normal(size=(3, 3))
    fresh = corners @ shape.T
    for f in gradients():
        force = algebra_forces(kind, fresh[None], (fresh @ f.T)[None], mu, kappa, theta)[0]
        stress = force.T @ fresh / np.linalg.det(shape)
        exact = isochoric(mu, kappa, theta**3).gradient(f)
        assert np.abs(stress - exact).max() < 1e-12 * max(np.abs(exact).max(), kappa)


def test_the_implicit_element_is_the_law_s() -> None:
    """Energy, force and tangent of one element that deforms affinely, where its pressure is the same everywhere."""
    mu, kappa, d = 1.3, 50.0, 0.92
    rng = np.random.default_rng(5)
    shape = np.eye(3) + 0.2 * rng.normal(size=(3, 3))
    fresh, volume = HEX27.nodes @ shape.T, 8 * np.linalg.det(shape)
    nodes = np.arange(27)[None]
    pattern = build_pattern(nodes, np.zeros(27, bool))
    law = isochoric(mu, kappa, d**3)
    for f in gradients():
        pressure = np.zeros((1, 8))
        pressure[0, 0] = kappa * (np.linalg.det(f) / d**3 - 1)
        found = assemble(
            fresh, nodes, fresh @ f.T, np.full((1, 27, 3), d), np.array([mu]), np.array([kappa]), pressure, pattern
        )
        assert found.energy == pytest.approx(volume * law.function(f), rel=1e-12)
        stress = volume * law.gradient(f)
        assert np.abs(found.force.T @ fresh - stress).max() < 1e-12 * max(np.abs(stress).max(), volume * kappa)
        matrix = np.zeros((27, 27, 3, 3))
        matrix[np.repeat(np.arange(27), np.diff(pattern.indptr)), pattern.indices] = found.data
        by_affine = np.einsum("aj,abik,bl->ijkl", fresh, matrix, fresh)
        exact = volume * law.hessian(f)
        assert np.abs(by_affine - exact).max() < 1e-12 * np.abs(exact).max()


def test_the_meridional_moduli_are_the_law_s() -> None:
    """Without torsion F has no part between the half-plane and the azimuth."""
    s, mu, pressure = 0.1, 7.0, -0.3
    mesh = SimpleNamespace(shear=np.array([mu]), shrunk=lambda s: np.array([[(1 - s) ** 3]]), weight=np.array([[2.5]]))
    law = at_pressure(mu, pressure, (1 - s) ** 3)
    for f in gradients():
        flat = f.copy()
        flat[2, :2] = flat[:2, 2] = 0
        found = meridional_elements.moduli(mesh, flat[None, None], np.array([[pressure]]), s)[0, 0]
        exact = 2.5 * law.hessian(flat).reshape(9, 9)
        assert np.abs(found - exact).max() < 1e-12 * np.abs(exact).max()


def test_the_meridional_forces_are_the_law_s() -> None:
    s, mu, pressure = 0.1, 7.0, -0.3
    mesh = SimpleNamespace(
        shear=np.array([mu]), shrunk=lambda s: np.array([[(1 - s) ** 3]]), weight=np.array([[2.5]]),
        gradient=np.random.default_rng(6).normal(size=(1, 1, 3, 9)), pressure=np.ones((1, 3)),
    )  # fmt: skip
    for f in gradients():
        flat = f.copy()
        flat[2, :2] = flat[:2, 2] = 0
        force, gain = meridional_elements.forces(mesh, flat[None, None], np.array([[pressure]]), s)
        stress = 2.5 * at_pressure(mu, pressure, (1 - s) ** 3).gradient(flat)
        slope = mesh.gradient[0, 0]
        exact = np.stack([stress[0, :2] @ slope[:2] + stress[2, 2] * slope[2], stress[1, :2] @ slope[:2]], -1)
        assert np.abs(force[0] - exact).max() < 1e-12 * np.abs(exact).max()
        assert gain[0] == pytest.approx(2.5 * (np.linalg.det(flat) - (1 - s) ** 3), rel=1e-12)


@pytest.mark.parametrize("degree", [0, 1, 3, 8])
def test_the_radial_moduli_are_the_law_s_over_the_sphere(degree: int) -> None:
    """Gradients of a harmonic perturbation at colatitudes of Gauss' rule, weighed by the law's own tangent."""
    s, mu, pressure, lr, lt = 0.1, 7.0, -0.3, 1.1, 0.87
    mesh = SimpleNamespace(
        shear=np.array([[mu]]), shrunk=lambda s: np.array([[(1 - s) ** 3]]), weight=np.ones((1, 1)),
        strain=np.eye(4)[None, None], pressure=np.ones((1, 1)),
    )  # fmt: skip
    state = SimpleNamespace(s=s, lr=np.array([[lr]]), lt=np.array([[lt]]), p=np.array([[pressure]]))
    found = radial_elements._matrices(mesh, state, degree, 4)[0][0]
    tangent = at_pressure(mu, pressure, (1 - s) ** 3).hessian(np.diag([lr, lt, lt]))
    x, weight = np.polynomial.legendre.leggauss(degree + 6)
    p = np.polynomial.legendre.Legendre.basis(degree) * np.sqrt(2 * degree + 1)
    sine, wave = np.sqrt(1 - x * x), max(np.sqrt(degree * (degree + 1.0)), 1e-300)
    value, first, second = p(x), -sine * p.deriv()(x), sine**2 * p.deriv(2)(x) - x * p.deriv()(x)
    h = np.zeros((4, len(x), 3, 3))  # of U', U/R, V', V/R each 1
    h[0, :, 0, 0] = value
    h[1, :, 0, 1], h[1, :, 1, 1], h[1, :, 2, 2] = first, value, value
    if degree:
        h[2, :, 1, 0] = first / wave
        h[3, :, 0, 1], h[3, :, 1, 1], h[3, :, 2, 2] = -first / wave, second / wave, first * x / sine / wave
    exact = np.einsum("q,aqij,ijkl,bqkl->ab", weight / 2, h, tangent, h)
    kept = slice(None) if degree else slice(2)
    assert np.abs(found - exact)[kept, kept].max() < 1e-12 * np.abs(exact).max()


def test_the_tetrahedron_of_a_rotten_body_is_the_law_s() -> None:
    mu, lame = 0.9, 6.0
    fresh = np.random.default_rng(7).normal(size=(4, 3))
    fresh[[2, 3]] = fresh[[3, 2]] if np.linalg.det(fresh[1:] - fresh[0]) < 0 else fresh[[2, 3]]
    tets = np.arange(4)[None]
    inverse, volume = decay.inverse_edges(fresh, tets), np.array([np.linalg.det(fresh[1:] - fresh[0]) / 6])
    law, rest = logarithmic(mu, lame), (tets, inverse, volume, np.array([mu]), np.array([lame]))
    pattern = decay.blocks(tets, 4)
    for f in gradients():
        x = fresh @ f.T
        assert decay.energy(x, *rest) == pytest.approx(volume[0] * law.function(f), rel=1e-12, abs=1e-12 * volume[0])
        force, tangent = np.zeros((4, 3)), np.zeros((16, 3, 3))
        assert decay.forces(x, *rest, force, np.zeros(4)) == pytest.approx(np.linalg.det(f), rel=1e-12)
        stress = volume[0] * law.gradient(f)
        assert np.abs(force.T @ fresh - stress).max() < 1e-12 * max(np.abs(stress).max(), volume[0] * lame)
        decay.hessian(x, *rest, pattern.slot, tangent, False)
        found = np.einsum("aj,abik,bl->ijkl", fresh, tangent[pattern.slot[0]], fresh)
        exact = volume[0] * law.hessian(f)
        assert np.abs(found - exact).max() < 1e-12 * np.abs(exact).max()
