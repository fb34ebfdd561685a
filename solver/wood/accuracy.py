"""How far a bundle's stiffness and first frequency are expected to be off, as measured against Timoshenko's beam.

What is left at 20 rods is the section: few rods stand for shear and for their own bending less well than many. So the
error goes with the number of rods and not with the vertices, of which no quality has too few:

    error = LARGEST (FEWEST / rods)^POWER

bounds all runs in `benchmarks/results/wood-bundles.json`, a test. It is one of elastic forces at small
loads: where something breaks, a branch is chaotic, and nothing is said.
"""

from __future__ import annotations

from ..contract import InvalidInput, Quality
from .params import WoodParams

__all__ = ["FEWEST", "LARGEST", "POWER", "expected_error"]

#: The record's largest errors are .94, .62 and .44 % of 20, 50 and 200 rods; they were .83, .61 and .27 % in version 8,
#: whose pairs all bore the same shear and whose bundles were 4 to 13 % too soft in torsion.
LARGEST, FEWEST, POWER = 0.0095, 20, 0.33

#: Where it was measured: length over radius, rods, unevenness, vertices at quality default, and rods at fine.
_SLENDER, _MOST, _UNEVEN, _VERTICES, _FINE = (10.0, 100.0), 200, 0.3, 30, 50
#: Transverse and shear modulus over that along the rods.
_RATIOS = 0.05, 0.07


def _refusal(params: WoodParams) -> str:
    """Return what of a bundle was not measured; nothing if all was."""
    ratios = params.transverse / params.stiffness, params.shear / params.stiffness
    known = WoodParams()
    checks = (
        (params.fracture != "none" and params.mode != "static", "what breaks"),
        (bool(params.outline or params.bent or params.cuts), "outlines, curved axes, forks and cuts"),
        (params.taper != 1, "tapered bundles"),
        (params.clamp != "start" or bool(params.grips), "other holds than one clamped end"),
        (bool(params.bodies), "bodies"),
        (params.mass_scaling != 1 or params.mode == "auto", "scaled masses"),
        (params.twist, "rods that resist twist"),
        (params.grain.stiffness > 0 or params.grain.rings > 0 or params.grain.deviates, "uneven or deviating grain"),
        (params.reach != known.reach or max(abs(r / m - 1) for r, m in zip(ratios, _RATIOS, strict=True)) > 1e-9,
         "other ratios of moduli and reach than the default's"),
        (not _SLENDER[0] <= params.length / params.radius <= _SLENDER[1],
         f"bundles that are not {_SLENDER[0]:g} to {_SLENDER[1]:g} radii long"),
        (not FEWEST <= params.rods <= _MOST, f"fewer than {FEWEST} or more than {_MOST} rods"),
        (params.unevenness > _UNEVEN or params.vertices < _VERTICES,
         f"an unevenness above {_UNEVEN:g}, or fewer than {_VERTICES} vertices"),
    )  # fmt: skip
    return next((what for fails, what in checks if fails), "")


def expected_error(params: WoodParams, quality: Quality, last: float) -> float:
    """Return the expected relative error of a bundle's stiffness and first frequency, at any stage.

    Raises:
        InvalidInput: none was measured for such a bundle, or at that quality; says what was not.

    """
    del last
    advice = f"Name a quality in place of the tolerance: {quality}, say."
    refused = _refusal(params)
    if refused:
        raise InvalidInput(f"no error was measured for {refused}.", advice=advice)
    if quality == "fine" and params.rods > _FINE:
        raise InvalidInput(
            f"no error was measured at fine for more than {_FINE} rods, and {of_rods(params.rods):.2g} at default.",
            advice=advice,
        )
    return of_rods(params.rods)


def of_rods(rods: int) -> float:
    """Return the expected error with so many rods."""
    return float(LARGEST * (FEWEST / rods) ** POWER)
