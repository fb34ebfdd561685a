"""Cracks along the grain against beam theory: python -m benchmarks.wood.fracture [--picture OUT.png].

Two planks with a saw cut, slowly, on scaled masses, rods unbreakable. DCB (double cantilever beam): grips draw both
halves apart. ENF (end-notched flexure): three-point bending, in which the halves slide. Force over displacement is held
against beam theory, from the cut's own length on: corrected, with a sharp crack (ISO 15024), for DCB; with an interface
that softens (`softening`) for ENF, whose process zone is half as long as what the crack has to grow. A row for each
mesh: force over beam theory's well before the crack grows, the highest, the mean from there on, the root of the mean
square of errors; the area that the crack has grown by, and the energy that this took by area. Where edges are too long
for a crack's tip, bonds that slide are weaker than the wood (`resolved`): for ENF the highest force stands also over
what theory says that a plank of such strength bears.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.figures import Sheet, load
from solver.contract import Need
from solver.wood import SOLVER, WoodParams
from solver.wood.model.joining import resolved
from solver.wood.model.outline import corners

from .shared.softening import Flexure

__all__ = ["DCB", "ENF", "E_ACROSS", "WIDE", "E", "G", "Trial", "chi", "measured", "trial"]

#: Spruce along the grain: E, across it, G [Pa]; toughness by opening and by sliding [J/m2]; width of the planks [m].
E, E_ACROSS, G, _OPENS, _SLIDES, WIDE = 10e9, 0.5e9, 0.7e9, 250.0, 700.0, 0.02
#: Shear strength [Pa].
_SHEARS = 8e6
#: Forces are means between so many times.
_STAGES = 50
_FIELDS = ("grip_impulse", "crack_area", "fracture_energy", "kinetic_energy", "elastic_energy")
_HEAD = ("test", "rods", "vertices", "seed", "force before", "highest", "of what it bears", "mean after", "rms error",
         "area grown [cm2]", "energy by area [J m-2]", "CPU s")  # fmt: skip


def chi() -> float:
    """Return by how much longer cracks are than they look, over half the plank's height (ISO 15024)."""
    soft = 1.18 * np.sqrt(E * E_ACROSS) / G
    return float(np.sqrt(E / (11 * G) * (3 - 2 * (soft / (1 + soft)) ** 2)))


@dataclass(frozen=True)
class Trial:
    """A test: half the plank's height h, its length, the cut [m], how far [m] and how long [s] it is driven.

    grips (spacing of vertices) and box: as parameters of wood; drives: the grip of which force is read, and its sign;
    theory (cut [m], shear strength [Pa]) returns displacements [m], rising, and forces [N]. scaling: of masses.
    """

    name: str
    high: float
    length: float
    cut: tuple[float, float]
    way: float
    last: float
    grips: Callable[[float, list[dict[str, Any]]], list[dict[str, Any]]]
    drives: tuple[int, float]
    theory: Callable[[float, float], tuple[np.ndarray, np.ndarray]]
    scaling: float


def _grip(x: float, near: float, side: int = 0, path: Any = (), holds: str = "z") -> dict[str, Any]:
    low, high = (-1.0 if side <= 0 else 0.0), (1.0 if side >= 0 else 0.0)
    return {"low": (x - near, -1, low), "high": (x + near, 1, high), "path": path, "holds": holds}


_DCB_LONG, _DCB_HIGH = 0.16, 0.005


def _opened(near: float, path: list[dict[str, Any]]) -> list[dict[str, Any]]:
    # each half goes half the way
    up, down = ([{**p, "shift": (0, 0, sign * p["shift"][2] / 2)} for p in path] for sign in (1, -1))
    return [_grip(_DCB_LONG, near, 1, up), _grip(_DCB_LONG, near, -1, down)]


def _opens(cut: float, _: float) -> tuple[np.ndarray, np.ndarray]:
    """Force P and opening of a crack of length a: P^2 a^2 = G b EI and 2 P a^3 / (3 EI), a with its correction.

    What is sharp opens at no load that hangs on a strength.
    """
    bend = E * WIDE * _DCB_HIGH**3 / 12
    a = cut + chi() * _DCB_HIGH + np.linspace(0, 0.06, 400)
    force = np.sqrt(_OPENS * WIDE * bend) / a
    return np.append(0.0, 2 * force * a**3 / (3 * bend)), np.append(0.0, force)


_ENF_HALF, _ENF_HIGH, _ENF_OVER = 0.16, 0.008, 0.01


def _slid(near: float, path: list[dict[str, Any]]) -> list[dict[str, Any]]:
    down = [{**p, "shift": (0, 0, -p["shift"][2])} for p in path]
    first, middle, last = (_ENF_OVER + n * _ENF_HALF for n in range(3))
    return [_grip(first, near), _grip(last, near), _grip(middle, near, 0, down, "yz")]


def _slides(cut: float, strength: float) -> tuple[np.ndarray, np.ndarray]:
    """Beam theory with an interface that softens; a crack counts longer by .42 chi h (Williams 1989)."""
    more = 0.42 * chi() * _ENF_HIGH
    theory = Flexure(_ENF_HIGH, WIDE, _ENF_HALF, E, G, strength, _SLIDES, more)
    d, force = theory.curve(cut - _ENF_OVER)
    # what turns back cannot be followed by a jaw
    rises = np.append(True, d[1:] > np.maximum.accumulate(d)[:-1])
    return d[rises], force[rises]


DCB = Trial("DCB", _DCB_HIGH, _DCB_LONG, (0.08, 1.0), 0.013, 0.6, _opened, (0, 1.0), _opens, 400.0)
ENF = Trial(
    "ENF", _ENF_HIGH, 2 * (_ENF_HALF + _ENF_OVER), (-0.1, 0.121), 0.0082, 0.8, _slid, (2, -1.0), _slides, 1600.0
)


def _path(trial: Trial) -> list[dict[str, Any]]:
    """Return the way of the jaws: faster and faster for a fifth of the time, so that nothing swings, then evenly."""
    share = np.append(np.linspace(0, 0.2, 11), 1.0)
    gone = np.where(share < 0.2, share**2 / 0.4, share - 0.1) / 0.9
    return [
        {"time": float(t * trial.last), "shift": (0, 0, float(g * trial.way))} for t, g in zip(share, gone, strict=True)
    ]


def trial(of: Trial, rods: int, vertices: int, seed: int = 0, **values: Any) -> Mapping[str, np.ndarray]:
    """Return displacements [m] and forces [N] between stages, areas [m2] and energies [J] at stages, and the shear
    strength [Pa] of bonds in this mesh.
    """
    half, path = WIDE / 2, _path(of)
    wood = {
        "length": of.length, "rods": rods, "vertices": vertices, "seed": seed, "unevenness": 0.0, "strain_limit": 1.0,
        "outline": [(-half, -of.high), (half, -of.high), (half, of.high), (-half, of.high)],
        "grain": {"stiffness": 0.0, "strength": 0.0}, "clamp": "start" if of is DCB else "none",
        "cuts": [{"low": (of.cut[0], -1, 0), "high": (of.cut[1], 1, 0)}],
        "stiffness": E, "transverse": E_ACROSS, "shear": G, "toughness": _OPENS, "toughness_sliding": _SLIDES,
        "shear_strength": _SHEARS,
        "grips": of.grips(0.505 * of.length / (vertices - 1), path), "mass_scaling": of.scaling, "damping": 8.0,
    }  # fmt: skip
    stages = tuple(np.linspace(of.last / _STAGES, of.last, _STAGES))
    params = SOLVER.parse({**wood, **values})
    assert isinstance(params, WoodParams)
    found = SOLVER.solve(params, Need(stages=stages, fields=_FIELDS))
    grip, sign = of.drives
    given = np.concatenate([[0.0], found.grip_impulse.values[:, grip, 2]])
    times = np.concatenate([[0.0], found.stage.values])
    way = np.interp(times, [p["time"] for p in path], [p["shift"][2] for p in path])
    return {
        "way": (way[1:] + way[:-1]) / 2, "force": sign * np.diff(given) / np.diff(times),
        "area": found.crack_area.values, "spent": found.fracture_energy.values,
        "balance": found.residual.values, "moving": found.kinetic_energy.values / found.elastic_energy.values,
        "shears": np.array(resolved(params, of.length / (vertices - 1), corners(params))[1]),
    }  # fmt: skip


def measured(of: Trial, run: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Return what the curve is beside beam theory's, as ratios, and what the crack took."""
    cut = float(run["area"][0]) / WIDE
    way, force = of.theory(cut, _SHEARS)
    d, p, top = run["way"], run["force"], float(way[np.argmax(force)])
    before, after, all_ = (d > 0.4 * top) & (d < 0.8 * top), (d > top) & (d < way[-1]), (d > 0.4 * top) & (d < way[-1])
    wanted = np.interp(d, way, force)
    # a weak plank's crack is through to the load, from where on it bears more again, beyond what was driven
    drawn, weak = of.theory(cut, float(run["shears"]))
    weak = weak[drawn <= d[all_].max()]
    area, spent = (run[name][-1] - run[name][0] for name in ("area", "spent"))
    return {
        "before": float(p[before].sum() / wanted[before].sum()),
        "highest": float(p[all_].max() / force.max()),
        "borne": float(p[all_].max() / weak.max()),
        "mean": float(p[after].sum() / wanted[after].sum()),
        "rms": float(np.sqrt(np.mean((p[all_] / wanted[all_] - 1) ** 2))),
        "area": float(area),
        "by_area": float(spent / area),
        "balance": float(run["balance"].max()),
    }


def _drawn(out: Path) -> None:
    """Draw the record's curves beside the analytic ones."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.6), layout="constrained")
    runs = load("wood-fracture")["runs"]
    for axes, of in zip(figure.subplots(1, 2), (DCB, ENF), strict=True):
        mine = [run for run in runs if run["test"] == of.name]
        for n, run in enumerate(mine):
            axes.plot(1e3 * np.array(run["way_m"]), run["force_N"], lw=0.9, color=f"C{n}",
                      label=f"{run['rods']} rods of {run['vertices']} vertices, seed {run['seed']}")  # fmt: skip
        d, p = of.theory(mine[0]["cut"], _SHEARS)
        axes.plot(1e3 * d, p, "k--", lw=1.4, label="beam theory")
        axes.set(title=of.name, xlabel="displacement [mm]", ylabel="force [N]",
                 xlim=(0, 1e3 * of.way), ylim=(0, 1.25 * p.max()))  # fmt: skip
        axes.legend(fontsize=7)
    figure.savefig(out, dpi=90)


def main(meshes: list[str]) -> None:
    """Print a row for each mesh and keep all curves."""
    sheet = Sheet("wood-fracture", _HEAD, "wood")
    for word in meshes:
        name, rods, vertices, seed = word.split(":")
        of, begun = {"DCB": DCB, "ENF": ENF}[name], time.process_time()
        run = trial(of, int(rods), int(vertices), int(seed))
        got, cpu = measured(of, run), time.process_time() - begun
        sheet.add(
            (name, rods, vertices, seed, *(f"{got[k]:.3f}" for k in ("before", "highest")),
             f"{got['borne']:.3f}" if of is ENF else "", *(f"{got[k]:.3f}" for k in ("mean", "rms")),
             f"{1e4 * got['area']:.2f}", f"{got['by_area']:.0f}", f"{cpu:.0f}"),
            test=name, rods=int(rods), vertices=int(vertices), seed=int(seed), cut=float(run["area"][0]) / WIDE,
            way_m=[float(f"{v:.4g}") for v in run["way"]], force_N=[float(f"{v:.4g}") for v in run["force"]],
            shear_strength_Pa=float(run["shears"]), cpu_s=cpu, **got,
        )  # fmt: skip
        # a row takes minutes: what is there is kept
        sheet.keep()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    meshes = ["DCB:24:33:0", "ENF:24:35:0", "DCB:24:17:0", "DCB:24:33:1", "DCB:96:33:0", "ENF:24:69:0", "DCB:24:65:0"]
    meshes += ["DCB:24:33:2", "ENF:24:35:1", "ENF:24:35:2", "ENF:96:35:0", "ENF:24:137:0", "DCB:24:129:0"]
    parser.add_argument(
        "meshes", nargs="*", default=meshes, metavar="TEST:RODS:VERTICES:SEED", help="default: %(default)s"
    )
    parser.add_argument("--picture", type=Path, help="draw the record; run nothing")
    asked = parser.parse_args()
    if asked.picture:
        _drawn(asked.picture)
    else:
        main(asked.meshes)
