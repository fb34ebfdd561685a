"""What is meant to break the decay solver, and how each try ends: python -m benchmarks.decay.stress [case ...].

Each case returns what was found; what must not happen ends in `Broken`. A typed error is a good end where one is due.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.tries import Broken, demand, show
from solver.contract import Context, InvalidGeometry, Need
from solver.decay import SOLVER, DecayParams
from solver.decay.fields.layer import Layer
from solver.decay.fields.rates import daily
from solver.decay.fields.stepping import march
from solver.decay.fields.system import System
from solver.decay.settings import choose
from solver.decay.surfaces.surface import Surface, geodesic, triangulated

__all__ = [
    "CASES",
    "SLOW",
]

Array = NDArray[np.float64]


def _grown(values: dict[str, Any], preset: str | None = None) -> str:
    """Run rot and mould on a small sphere; return what they covered."""
    params = SOLVER.parse({"climate": "paper", **values}, preset)
    assert isinstance(params, DecayParams)
    system = System(params, 16, True)
    worst = 0.0
    for reached in march(system, (0.5, 3.0), 1e-3, choose(params, "preview").longest, Context()):
        for layer, state in zip((system.rot, system.mould), reached.state[:2], strict=True):
            assert layer is not None
            assert state is not None
            demand(all(np.isfinite(part).all() for part in state[:3]), "not finite")
            demand(min(part.min() for part in state[:3]) >= 0, "negative")
            worst = max(worst, layer.budget_error(state))
            share = layer.share(state)
    demand(worst < 1e-11, f"the budget is off by {worst:.1e}")
    return f"mould on {100 * system.surface.mean(share > 0.1):.0f} %, budget {worst:.0e}, {reached.steps} steps"


def _spread(points: Array, faces: NDArray[np.int64], steps: int = 10) -> tuple[str, Surface, Array]:
    """Let a colony spread on any mesh; return what it covered, the surface and the colony's map."""
    params = DecayParams(climate="paper")
    surface = triangulated(points, faces)
    layer = Layer(surface, daily(params.rot, params, 1.0), np.ones(len(points)), np.ones(len(points)))
    state = layer.seeded(layer.fresh, points[0], 0.3)
    for _ in range(steps):
        state = layer.advance(state, 0.05)
    demand(all(np.isfinite(part).all() and part.min() >= 0 for part in state[:3]), "not finite or negative")
    demand(layer.budget_error(state) < 1e-11, "the budget is off")
    share = layer.share(state)
    return f"rot on {surface.mean(share > 0.01) * 100:.2g} %, budget {layer.budget_error(state):.0e}", surface, share


def _frames() -> str:
    for seed in range(5):
        params, ends = DecayParams(climate="paper", seed=seed), []
        for rate in (24, 96):
            days = tuple(np.arange(1, rate + 1) / rate * 2.0)
            *_, end = march(System(params, 8, True), days, 1e-3, 0.5, Context())
            ends.append(end.state[:2])
        same = all(np.array_equal(a, b) for x, y in zip(*ends, strict=True) for a, b in zip(x[:3], y[:3], strict=True))
        demand(same, "the number of frames changed the rot")
    return "24 and 96 frames end in the same bytes, five seeds"


def _dry() -> str:
    values = {"body": "quasi-static", "wounds": (), "transpiration": 50, "weight": 100, "water_content": 90}
    need = Need(fields=("volume", "least_jacobian", "water_lost"), stages=(0.0, 30.0), quality="preview")
    run = SOLVER.solve(SOLVER.parse(values, "orange"), need)
    demand(float(run.water_lost[1]) == 0.9, "not dry")
    demand(float(run.least_jacobian.min()) > 0, "inverted")
    left = float(run.volume[1] / run.volume[0])
    return f"volume {left:.3f} of the fresh one, least J {float(run.least_jacobian[1]):.2f}"


def _obtuse() -> str:
    points, faces = geodesic(16)
    flat = points * [1.0, 0.02, 1.0]
    said, surface, _ = _spread(flat, faces)
    demand(surface.weight.min() >= 0, "a negative weight")
    return said


def _hole() -> str:
    points, faces = geodesic(16)
    kept = faces[points[faces].mean(axis=1)[:, 0] < 0.5]
    used, faces = np.unique(kept, return_inverse=True)
    return _spread(points[used], faces.reshape(-1, 3))[0]


def _inverted() -> str:
    points, faces = geodesic(16)
    said, _, there = _spread(points, faces)
    _, _, here = _spread(points, faces[:, ::-1].copy())
    demand(float(np.abs(here - there).max()) < 1e-9, "inside out is not the same")
    return said


def _nothing() -> str:
    try:
        triangulated(np.zeros((0, 3)), np.zeros((0, 3), np.int64))
    except InvalidGeometry as error:
        return f"InvalidGeometry: {error}"
    raise Broken("a surface without points was taken")


def _million() -> str:
    n = 1000
    x, y = np.meshgrid(np.linspace(0, 2, n), np.linspace(0, 2, n), indexing="ij")
    points = np.stack([x, 0.2 * np.sin(2 * x) * np.cos(y), y], axis=-1).reshape(-1, 3)
    at = np.arange(n * n).reshape(n, n)
    a, b, c, d = (at[:-1, :-1], at[1:, :-1], at[:-1, 1:], at[1:, 1:])
    faces = np.concatenate([np.stack([p.ravel() for p in t], axis=-1) for t in ((a, c, b), (b, c, d))])
    return _spread(points, faces, 2)[0]


def _group() -> str:
    centres = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / 2**0.5
    beside = [{"position": tuple(map(float, c - centres[0]))} for c in centres[1:]]
    return _grown({"seeds": "contacts", "neighbours": beside}, "orange")


CASES: dict[str, Callable[[], str]] = {
    "u0 = 1: d2 and the wounds' density are 1": lambda: _grown({"rot": {"d2": 1.0, "d1": 1e-4, "sigma1": 0.02}}),
    "a colony on a pole": lambda: _grown({"wounds": [{"colatitude": 0}]}),
    "a colony on the stem of an apple": lambda: _grown({"wounds": [{"colatitude": 0}]}, "apple"),
    "obtuse triangles: a sphere pressed flat": _obtuse,
    "hardly any nutrient": lambda: _grown({"nutrient": 1e-6}),
    "24 or 96 frames": _frames,
    "90 % of the water lost": _dry,
    "a closed group of four touching oranges": _group,
    "a mesh with a hole": _hole,
    "an inverted mesh": _inverted,
    "0 vertices": _nothing,
    "1 000 000 vertices": _million,
}
SLOW = ("1 000 000 vertices",)


if __name__ == "__main__":
    show(CASES, sys.argv[1:], "decay")
