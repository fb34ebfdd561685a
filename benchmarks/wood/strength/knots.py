"""What a knot takes of a stick's strength: python -m benchmarks.wood.strength.knots [--seeds ...].

The bending test of `benchmarks.wood.bench` on spruce with one knot in mid span, from a pith above the stick to the face
in tension, so that it is widest there; the modulus of rupture over that of the clear stick with the same seed. Beside
it, for knots k wide in the narrow face b of a joist:

- ASTM D245, strength ratio 1 - (k - 1/24) / (b + 3/8), in inches, from .45 on, and without the 3/8 below (as Bather,
  "Technical note on the determination of strength reduction factors using ASTM D245", 2021, gives it), which is meant
  for lumber twice as wide and more, and here has the stick's own b;
- what is left of the section's modulus below the neutral axis, 1 - k / b, as if the knot were a hole of even width.

Fibres that pass round a knot are in neither. Of Sitka spruce's joists it is known that D245 does not estimate them
well ("Strength ratios of knots in bending for two Alaskan softwood species", its abstract).
"""

from __future__ import annotations

import argparse
import time
from typing import Any

from benchmarks.figures import Sheet

from ..bench import SPECIES, bending, bent

__all__ = ["ratio"]

_HEAD = ("knot over the face's width", "seed", "rupture over the clear stick's", "ASTM D245", "1 - k / b",
         "modulus over the clear stick's", "rods broken", "bonds broken", "CPU s")  # fmt: skip
_SIDE, _LONG, _INCH, _ABOVE = 0.025, 0.40, 0.0254, 0.02


def ratio(knot: float, face: float) -> float:
    """Return the strength ratio by ASTM D245 of a knot [m] wide in the narrow face [m]."""
    k, b = knot / _INCH, face / _INCH
    found = 1 - (k - 1 / 24) / (b + 3 / 8)
    return float(found if found >= 0.45 else 1 - (k - 1 / 24) / b)


def main(widths: list[float], seeds: list[int], rods: int, vertices: int) -> None:
    """Print a row for every knot and seed, the clear stick first."""
    sheet = Sheet("wood-knots", _HEAD, "wood")
    wood: dict[str, Any] = dict(SPECIES["spruce"])
    for seed in seeds:
        clear = (0.0, 0.0)
        for share in (0.0, *widths):
            begun, half = time.process_time(), _SIDE / 2
            knot = {"at": (_LONG / 2, 0.0, -half), "radius": share * half}
            grain = {"pith": (0.0, _ABOVE), "knots": [knot] if share else []}
            run = bending({**wood, "grain": grain}, seed, rods, vertices)
            cpu = time.process_time() - begun
            stiff, rupture = bent(run["way"], run["force"])
            clear = clear if share else (stiff, rupture)
            got, resists = rupture / clear[1], stiff / clear[0]
            said = (ratio(share * _SIDE, _SIDE), 1 - share) if share else (1.0, 1.0)
            sheet.add(
                (f"{share:g}", seed, f"{got:.3f}", f"{said[0]:.3f}", f"{said[1]:.3f}", f"{resists:.3f}", run["rods"],
                 run["bonds"], f"{cpu:.0f}"),
                share=share, seed=seed, rupture=rupture, modulus=stiff, rupture_over=got, modulus_over=resists,
                standard=said[0], hole=said[1], broken_rods=run["rods"], broken_bonds=run["bonds"], rods=rods,
                vertices=vertices, note=run["note"], cpu_s=cpu,
                way=[float(f"{v:.4g}") for v in run["way"]], force=[float(f"{v:.4g}") for v in run["force"]],
            )  # fmt: skip
            sheet.keep()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--widths", nargs="+", type=float, default=[0.25, 0.5])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1])
    parser.add_argument("--rods", type=int, default=36)
    parser.add_argument("--vertices", type=int, default=61)
    asked = parser.parse_args()
    main(asked.widths, asked.seeds, asked.rods, asked.vertices)
