"""An isotropic sheet in plane stress, in units of its own membrane shear modulus."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["Material"]


class Material(NamedTuple):
    """Thickness t [l] and Poisson's ratio; the membrane's shear modulus mu = Y t / (2 (1 + nu)) is the unit."""

    thickness: float
    poisson: float = 0.3

    @property
    def lame(self) -> float:
        """Lame's first parameter in plane stress over mu: 2 nu / (1 - nu)."""
        return 2 * self.poisson / (1 - self.poisson)

    @property
    def flexural(self) -> float:
        """Flexural rigidity Y t^3 / (12 (1 - nu^2)) over mu [l^2]: t^2 / (6 (1 - nu))."""
        return self.thickness**2 / (6 * (1 - self.poisson))
