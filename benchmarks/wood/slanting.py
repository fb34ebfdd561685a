"""Rupture of sticks whose grain slopes: python -m benchmarks.wood.slanting [--seeds ...].

The bending test of `benchmarks.wood.bench` on spruce, sawn out of wood of one slope in the plane of bending. Rupture
and apparent modulus over those of straight grain with the same seed and vertices, beside Hankinson's formula (1921)
with the exponent 2, N = P Q / (P sin^2 + Q cos^2): for rupture of the published strengths along (rupture) and across
(tension), for the modulus of the moduli. Bonds of edges longer than 5 mm are weaker than the wood (`resolved`), which
sloping grain feels.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np

from benchmarks.figures import Sheet

from .bench import PUBLISHED, SPECIES, bending, bent

_HEAD = ("slope", "vertices", "seed", "rupture over straight grain's", "Hankinson", "modulus over straight grain's",
         "Hankinson ", "rods broken", "bonds broken", "CPU s")  # fmt: skip
_SLOPES = (0.0, 1 / 20, 1 / 10, 1 / 5)


def hankinson(along: float, across: float, slope: float) -> float:
    """Return the share (0 to 1) of what wood bears or resists along its grain that is left at a slope [1]."""
    s = np.sin(np.arctan(slope)) ** 2
    return float(across / (along * s + across * (1 - s)))


def main(species: str, seeds: list[int], slopes: list[float], vertices: int) -> None:
    """Print a row for every slope and seed."""
    sheet = Sheet("wood-slanting", _HEAD, "wood")
    wood: dict[str, Any] = dict(SPECIES[species])
    for seed in seeds:
        straight: tuple[float, float] = (0.0, 0.0)
        for slope in slopes:
            begun = time.process_time()
            grain = {"spiral": slope, "pith": (1.0, 0.0)}
            run = bending({**wood, "grain": grain}, seed, vertices=vertices)
            cpu = time.process_time() - begun
            stiff, rupture = bent(run["way"], run["force"])
            straight = (stiff, rupture) if slope == 0 else straight
            bears = hankinson(PUBLISHED[species][1], wood["cleavage"], slope)
            resists = hankinson(wood["stiffness"], wood["transverse"], slope)
            ratios = rupture / straight[1], stiff / straight[0]
            sheet.add(
                (f"1 in {1 / slope:.0f}" if slope else "none", vertices, seed, f"{ratios[0]:.3f}", f"{bears:.3f}",
                 f"{ratios[1]:.3f}", f"{resists:.3f}", run["rods"], run["bonds"], f"{cpu:.0f}"),
                species=species, slope=slope, vertices=vertices, seed=seed, rupture=rupture, modulus=stiff,
                rupture_over=ratios[0], modulus_over=ratios[1], hankinson_rupture=bears, hankinson_modulus=resists,
                rods=run["rods"], bonds=run["bonds"], note=run["note"], cpu_s=cpu,
            )  # fmt: skip
            sheet.keep()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--species", default="spruce", choices=list(SPECIES))
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2])
    parser.add_argument("--slopes", nargs="+", type=float, default=list(_SLOPES), help="straight grain, 0, first")
    parser.add_argument(
        "--vertices", type=int, default=81, help="on a rod; with fewer bonds are weaker, see `resolved`"
    )
    asked = parser.parse_args()
    main(asked.species, asked.seeds, asked.slopes, asked.vertices)
