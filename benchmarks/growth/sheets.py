"""How wrong thin sheets are at each quality: what the declared tolerances come from.

python -m benchmarks.growth.sheets [--only WORD] [--finest 20000]

Sheets that bend by growth or under their weight, as a run hands them over at preview, default and fine. Where there is
a theory the error is against it, with what is held where that was asked for: the radius that `curl` asks for; the tip
of a clamped strip and the middle of a clamped disc, small loads, of a plate whose Poisson's ratio in bending is that of
hinges, -1/3 (Kirchhoff; the strip by conforming elements, Bogner, Fox and Schmit 1965, of scikit-fem). Sheets that
ripple have many equilibria: each is grown from two seeds of its noise, and compared with the mean of both on a mesh of
twice as many vertices as fine has. Their heights are root mean squares along the thinnest direction of a shape.
With `--only` the other sheets' runs stay in the record.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from skfem import Basis, BilinearForm, ElementQuadBFS, LinearForm, MeshQuad, condense, solve
from threadpoolctl import threadpool_limits

from benchmarks.figures import RESULTS, Sheet, load
from solver import shell
from solver.contract import Context, Quality
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.settings import Settings, choose
from solver.growth.settling.energy import elastic, vertex_areas
from solver.growth.settling.stage import residual
from solver.growth.state import State

__all__ = ["CASES", "QUALITIES", "SHEETS", "Case", "measured"]

QUALITIES: tuple[Quality, ...] = ("preview", "default", "fine")
_RATIO, _WEIGHT, _HEAVY = -1 / 3, 1e-6, 1e-4
_SEEDS = (0, 1)

Measured = dict[str, float]


class Case(NamedTuple):
    """A sheet: its parameters, until when it grows, what is measured, and theory; none: the finest mesh."""

    values: dict[str, Any]
    until: float
    measure: Callable[[State, GrowthParams], Measured]
    theory: Measured


def measured(case: Case, settings: Settings, seed: int = 0) -> tuple[Measured, dict[str, float]]:
    """Return what is measured of a sheet as a run hands it over, and of the run: vertices, residual, CPU seconds."""
    params = GrowthParams.parse({**case.values, "seed": seed})
    begun = time.process_time()
    state = Engine(params, settings.vertices, settings.tolerance, history=False).reach(case.until, Context())
    run = {"vertices": len(state.x), "residual": residual(state, params), "cpu": time.process_time() - begun}
    return case.measure(state, params), run


def _radius(state: State, _: GrowthParams) -> Measured:
    """Radius of the circle next to the strip's points, seen along its axis, by least squares."""
    x = state.x - state.x.mean(axis=0)
    across = np.linalg.svd(x, full_matrices=False)[2]
    axis = across[np.abs(across[:, 1]).argmax()]
    flat = x - np.outer(x @ axis, axis)
    u, v = np.linalg.svd(flat, full_matrices=False)[2][:2] @ flat.T
    terms = np.stack([2 * u, 2 * v, np.ones_like(u)], axis=1)
    a, b, c = np.linalg.lstsq(terms, u * u + v * v, rcond=None)[0]
    return {"radius": float(np.sqrt(c + a * a + b * b))}


def _tip(state: State, _: GrowthParams) -> Measured:
    end = state.x[state.x[:, 0] > state.x[:, 0].max() - 1e-3]
    return {"sag": -float(end[:, 2].mean())}


def _middle(state: State, _: GrowthParams) -> Measured:
    return {"sag": -float(state.x[np.linalg.norm(state.x[:, :2], axis=1).argmin(), 2])}


def _rippled(state: State, params: GrowthParams) -> Measured:
    areas = vertex_areas(state)
    x = state.x - areas @ state.x / areas.sum()
    least = np.linalg.eigvalsh((x * areas[:, None]).T @ x / areas.sum())[0]
    energy = elastic(state, shell.Material(params.thickness, params.poisson), params.bending)
    return {"energy": float(energy / areas.sum()), "height": float(np.sqrt(least))}


def _cantilever(low: float, rigidity: float) -> float:
    """Return how far the tip of a plate 1 wide sags under a weight of 1 per area, clamped at low, ending at 2."""
    mesh = MeshQuad.init_tensor(np.linspace(low, 2.0, 61), np.linspace(-0.5, 0.5, 17))
    basis = Basis(mesh, ElementQuadBFS(), intorder=6)

    @BilinearForm  # type: ignore[untyped-decorator]
    def bent(u: Any, v: Any, _: Any) -> Any:
        (uxx, uxy), (_a, uyy) = u.hess
        (vxx, vxy), (_b, vyy) = v.hess
        twist = uxx * vyy + uyy * vxx - 2 * uxy * vxy
        return rigidity * ((uxx + uyy) * (vxx + vyy) - (1 - _RATIO) * twist)

    @LinearForm  # type: ignore[untyped-decorator]
    def load(v: Any, _: Any) -> Any:
        return v

    clamped = basis.get_dofs(lambda x: np.isclose(x[0], low))
    held = np.concatenate([clamped.all(name) for name in ("u", "u_x", "u_y", "u_xy")])
    found = solve(*condense(bent.assemble(basis), load.assemble(basis), D=held))
    return float(found[basis.nodal_dofs[0]][np.isclose(mesh.p[0], 2.0)].mean())


def _strip(low: float) -> Case:
    """A strip that is held up to x = low and sags under a small weight."""
    held = [{"where": {"kind": "band", "along": "x", "low": low + 0.2, "high": low - 0.2}}]
    values = {"shape": "strip", "aspect": 4.0, "thickness": 0.1, "imperfection": 0, "tools": [], "attached": held}
    expected = _WEIGHT * _cantilever(low, shell.Material(0.1, 0.3).flexural)
    return Case(values | {"gravity": (0, 0, -_WEIGHT)}, 0.05, _tip, {"sag": expected})


def _disc(radius: float) -> Case:
    """A disc that is held beyond a radius and sags under a small weight: q R^4 / (64 D), whatever Poisson's ratio."""
    held = [{"where": {"kind": "band", "along": "radius", "low": radius - 0.1, "high": radius + 0.1}}]
    values = {"shape": "disc", "thickness": 0.1, "imperfection": 0, "tools": [], "attached": held}
    expected = _HEAVY * radius**4 / (64 * shell.Material(0.1, 0.3).flexural)
    return Case(values | {"gravity": (0, 0, -_HEAVY)}, 0.05, _middle, {"sag": expected})


def _curl(curvature: float) -> Case:
    """A free strip that comes to want a curvature along itself and none across: a cylinder without any energy."""
    tool = {"kind": "surface", "where": {"kind": "everywhere"}, "frame": (1, 0, 0), "stretch": (1, 1)}
    values = {"shape": "strip", "aspect": 4.0, "thickness": 0.1, "tools": [tool | {"curl": (curvature, 0.0)}]}
    return Case(values, 1.0, _radius, {"radius": 1 / curvature})


def _rim() -> Case:
    """A disc whose rim grows around by 1.3 and ripples."""
    where = {"kind": "rim", "width": 0.4}
    tool = {"kind": "surface", "where": where, "frame": "around", "stretch": (1.3, 1.0)}
    return Case({"shape": "disc", "thickness": 0.03, "curved": False, "tools": [tool]}, 1.0, _rippled, {})


#: Made when asked for: theories take their time.
CASES: dict[str, Callable[[], Case]] = {
    "strip that curls": lambda: _curl(0.5),
    "strip held up to -1.9": lambda: _strip(-1.9),
    "strip held up to -1.8": lambda: _strip(-1.8),
    "strip held up to -1.7": lambda: _strip(-1.7),
    "disc held from 0.9": lambda: _disc(0.9),
    "disc held from 0.8": lambda: _disc(0.8),
    "disc whose rim grows": _rim,
}
SHEETS = tuple(CASES)


def _runs(name: str, finest: int) -> Iterator[dict[str, Any]]:
    """Yield all runs of a case, the finest first where there is no theory."""
    case = CASES[name]()
    expected = dict(case.theory)
    if not expected:
        ends = []
        for seed in _SEEDS:
            found, run = measured(case, Settings(finest, choose("fine").tolerance), seed)
            ends.append(found)
            yield {"sheet": name, "quality": "finest", "seed": seed, **run, "measured": found}
        expected = {what: float(np.mean([end[what] for end in ends])) for what in ends[0]}
    for quality in QUALITIES:
        for seed in (0,) if case.theory else _SEEDS:
            found, run = measured(case, choose(quality), seed)
            off = {what: value / expected[what] - 1 for what, value in found.items()}
            yield {"sheet": name, "quality": quality, "seed": seed, **run, "measured": found, "off": off,
                   "expected": expected, "theory": bool(case.theory)}  # fmt: skip


def _cells(own: list[dict[str, Any]]) -> Iterator[tuple[str, ...]]:
    """Yield the rows of a sheet's runs: one for each of what was measured, both seeds in a cell."""
    graded = [run for run in own if "off" in run]
    for what, expected in graded[0]["expected"].items():
        errors = [
            ", ".join(f"{100 * run['off'][what]:+.2g} %" for run in graded if run["quality"] == quality)
            for quality in QUALITIES
        ]
        yield own[0]["sheet"], what, "theory" if graded[0]["theory"] else "finest", *errors, f"{expected:.4g}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="sheets in whose name this word is")
    parser.add_argument("--finest", type=int, default=20_000, help="vertices of what ripples is compared with")
    asked = parser.parse_args()
    kept = load("growth-sheets")["runs"] if asked.only and (RESULTS / "growth-sheets.json").exists() else []
    sheet = Sheet("growth-sheets", ("sheet", "what", "against", *QUALITIES, "expected"), "growth")
    runs: list[dict[str, Any]] = []
    for name in SHEETS:
        own = list(_runs(name, asked.finest)) if asked.only in name else [r for r in kept if r["sheet"] == name]
        runs += own
        for cells in _cells(own) if own else ():
            sheet.add(cells)
    sheet.runs = runs
    sheet.keep()


if __name__ == "__main__":
    with threadpool_limits(1, user_api="blas"):
        main()
