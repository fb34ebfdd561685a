"""Speed of growth on one thread, kernels compiled beforehand, CPU seconds.

python -m benchmarks.growth [vertices ...]            seconds to equal residual: quasi-Newton, L-BFGS and conjugate
                                                      gradients on a growing disc and sphere, in one run
python -m benchmarks.growth --slices [vertices ...]   frames of a scripted painting, 0.3 % growth in each; the whole
                                                      solved in every frame, and only what is active
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.figures import Sheet
from solver import shell
from solver.contract import NotConverged
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.settling.energy import elastic
from solver.growth.tooling.tools import HotSpot

#: Shape and tool of what is timed.
CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "leaf rim 3 %": (
        {"shape": "disc", "thickness": 0.02, "curved": False},
        {
            "kind": "surface",
            "where": {"kind": "band", "along": "radius", "low": 0.6, "high": 1.0},
            "stretch": (1.03, 1.0),
        },
    ),
    "sphere spot 3 %": (
        {"shape": "sphere", "thickness": 0.02},
        {"kind": "spot", "at": (0, 0, 1), "stretch": (1.03, 1.03)},
    ),
}
_STEPS, _PATIENCE = 4, 3000
_FRAMES, _STROKE = 150, 15
_SLICE, _EXACT = 0.01, 1e-5
#: A painting: shape, and where its strokes of `_STROKE` frames lie.
_PAINTINGS: dict[str, tuple[dict[str, Any], Callable[[float], tuple[float, float, float]]]] = {
    "leaf": ({"shape": "disc", "thickness": 0.02, "curved": False}, lambda a: (0.8 * np.cos(a), 0.8 * np.sin(a), 0.0)),
    "sphere": (
        {"shape": "sphere", "thickness": 0.02},
        lambda a: (np.cos(a) * np.cos(3 * a), np.sin(a) * np.cos(3 * a), np.sin(3 * a)),
    ),
}


def measure(values: dict[str, Any], tool: dict[str, Any], vertices: int, way: str) -> dict[str, float]:
    """Return CPU seconds and iterations of a step, or the residual where there is no equilibrium within patience."""
    params = GrowthParams.parse({**values, "tools": [tool], "step": 1.0, "remesh": 0, "solver": way})
    engine = Engine(params, vertices, 1e-3, most=_PATIENCE)
    seconds: list[float] = []
    for step in range(_STEPS):
        begun = time.process_time()
        try:
            engine.advance(1e9, until=step + 1.0)
        except NotConverged as error:
            return {"cpu": time.process_time() - begun, "residual": float(error.residual or 0.0)}
        seconds.append(time.process_time() - begun)
    return {"cpu": sum(seconds) / _STEPS, "iterations": engine.state.iterations / _STEPS}


def _said(found: dict[str, float]) -> str:
    if "residual" in found:
        return f"none in {_PATIENCE} it., {found['cpu']:.1f} s"
    return f"{found['cpu']:.2g} s, {found['iterations']:.0f} it."


def paint(
    name: str, vertices: int, frames: int = _FRAMES, active: bool = False, residual: float = 1e-3
) -> tuple[dict[str, float], Engine]:
    """Paint with a brush that moves on after some frames; a frame is one growth step to a residual.

    Returns milliseconds of frames and of their slices, and the painting.
    """
    values, path = _PAINTINGS[name]
    values = {**values, "tools": [], "step": 1.0, "remesh": 1.3, "active": active}
    engine = Engine(GrowthParams.parse(values), vertices, residual)
    frame: list[float] = []
    piece: list[float] = []
    before = len(engine.state.x)
    for number in range(frames):
        begun = time.process_time()
        if number % _STROKE == 0:
            at = path(2 * np.pi * number / frames)
            engine.add(HotSpot(at=at, radius=0.4, stretch=(1.003, 1.003), duration=_STROKE))
        done = False
        while not done:
            since = time.process_time()
            done = engine.advance(_SLICE, until=number + 1.0)
            piece.append(1e3 * (time.process_time() - since))
        frame.append(1e3 * (time.process_time() - begun))
    median, late = np.percentile(frame, [50, 95])
    found = {"median": float(median), "p95": float(late), "worst": max(frame)}
    found |= {"slice_p95": float(np.percentile(piece, 95)), "slice_longest": max(piece)}
    found |= {"iterations": engine.state.iterations / frames, "begun": before, "ended": len(engine.state.x)}
    return found, engine


def compared(one: Engine, other: Engine) -> dict[str, float]:
    """Return how far two paintings of one script are from each other, laid on each other, and their energies.

    No distances where their triangles are not the same.
    """
    material = shell.Material(one.params.thickness)
    first, second = (float(elastic(e.state, material, e.params.bending)) for e in (one, other))
    found = {"energy": first, "energy_other": second}
    if not np.array_equal(one.state.mesh.triangles, other.state.mesh.triangles):
        return found
    x, y = (e.state.x - e.state.x.mean(axis=0) for e in (one, other))
    u, _, v = np.linalg.svd(x.T @ y)
    away = np.linalg.norm(x @ (u @ v) - y, axis=1)
    return found | {"largest": float(away.max()), "rms": float(np.sqrt((away**2).mean()))}


def slices(counts: Sequence[int]) -> None:
    """Tell what a painting costs both ways, and how far they end from each other and from a hundredth of the goal."""
    for name in _PAINTINGS:  # compile
        paint(name, 600, 40, active=True)
    head = ("painting", "solved", "median frame [ms]", "p95", "worst", "p95 of slices", "longest", "iterations a frame")
    cost = Sheet("growth-painting", head, "growth")
    apart = Sheet("growth-apart", ("painting", "compared", "largest distance", "rms", "energies"), "growth")
    for vertices, name in itertools.product(counts, _PAINTINGS):
        place: dict[str, Any] = {"painting": name, "vertices": vertices}
        ends = {}
        for way in ("whole", "active"):
            found, ends[way] = paint(name, vertices, active=way == "active")
            times = [f"{found[key]:.0f}" for key in ("median", "p95", "worst", "slice_p95", "slice_longest")]
            cost.add((f"{name}, {vertices}", way, *times, f"{found['iterations']:.1f}"), **place, way=way, **found)
        ends[f"whole to {_EXACT:g}"] = paint(name, vertices, residual=_EXACT)[1]
        for one, other in itertools.combinations(ends, 2):
            found = compared(ends[one], ends[other])
            off = [f"{found[key]:.1e}" if key in found else "other triangles" for key in ("largest", "rms")]
            energies = f"{found['energy']:.4e}, {found['energy_other']:.4e}"
            what = f"{one} and {other}"
            apart.add((f"{name}, {vertices}", what, *off, energies), **place, one=one, other=other, **found)
    cost.keep(slice_seconds=_SLICE)
    apart.keep()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("vertices", type=int, nargs="*")
    parser.add_argument("--slices", action="store_true", help="frames of a scripted painting")
    parser.add_argument("--ways", nargs="*", default=["quasi_newton", "lbfgs", "cg"], help="ways to equilibrium")
    given = parser.parse_args()
    with threadpool_limits(1, user_api="blas"):
        if given.slices:
            slices(given.vertices or [5000, 10_000])
            return
        for values, tool in CASES.values():  # compile
            measure(values, tool, 100, "quasi_newton")
        sheet = Sheet("growth-ways", ("case", *given.ways), "growth")
        for vertices in given.vertices or [2600, 10_000]:
            for name, (values, tool) in CASES.items():
                found = {way: measure(values, tool, vertices, way) for way in given.ways}
                sheet.add((f"{name}, {vertices}", *map(_said, found.values())), case=name, vertices=vertices, **found)
        sheet.keep()


if __name__ == "__main__":
    main()
