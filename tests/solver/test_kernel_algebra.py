"""The kernel's algebra in float64 against a textbook twin."""

from __future__ import annotations

import numpy as np
import pytest

from ._kernel_twin import KINDS, algebra_forces, block_mesh, close, random_hex, twin_force, twin_gradient


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
