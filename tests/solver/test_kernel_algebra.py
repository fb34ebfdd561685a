"""The kernel's algebra in float64 against a textbook twin."""

from __future__ import annotations

import numpy as np
import pytest

from solver.dehydration.kernel.diagnostics import NumpyArithmetic
from solver.dehydration.kernel.elements import isochoric_factor

from ._kernel_twin import (
    KINDS,
    NODE,
    algebra_forces,
    block_mesh,
    close,
    random_hex,
    twin_energy,
    twin_force,
    twin_gradient,
)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("squeeze", [1.0, 0.45, 0.2, -0.3])
def test_algebra_is_the_gradient_of_the_textbook_energy(kind, squeeze):
    """Also in crushed (barrier), crushed beyond a quarter (tangent) and inverted elements."""
    rng = np.random.default_rng(1)
    theta = 0.85
    fresh = np.array([random_hex(rng) for _ in range(4)])
    position = (fresh + 0.03 * rng.normal(size=fresh.shape)) * [1.0, 1.0, squeeze] * theta
    with np.errstate(all="raise"):
        forces = algebra_forces(kind, fresh, position, 1.7, 40.0, theta)
    for x0, x, force in zip(fresh, position, forces, strict=True):
        close(force, twin_gradient(x0, x, kind, 1.7, 40.0, theta), 1e-11)
        if kind != "one_point" and squeeze == 1.0:
            close(force, twin_force(x0, x, kind, 1.7, 40.0, theta), 1e-11)


@pytest.mark.parametrize("kind", KINDS)
def test_rotation_rotates_forces_and_translation_does_nothing(kind):
    rng = np.random.default_rng(2)
    fresh = np.array([random_hex(rng) for _ in range(3)])
    position = fresh + 0.05 * rng.normal(size=fresh.shape)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    still = algebra_forces(kind, fresh, position, 1.0, 30.0, 0.9)
    moved = algebra_forces(kind, fresh, position @ turn.T + [0.3, -2.0, 1.0], 1.0, 30.0, 0.9)
    close(moved, still @ turn.T, 1e-11)
    close(still.sum(axis=1) + 1, np.ones(3), 1e-11)
    at_rest = algebra_forces(kind, fresh, fresh @ turn.T, 1.0, 30.0, 1.0)
    assert np.max(np.abs(at_rest)) < 1e-12


@pytest.mark.parametrize("kind", ["core", "one_point"])
def test_patch_of_core_elements_carries_affine_deformation_exactly(kind):
    rng = np.random.default_rng(3)
    mesh = block_mesh(rng, (2, 3), core=3, exocarp=0, distort=0.2)
    fresh = mesh["positions"][mesh["connectivity"]]
    affine = np.eye(3) + 0.2 * rng.normal(size=(3, 3))
    forces = algebra_forces(kind, fresh, fresh @ affine.T, 1.0, 30.0, 0.9)
    nodal = np.zeros_like(mesh["positions"])
    np.add.at(nodal, mesh["connectivity"], forces)
    counts = np.bincount(mesh["connectivity"].ravel())
    assert np.max(np.abs(nodal[counts == 8])) < 1e-12 * np.max(np.abs(forces))


def test_patch_of_exocarp_parallelepipeds_carries_affine_deformation_exactly():
    """The reduced rule integrates the gradients of the shape functions exactly only where the Jacobian is constant."""
    rng = np.random.default_rng(4)
    mesh = block_mesh(rng, (2, 2), core=2, exocarp=0, distort=0.0)
    slanted = mesh["positions"] @ (np.eye(3) + 0.3 * rng.normal(size=(3, 3)))
    fresh = slanted[mesh["connectivity"]]
    forces = algebra_forces("exocarp", fresh, fresh @ (np.eye(3) + 0.2 * rng.normal(size=(3, 3))), 1.0, 30.0, 0.9)
    nodal = np.zeros_like(slanted)
    np.add.at(nodal, mesh["connectivity"], forces)
    assert np.max(np.abs(nodal[13])) < 1e-12 * np.max(np.abs(forces))


def test_a_skin_of_two_layers_bends_with_its_full_stiffness():
    """Plane sections of a strip turn against each other, as in a wrinkle, and its faces move freely in thickness.

    The energy of an area is then D kappa^2 / 2 with D = E h^3 / (12 (1 - nu^2)) = mu h^3 / 3 where the volume is kept.
    The strip is short, so that the shear of straight-edged elements in the tenth that is fully integrated is nothing.
    """
    h, length, curvature, mu = 1.0, 0.01, 1e-3, 1.3
    levels = np.linspace(-h / 2, h / 2, 3)

    def strain_energy(swelling):
        total = 0.0
        for low, high in ((0, 1), (1, 2)):
            fresh, moved = np.empty((8, 3)), np.empty((8, 3))
            for a, (sx, sy, sz) in enumerate(NODE):
                level = high if sz > 0 else low
                fresh[a] = sx * length / 2, sy / 2, levels[level]
                angle = sx * curvature * length / 2
                moved[a] = fresh[a] + [angle * levels[level], 0.0, swelling[level]]
            total += twin_energy(fresh, moved, "exocarp", mu, 1e5, 1.0)
        return total

    # quadratic in how far the two faces move, to leading order: Newton's step from rest, by differences
    step = np.eye(3)[[0, 2]] * 1e-4
    at_rest = strain_energy(np.zeros(3))
    slope = np.array([(strain_energy(e) - strain_energy(-e)) / 2 for e in step])
    hessian = np.array(
        [[strain_energy(d + e) - strain_energy(d) - strain_energy(e) + at_rest for d in step] for e in step]
    )
    least = strain_energy(-np.linalg.solve(hessian, slope) @ step)
    assert least / length == pytest.approx(mu * h**3 / 3 * curvature**2 / 2, rel=2e-3)


class Rough(NumpyArithmetic):
    """Cube roots as far off as a back end's may be."""

    def inverse_cube_root(self, a):
        return super().inverse_cube_root(a) * (1 + 4e-5)


@pytest.mark.parametrize("ratio", [0.3, 0.7, 1.0, 1.4])
def test_a_rough_cube_root_is_put_right(ratio):
    """To first order in its error of 4e-5: what is left is less than single precision rounds by."""
    rough = isochoric_factor(Rough(), np.array(ratio))
    assert rough.value == pytest.approx(ratio ** (-2 / 3), rel=6e-8)
    assert rough.slope == pytest.approx(ratio ** (-5 / 3), rel=6e-8)
