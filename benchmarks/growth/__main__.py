"""Speed of growth on one thread, kernels compiled beforehand, CPU seconds.

python -m benchmarks.growth [vertices ...]            seconds to equal residual: quasi-Newton, L-BFGS and conjugate
                                                      gradients on a growing disc and sphere, in one run
python -m benchmarks.growth --slices [vertices ...]   frames of a scripted painting, 0.3 % growth in each; the whole
                                                      solved in every frame, and only what is active
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.figures import Sheet
from solver import shell
from solver.contract import NotConverged
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.settling.energy import elastic
from solver.growth.tooling.tools import HotSpot

_CASES = {
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
_PAINTINGS = {
    "leaf": ({"shape": "disc", "thickness": 0.02, "curved": False}, lambda a: (0.8 * np.cos(a), 0.8 * np.sin(a), 0.0)),
    "sphere": (
        {"shape": "sphere", "thickness": 0.02},
        lambda a: (np.cos(a) * np.cos(3 * a), np.sin(a) * np.cos(3 * a), np.sin(3 * a)),
    ),
}


def measure(values: dict, tool: dict, vertices: int, way: str) -> str:
    params = GrowthParams.parse({**values, "tools": [tool], "step": 1.0, "remesh": 0, "solver": way})
    engine = Engine(params, vertices, 1e-3, most=_PATIENCE)
    seconds: list[float] = []
    for step in range(_STEPS):
        begun = time.process_time()
        try:
            engine.advance(1e9, until=step + 1.0)
        except NotConverged as error:
            return f"none in {_PATIENCE} iterations, {time.process_time() - begun:.1f} s, residual {error.residual:.0e}"
        seconds.append(time.process_time() - begun)
    return f"{sum(seconds) / _STEPS:.3f} s a step, {engine.state.iterations / _STEPS:.0f} iterations"


def paint(
    name: str, vertices: int, frames: int = _FRAMES, active: bool = False, residual: float = 1e-3
) -> tuple[str, Engine]:
    """Paint with a brush that moves on after some frames; a frame is one growth step to a residual.

    Returns what was measured, and the painting.
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
    said = (
        f"median {median:.0f} ms, p95 {late:.0f} ms, worst {max(frame):.0f} ms, slices of "
        f"{1e3 * _SLICE:.0f} ms: p95 {np.percentile(piece, 95):.0f} ms, longest {max(piece):.0f} ms, "
        f"{engine.state.iterations / frames:.1f} iterations a frame, {before} to {len(engine.state.x)} vertices"
    )
    return said, engine


def compared(one: Engine, other: Engine) -> str:
    """Return how far two paintings of one script are from each other, laid on each other, and their energies."""
    material = shell.Material(one.params.thickness)
    energies = [elastic(e.state, material, e.params.bending) for e in (one, other)]
    said = f"energies {energies[0]:.4e} {energies[1]:.4e}"
    if not np.array_equal(one.state.mesh.triangles, other.state.mesh.triangles):
        return f"other triangles, {said}"
    x, y = (e.state.x - e.state.x.mean(axis=0) for e in (one, other))
    u, _, v = np.linalg.svd(x.T @ y)
    away = np.linalg.norm(x @ (u @ v) - y, axis=1)
    return f"apart: largest {away.max():.1e}, rms {np.sqrt((away**2).mean()):.1e}, {said}"


def painted(name: str, vertices: int) -> Iterator[tuple[str, str]]:
    """Yield what a painting costs both ways, and how far they end from each other and from a hundredth of the goal."""
    said, whole = paint(name, vertices)
    yield "whole", said
    said, active = paint(name, vertices, active=True)
    yield "active", said
    exact = paint(name, vertices, residual=_EXACT)[1]
    yield "active to whole", compared(active, whole)
    yield f"whole to a residual of {_EXACT:g}", compared(whole, exact)
    yield f"active to a residual of {_EXACT:g}", compared(active, exact)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("vertices", type=int, nargs="*")
    parser.add_argument("--slices", action="store_true", help="frames of a scripted painting")
    parser.add_argument("--ways", nargs="*", default=["quasi_newton", "lbfgs", "cg"], help="ways to equilibrium")
    given = parser.parse_args()
    with threadpool_limits(1, user_api="blas"):
        if given.slices:
            for name in _PAINTINGS:  # compile
                paint(name, 600, 40, active=True)
            sheet = Sheet("growth-painting", ("vertices", "painting", "what", "found"), "growth")
            for vertices in given.vertices or [5000, 10_000]:
                for name in _PAINTINGS:
                    for what, found in painted(name, vertices):
                        sheet.add((vertices, name, what, found))
            sheet.keep()
            return
        for values, tool in _CASES.values():  # compile
            measure(values, tool, 100, "quasi_newton")
        sheet = Sheet("growth-ways", ("case", *given.ways), "growth")
        for vertices in given.vertices or [2600, 10_000]:
            for name, (values, tool) in _CASES.items():
                found = {way: str(measure(values, tool, vertices, way)) for way in given.ways}
                sheet.add((f"{name}, {vertices}", *found.values()), case=name, vertices=vertices, **found)
        sheet.keep()


if __name__ == "__main__":
    main()
