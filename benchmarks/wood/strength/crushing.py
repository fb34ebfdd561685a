"""Spruce and beech that crush: python -m benchmarks.wood.strength.crushing [--seeds ...] [--rods N].

The bench's sticks (`benchmarks.wood.bench`) with a compressive strength along the grain: short blocks of 25 mm by
100 mm are pressed between jaws, and sticks bent in three points. Wood Handbook (FPL-GTR-190), Table 5-3a, maximum
crushing strength: 38.7 MPa (Sitka spruce) and 50.3 MPa (beech) at 12 %; 18.4 and 24.5 MPa green, which were not read
again. Scatter 18 % (Table 5-6).

A section that bears c in compression and t in tension, and breaks there, ruptures at c (3 t - c) / (t + c) by the beam
formula (Bazan 1980, Buchanan 1990). Rods break at the t that makes this the published rupture, by the law of size: so
the row of rupture checks section, grain and cracks, and the one beside says what a stick of such t would bear if it did
not crush. How far it goes until its force is highest, over what it would go elastically, is a prediction.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np

from benchmarks.figures import Sheet
from solver.contract import Need
from solver.wood import SOLVER

from ..bench import PUBLISHED, SPECIES, bending, bent, size_share

__all__ = ["CRUSHES", "pressed", "tension", "wood_that_crushes"]

#: Maximum crushing strength along the grain [Pa].
CRUSHES = {"spruce": 38.7e6, "beech": 50.3e6, "green spruce": 18.4e6, "green beech": 24.5e6}
_SCATTER = {"crushing": 0.18, "rupture": 0.16, "rupture without crushing": 0.16}
_HEAD = ("species", "test", "seed", "quantity", "measured", "published", "scatter", "in it", "rods broken",
         "bonds broken", "CPU s")  # fmt: skip
_SIDE, _TALL = 0.025, 0.1


def tension(rupture: float, crushes: float) -> float:
    """Return the tensile stress [Pa] at which a crushing section of this modulus of rupture breaks."""
    return crushes * (rupture + crushes) / (3 * crushes - rupture)


def wood_that_crushes(species: str) -> dict[str, Any]:
    """Return a species' parameters with its compressive strength."""
    wood, crushes = dict(SPECIES[species]), CRUSHES[species]
    limit = tension(PUBLISHED[species][1], crushes) / wood["stiffness"] / size_share()
    return {**wood, "compressive_strength": crushes, "strain_limit": limit}


def pressed(wood: dict[str, Any], seed: int, rods: int = 20, vertices: int = 21) -> dict[str, Any]:
    """Return way [m] and force [N] of a block pressed between jaws, and what broke."""
    last, half = 0.1, _SIDE / 2
    way = 2.0 * wood["compressive_strength"] / wood["stiffness"] * _TALL
    grips = [
        {"low": (-1, -1, -1), "high": (1e-4, 1, 1)},
        {"low": (_TALL - 1e-4, -1, -1), "high": (1, 1, 1),
         "path": [{"time": 0.0}, {"time": last, "shift": (-way, 0, 0)}]},
    ]  # fmt: skip
    values = {
        **wood, "length": _TALL, "rods": rods, "vertices": vertices, "seed": seed, "clamp": "none", "grips": grips,
        "outline": [(-half, -half), (half, -half), (half, half), (-half, half)], "damping": 500.0, "mass_scaling": 100,
    }  # fmt: skip
    fields = ("grip_force", "grip_shift", "broken_rods", "broken_bonds")
    found = SOLVER.solve(SOLVER.parse(values), Need(stages=tuple(np.linspace(last / 40, last, 40)), fields=fields))
    return {
        "way": -found.grip_shift.values[:, 1, 0], "force": -found.grip_force.values[:, 1, 0],
        "rods": int(found.broken_rods.values[-1]), "bonds": int(found.broken_bonds.values[-1]),
    }  # fmt: skip


def _kept(run: dict[str, Any]) -> dict[str, Any]:
    return {k: [float(f"{v:.4g}") for v in run[k]] for k in ("way", "force")}


def main(species: list[str], seeds: list[int], rods: int) -> None:
    """Print a row for each quantity, and keep all curves."""
    sheet = Sheet("wood-crushing" if rods == 20 else f"wood-crushing-{rods}", _HEAD, "wood")
    for name in species:
        wood = wood_that_crushes(name)
        for seed in seeds:
            begun = time.process_time()
            block = pressed(wood, seed, rods)
            spent = time.process_time() - begun
            rows = [("compression", "crushing", float(block["force"].max()) / _SIDE**2, CRUSHES[name], block, spent)]
            for quantity, values in (
                ("rupture", wood),
                ("rupture without crushing", {**wood, "compressive_strength": None}),
            ):
                begun = time.process_time()
                stick = bending(values, seed, rods)
                got = bent(stick["way"], stick["force"])[1]
                rows.append(("bending", quantity, got, PUBLISHED[name][1], stick, time.process_time() - begun))
            for test, quantity, got, wanted, run, cpu in rows:
                scatter = _SCATTER[quantity]
                sheet.add(
                    (name, test, seed, f"{quantity} [MPa]", f"{got / 1e6:.4g}", f"{wanted / 1e6:.4g}",
                     f"{100 * scatter:.0f} %", "yes" if abs(got / wanted - 1) <= scatter else "no", run["rods"],
                     run["bonds"], f"{cpu:.0f}"),
                    species=name, test=test, seed=seed, quantity=quantity, measured=got, published=wanted,
                    scatter=scatter, cpu_s=cpu, broken_rods=run["rods"], broken_bonds=run["bonds"], **_kept(run),
                )  # fmt: skip
                sheet.keep()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--species", nargs="+", default=list(SPECIES), choices=list(SPECIES))
    parser.add_argument("--seeds", nargs="+", type=int, default=[1])
    parser.add_argument("--rods", type=int, default=20)
    asked = parser.parse_args()
    main(asked.species, asked.seeds, asked.rods)
