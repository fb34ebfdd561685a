"""A test bench of spruce and beech, dry (12 % moisture) and green: python -m benchmarks.wood.bench [--picture OUT.png].

Read as a laboratory reads them, from force and way alone. Three-point bending of 25 mm square sticks over 360 mm (ASTM
D143): apparent modulus from a fifth to two fifths of the largest force, modulus of rupture from the largest. Splitting:
a double cantilever beam (opening) and end-notched flexure (sliding), toughness by the compliance-based beam method
after the largest force, so without looking at the crack.

Species: Sitka spruce and American beech, dry and green, by the Wood Handbook (FPL-GTR-190, 2010): Table 5-3a (modulus,
rupture, shear, tension across; spruce by the same rows of the edition of 1974), 5-1 (ratios; beech has none there:
yellow birch's), scatter by Table 5-6. The true modulus is 1.1 times the apparent one (footnote c). Rods break at the
strain that makes sticks rupture as published, by Weibull's law of size: a stick's is that of its weakest place, a rod's
that of one correlation length of the grain. So the row of rupture shows what section, grain and cracks make of it, and
is no prediction. Toughnesses are assumed: no table of them was read.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.figures import Sheet, load
from solver.contract import Need
from solver.wood import SOLVER
from solver.wood.model.grain import weibull_modulus
from solver.wood.params import Grain

from .fracture import DCB, ENF, trial

__all__ = ["SPECIES", "bending", "bent", "opened", "size_share", "slid"]

_HEAD = ("species", "test", "seed", "quantity", "measured", "published", "scatter", "in it", "rods broken",
         "bonds broken", "CPU s")  # fmt: skip
#: Apparent modulus, modulus of rupture [Pa] (Table 5-3a) and their coefficients of variation (Table 5-6).
PUBLISHED = {
    "spruce": (10.8e9, 70e6), "beech": (11.9e9, 103e6),
    "green spruce": (8.5e9, 39e6), "green beech": (9.5e9, 59e6),
}  # fmt: skip
_SCATTER = (0.22, 0.16)
_SIDE, _SPAN, _LONG, _LAST = 0.025, 0.36, 0.40, 0.4


def size_share(grain: Grain | None = None) -> float:
    """Return the strength of a stick in three-point bending over that of one correlation volume of its grain.

    By Weibull (1939): n^(-1/m), with the volume over 2 (m + 1)^2 that bears as if stress were even, m the modulus.
    """
    grain = grain or Grain()
    m = weibull_modulus(grain.strength)
    cells = _SIDE**2 * _SPAN / (grain.along * grain.across**2)
    return float((cells / (2 * (m + 1) ** 2)) ** (-1 / m))


def _species(name: str, gravity: float, across: float, shear: float, torn: float, shorn: float, tears: float,
             shears: float) -> dict[str, Any]:  # fmt: skip
    apparent, rupture = PUBLISHED[name]
    stiff = 1.1 * apparent
    return {
        "density": 1120 * gravity, "stiffness": stiff, "transverse": across * stiff, "shear": shear * stiff,
        "toughness": torn, "toughness_sliding": shorn, "cleavage": tears, "shear_strength": shears,
        "strain_limit": rupture / stiff / size_share(),
    }  # fmt: skip


SPECIES: Mapping[str, Mapping[str, Any]] = {
    "spruce": _species("spruce", 0.40, 0.060, 0.0625, 250.0, 700.0, 2.6e6, 7.9e6),
    "beech": _species("beech", 0.64, 0.064, 0.071, 450.0, 1400.0, 7.0e6, 13.9e6),
    "green spruce": _species("green spruce", 0.37, 0.060, 0.0625, 250.0, 700.0, 1.7e6, 5.2e6),
    "green beech": _species("green beech", 0.56, 0.064, 0.071, 450.0, 1400.0, 5.0e6, 8.9e6),
}
#: Way of the middle over that at which the beam's outer fibre bears its strain.
_WAY = 1.5
#: Height over half the side from where on rods are at a face.
_FACE = 0.5


def bending(
    wood: Mapping[str, Any], seed: int, rods: int = 20, vertices: int = 41, faces: bool = True
) -> dict[str, Any]:
    """Return way [m] and force [N] by time of three-point bending, what broke, and both sides' view at the end.

    faces: press and hold the rods at the faces, and not whole sections.
    """
    half, near = _SIDE / 2, 0.505 * _LONG / (vertices - 1)
    way = _WAY * wood["strain_limit"] * _SPAN**2 / (6 * _SIDE)
    share = np.append(np.linspace(0, 0.2, 11), 1.0)
    gone = np.where(share < 0.2, share**2 / 0.4, share - 0.1) / 0.9
    down = [{"time": float(t * _LAST), "shift": (0, 0, -float(g * way))} for t, g in zip(share, gone, strict=True)]
    # supports lie on vertices: two columns of them would be held as by a clamp
    places, paths = ((_LONG - _SPAN) / 2, (_LONG + _SPAN) / 2, _LONG / 2), ((), (), down)
    # a head presses the rods on top, and supports hold the lowest: what is held from rim to rim cannot warp, and its
    # outer fibres are strained by a fifth more (`benchmarks.wood.rupture`)
    face = _FACE * half if faces else -1.0
    grips = [
        {
            "low": (x - near, -1, face if p else -1), "high": (x + near, 1, 1 if p or not faces else -face),
            "path": p, "holds": "yz" if p else "z",
        }
        for x, p in zip(places, paths, strict=True)
    ]  # fmt: skip
    values = {
        **wood, "length": _LONG, "rods": rods, "vertices": vertices, "seed": seed, "unevenness": 0.0, "clamp": "none",
        "outline": [(-half, -half), (half, -half), (half, half), (-half, half)], "grips": grips, "damping": 40.0,
        "mass_scaling": 900.0,
    }  # fmt: skip
    fields = ("grip_force", "grip_shift", "broken_rods", "broken_bonds", "rod_position", "rod_cut")
    found = SOLVER.solve(SOLVER.parse(values), Need(stages=tuple(np.linspace(_LAST / 60, _LAST, 60)), fields=fields))
    return {
        "way": -found.grip_shift.values[:, 2, 2], "force": -found.grip_force.values[:, 2, 2],
        "rods": int(found.broken_rods.values[-1]), "bonds": int(found.broken_bonds.values[-1]),
        "note": found.attrs.get("note", ""), "ends": found.rod_position.values[-1], "cut": found.rod_cut.values[-1],
    }  # fmt: skip


def bent(way: np.ndarray, force: np.ndarray) -> tuple[float, float]:
    """Return apparent modulus and modulus of rupture [Pa] of the stick."""
    top = float(force.max())
    rise = np.arange(len(force)) <= int(force.argmax())
    part = rise & (force > 0.2 * top) & (force < 0.4 * top)
    slope = float(np.polyfit(way[part], force[part], 1)[0])
    return slope * _SPAN**3 / (4 * _SIDE**4), 3 * top * _SPAN / (2 * _SIDE**3)


def _after(force: np.ndarray, found: np.ndarray) -> float:
    """Return the mean from a tenth of the way beyond the largest force on."""
    return float(found[min(int(force.argmax()) + len(force) // 10, len(force) - 3) : -1].mean())


def opened(way: np.ndarray, force: np.ndarray, stiffness: float) -> float:
    """Return G_I [J/m2] of a DCB run: P^2 a^2 / (b E I), a by the compliance, (3 E I d / 2 P)^(1/3)."""
    wide = 0.02
    bend = stiffness * wide * DCB.high**3 / 12
    a = (1.5 * bend * way / force) ** (1 / 3)
    return _after(force, force**2 * a**2 / (wide * bend))


def slid(way: np.ndarray, force: np.ndarray, stiffness: float, shear: float) -> float:
    """Return G_II [J/m2] of an ENF run: 9 P^2 a^2 / (16 E b^2 h^3), a by the compliance.

    That is d / P = (3 a^3 + 2 S^3) / (8 E b h^3) + 3 S / (10 G b h).
    """
    wide, span, h = 0.02, 0.16, ENF.high
    cube = (8 * stiffness * wide * h**3 * (way / force - 3 * span / (10 * shear * wide * h)) - 2 * span**3) / 3
    a = np.cbrt(np.maximum(cube, 0.0))
    return _after(force, 9 * force**2 * a**2 / (16 * stiffness * wide**2 * h**3))


def _row(sheet: Sheet, head: tuple[Any, ...], name: str, unit: float, got: float, wanted: float, scatter: float | None,
         broken: tuple[Any, Any], cpu: float, **more: Any) -> None:  # fmt: skip
    inside = "" if scatter is None else ("yes" if abs(got / wanted - 1) <= scatter else "no")
    sheet.add(
        (*head, name, f"{got / unit:.4g}", f"{wanted / unit:.4g}" + (" assumed" if scatter is None else ""),
         "" if scatter is None else f"{100 * scatter:.0f} %", inside, *broken, f"{cpu:.0f}"),
        species=head[0], test=head[1], seed=int(head[2]), quantity=name, measured=got, published=wanted,
        scatter=scatter, cpu_s=cpu, **more,
    )  # fmt: skip
    sheet.keep()


def main(species: list[str], seeds: list[int]) -> None:
    """Print a row for each quantity, and keep all curves."""
    sheet = Sheet("wood-bench", _HEAD, "wood")
    for name in species:
        wood = SPECIES[name]
        for seed in seeds:
            begun = time.process_time()
            run = bending(wood, seed)
            cpu = time.process_time() - begun
            kept = {k: [float(f"{v:.4g}") for v in run[k]] for k in ("way", "force")}
            places = " ".join(f"{v:.4g}" for v in run["ends"][run["cut"] < 0][:, :, [0, 2]].ravel())
            drawn = {"note": run["note"], "edges": places if seed == seeds[0] else ""}
            head, broken = (name, "bending", str(seed)), (str(run["rods"]), str(run["bonds"]))
            for (quantity, unit, more), got, wanted, scatter in zip(
                (("apparent E [GPa]", 1e9, {}), ("rupture [MPa]", 1e6, {**kept, **drawn})),
                bent(run["way"], run["force"]), PUBLISHED[name], _SCATTER, strict=True,
            ):  # fmt: skip
                _row(sheet, head, quantity, unit, got, wanted, scatter, broken, cpu, **more)
        if name.startswith("green"):  # no source of their toughness was read
            continue
        for of, key, quantity in ((DCB, "toughness", "G_I [J m-2]"), (ENF, "toughness_sliding", "G_II [J m-2]")):
            begun = time.process_time()
            run = dict(trial(of, 24, 35 if of is ENF else 33, 0, **{**wood, "strain_limit": 1.0}))
            got = (
                opened(run["way"], run["force"], wood["stiffness"])
                if of is DCB
                else slid(run["way"], run["force"], wood["stiffness"], wood["shear"])
            )
            kept = {k: [float(f"{v:.4g}") for v in run[k]] for k in ("way", "force")}
            cpu = time.process_time() - begun
            _row(sheet, (name, of.name, "0"), quantity, 1.0, got, wood[key], None, ("", ""), cpu, **kept)


def _drawn(out: Path) -> None:
    """Draw the record: force over way, and the sticks at the end."""
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

    runs = [run for run in load("wood-bench")["runs"] if "way" in run]
    figure = Figure(figsize=(9, 8.2), layout="constrained")
    rows: Any = [["bending", "DCB", "ENF"], *([n] * 3 for n in SPECIES)]
    grid = figure.subplot_mosaic(rows, height_ratios=(3, *[1.2] * len(SPECIES)))
    for test in ("bending", "DCB", "ENF"):
        for run in (r for r in runs if r["test"] == test):
            colour, style = f"C{list(SPECIES).index(run['species'])}", "-" if run["seed"] <= 1 else ":"
            name = run["species"] if run["seed"] <= 1 else None
            grid[test].plot(1e3 * np.array(run["way"]), run["force"], style, color=colour, lw=1, label=name)
        grid[test].set(title=test, xlabel="way [mm]", ylabel="force [N]")
    figure.legend(*grid["bending"].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    for run in (r for r in runs if r.get("edges")):
        lines = 1e3 * np.array(run["edges"].split(), float).reshape(-1, 2, 2)
        axes = grid[run["species"]]
        axes.add_collection(LineCollection(list(lines), linewidths=0.5, colors="saddlebrown"))
        axes.set(xlim=(-5, 415), ylim=(-40, 20), ylabel="z [mm]", aspect="equal")
        axes.set_title(run["species"], fontsize=9, loc="left")
    figure.savefig(out, dpi=90)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--species", nargs="+", default=list(SPECIES), choices=list(SPECIES))
    parser.add_argument("--seeds", nargs="+", type=int, default=[1])
    parser.add_argument("--picture", type=Path, help="draw the record; run nothing")
    asked = parser.parse_args()
    if asked.picture:
        _drawn(asked.picture)
    else:
        main(asked.species, asked.seeds)
