"""What an onset is: the shrinkage at which a fruit starts to buckle, and the shape of its first buckles."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import sph_harm_y

from ...arrays import Floats
from ...fruit import directions as on_unit_sphere

__all__ = ["AxisymmetricMode", "FieldMode", "Method", "Onset", "Road", "SurfaceMode", "Tie", "dominant_degree"]

Method = Literal["exact", "linear"]
Road = Literal["radial", "meridional", "full"]


class SurfaceMode(ABC):
    """Height of the first buckles over the fruit's surface, along its outward normal; its largest magnitude is 1.

    It lives on the parametric unit sphere of `solver.fruit`, like every surface field.
    """

    @abstractmethod
    def __call__(self, directions: Floats) -> Floats:
        """Return heights (n,) at unit `directions` (n, 3) of the parametric sphere."""

    def on(self, colatitude: Floats, azimuth: Floats) -> Floats:
        """Return heights at colatitude and azimuth [radian], of their common (broadcast) shape."""
        points = on_unit_sphere(colatitude, azimuth)
        return self(points.reshape(-1, 3)).reshape(points.shape[:-1])


@dataclass(frozen=True, eq=False)
class AxisymmetricMode(SurfaceMode):
    """A profile over colatitude times cos(wavenumber * azimuth).

    colatitude: (n,) increasing from 0 to pi [radian]. profile: (n,) heights on it, largest magnitude 1.
    """

    colatitude: Floats
    profile: Floats
    wavenumber: int

    def __post_init__(self) -> None:
        # a smooth field has a profile that is even across the pole for an even wavenumber, odd for an odd one
        order = 2 if self.wavenumber % 2 else 1
        ends: Any = ((order, 0.0), (order, 0.0))
        object.__setattr__(self, "_spline", CubicSpline(self.colatitude, self.profile, bc_type=ends))

    def __call__(self, directions: Floats) -> Floats:
        """Return heights (n,) at unit `directions` (n, 3) of the parametric sphere."""
        colatitude = np.arctan2(np.hypot(directions[:, 0], directions[:, 2]), directions[:, 1])
        return self.on(colatitude, np.arctan2(directions[:, 2], directions[:, 0]))

    def on(self, colatitude: Floats, azimuth: Floats) -> Floats:
        """Return heights at colatitude and azimuth [radian], of their common (broadcast) shape."""
        spline: Callable[[Floats], Floats] = self._spline  # type: ignore[attr-defined]
        return spline(np.asarray(colatitude)) * np.cos(self.wavenumber * np.asarray(azimuth))


@dataclass(frozen=True, eq=False)
class FieldMode(SurfaceMode):
    """Any field over the parametric sphere: `heights` maps unit directions (n, 3) to (n,)."""

    heights: Callable[[Floats], Floats]

    def __call__(self, directions: Floats) -> Floats:
        """Return heights (n,) at unit `directions` (n, 3) of the parametric sphere."""
        return self.heights(directions)


@dataclass(frozen=True)
class Tie:
    """A mode that competes with the first one: where it would start, its degree and its azimuthal wavenumber."""

    s_cr: float
    degree: int
    wavenumber: int


@dataclass(frozen=True, eq=False)
class Onset:
    """The start of buckling.

    s_cr: shrinkage s = 1 - theta at which the smooth shape stops being stable; None if it stays stable up to
    `searched`, and then `reason` says so and there is no mode. degree: dominant spherical-harmonic degree of the mode
    on the parametric sphere. wavenumber: azimuthal, about the pole axis y (a sphere's modes of one degree are tied
    over all wavenumbers; the one given is 0). path: concentric spheres ("radial"), axisymmetric fruits ("meridional")
    or any fruit ("full"). method: "exact" is the first singular tangent on the shrunk shape, "linear" the paper's
    eigenproblem at the fresh shape. kappa_ratio: bulk over shear modulus, None for incompressible. ties: the nearest
    competing modes, by s_cr. settings: numbers that describe the discretisation.
    """

    s_cr: float | None
    degree: int | None
    wavenumber: int | None
    path: Road
    method: Method
    kappa_ratio: float | None
    mode: SurfaceMode | None
    ties: tuple[Tie, ...] = ()
    seconds: float = 0.0
    searched: float = 0.6
    settings: Mapping[str, Any] = field(default_factory=dict)
    reason: str = ""

    def summary(self) -> dict[str, Any]:
        """Return everything but the mode as plain values, ready for JSON."""
        return {
            "s_cr": self.s_cr,
            "degree": self.degree,
            "wavenumber": self.wavenumber,
            "path": self.path,
            "method": self.method,
            "kappa_ratio": self.kappa_ratio,
            "ties": [{"s_cr": t.s_cr, "degree": t.degree, "wavenumber": t.wavenumber} for t in self.ties],
            "seconds": round(self.seconds, 4),
            "searched": self.searched,
            "settings": dict(self.settings),
            "reason": self.reason,
        }


def dominant_degree(mode: AxisymmetricMode, highest: int) -> int:
    """Return the spherical-harmonic degree (at most `highest`) that carries most of the mode's mean square."""
    nodes, weights = np.polynomial.legendre.leggauss(highest + 32)
    colatitude = np.arccos(nodes)
    degrees = np.arange(mode.wavenumber, max(highest, mode.wavenumber) + 1)
    waves = sph_harm_y(degrees[:, None], mode.wavenumber, colatitude[None, :], 0.0).real
    return int(degrees[np.argmax(np.abs(waves @ (weights * mode.on(colatitude, np.zeros_like(colatitude)))))])
