"""Every variable that may appear in a result: its units, its name in words and its symbol. Written here only.

Lengths are in units of the fruit's reference radius r1 = 1 (multiply by the real radius to get metres); stresses in
units of the sarcocarp's shear modulus. Units follow UDUNITS, so that CF readers understand them.
"""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["QUANTITIES", "Quantity", "attrs", "register"]


class Quantity(NamedTuple):
    """Units, long name and symbol of one variable; `volatile` ones differ between identical runs (wall time)."""

    units: str
    long_name: str
    symbol: str
    volatile: bool = False


QUANTITIES: dict[str, Quantity] = {}


def register(**entries: Quantity) -> None:
    """Add variables; a name has one meaning in the whole project.

    Raises:
        ValueError: the name is taken with another meaning.

    """
    for name, quantity in entries.items():
        if QUANTITIES.setdefault(name, quantity) != quantity:
            raise ValueError(f"{name} is already registered as {QUANTITIES[name]}")


def attrs(name: str) -> dict[str, str]:
    """Return the netCDF attributes of a variable.

    Raises:
        KeyError: the variable was never registered, so nobody said what it means.

    """
    quantity = QUANTITIES[name]
    return {"units": quantity.units, "long_name": quantity.long_name, "symbol": quantity.symbol}


# axes and convergence data that every solver shares
register(
    stage=Quantity("1", "position on the solver's stage axis", "s"),
    colatitude=Quantity("radian", "colatitude of the spline parameter, from the pole y > 0", "theta"),
    azimuth=Quantity("radian", "azimuth about the y axis, from x towards z", "phi"),
    component=Quantity("1", "Cartesian component", "i"),
    converged=Quantity("1", "the stage reached its residual", "-"),
    residual=Quantity("1", "out-of-balance force over internal force, Euclidean norms", "|r|/|f|"),
    drift=Quantity("1", "rms motion of the surface in its last 200 steps, in exocarp thicknesses", "d"),
    iterations=Quantity("1", "steps or iterations spent up to and including this stage", "n"),
    seconds=Quantity("s", "wall time spent up to and including this stage", "t", volatile=True),
)

# surface of a fruit
register(
    position=Quantity("1", "position of the outer surface, in units of r1", "x"),
    displacement=Quantity("1", "displacement of the outer surface from the fresh shape, in units of r1", "u"),
    mean_radius=Quantity("1", "area-weighted mean distance of the surface from the centre, in units of r1", "r_mean"),
    roughness=Quantity("1", "rms of the radial wrinkle amplitude (degrees l >= 3), in units of r1", "A_rms"),
    dominant_degree=Quantity("1", "power-weighted mean spherical-harmonic degree of the wrinkles (l >= 3)", "l"),
    wavelength=Quantity("1", "wavelength of the dominant degree on the shrunk surface, in units of r1", "lambda"),
    buckle_count=Quantity("1", "number of separate inward buckles", "N"),
    ridge_anisotropy=Quantity(
        "1", "anisotropy of the wrinkle slope: +1 ridges along meridians, 0 reticular, -1 rings", "a"
    ),
    penetration=Quantity("1", "deepest self-penetration of the surface, in units of r1", "g"),
    least_jacobian=Quantity("1", "least elastic volume ratio J/Jd of all integration points; inverted below 0", "J"),
    strain_energy=Quantity("1", "strain energy of the settled fruit, in units of mu r1^3, mu of the sarcocarp", "E"),
    released_energy=Quantity("1", "strain energy that settling released, in units of mu r1^3", "dE"),
    volume=Quantity("1", "volume enclosed by the outer surface, in units of r1^3", "V"),
)
