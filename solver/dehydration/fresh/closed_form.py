"""The spherical fruit before it buckles, in closed form (incompressible core and skin, rigid stone).

Core: r^3 = A^3 + theta^3 (R^3 - A^3); skin: r^3 = r_i^3 + R^3 - R_i^3, with stone radius A and interface R_i. Without a
stone A = 0 and the core is r = theta R; swelling is theta > 1.
Derived from Liu et al. 2014, Eq. 1-4, with F_d = theta I in the core; verified against the exact reference values.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Floats

__all__ = ["flat_film_strain", "flat_film_wavelength", "onset_estimate", "sphere_radius"]


def sphere_radius(fresh: Floats, theta: float, stone: float, interface: float = 1.0) -> Floats:
    """Return the deformed distance from the centre of points at `fresh` distance, any shape, in units of r1."""
    moved_interface3 = stone**3 + theta**3 * (interface**3 - stone**3)
    core = stone**3 + theta**3 * (fresh**3 - stone**3)
    skin = moved_interface3 + fresh**3 - interface**3
    return np.cbrt(np.where(fresh <= interface * (1 + 1e-12), core, skin))


def flat_film_wavelength(thickness: float, gamma: float) -> float:
    """Return the wrinkle wavelength of a flat stiff film on a soft half-space, 2 pi t (gamma / 3)^(1/3)."""
    return float(2 * np.pi * thickness * np.cbrt(gamma / 3))


def flat_film_strain(gamma: float) -> float:
    """Return the equi-biaxial strain at which a flat film wrinkles, (1/6) (3 / gamma)^(2/3) (incompressible).

    Valid for gamma >> 1; at gamma = 10 it is 0.075 where the exact sphere onset needs 0.075 to 0.08.
    """
    return float((3 / gamma) ** (2 / 3) / 6)


def onset_estimate(gamma: float, stone: float) -> float:
    """Return the shrinkage at which wrinkles are expected, from the flat-film strain.

    The skin strain of a sphere is about s (1 - A^3); the exact onset lies within 15 % of this (see the tests).
    """
    return flat_film_strain(gamma) / (1 - min(stone, 0.95) ** 3)
