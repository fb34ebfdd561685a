"""What it costs that parts of a sheet keep apart, and what passes through without: python -m benchmarks.growth.contact
    [--quality preview] [--peer] [NAME ...]

Each case is grown to time 1 with contact = 0 and with the default, CPU seconds, kernels compiled beforehand; what is
hard for contact from five seeds of its noise, as each folds through itself in its own way where nothing holds it: the
means, and the least and the largest ratio. Crossings are counted by code of its own (`crossings`).
--peer: one evaluation of contact where a curled strip touches, by ours and by ipctk (the IPC Toolkit), one thread each;
and what either feels in a flat sheet that is thicker than its edges are long, where nothing touches.
"""

from __future__ import annotations

import argparse
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.figures import Sheet
from benchmarks.growth.crossings import crossings
from solver import registry
from solver.contract import Context, SolverError
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.settings import choose
from solver.growth.settling.energy import vertex_areas
from solver.growth.settling.touching import Touching
from solver.growth.state import State

#: Seeds of what is hard for contact.
_SEEDS = 5

_FOLDER = Path(__file__).parents[2] / "examples" / "growth"


def _strip(axis: tuple[float, float, float], curl: float, **more: Any) -> dict[str, Any]:
    tool = {"kind": "surface", "where": {"kind": "everywhere"}, "frame": axis, "stretch": (1, 1), "curl": (curl, 0)}
    return {"shape": "strip", "aspect": 8.0, "thickness": 0.03, "tools": [tool], **more}


#: What is hard for contact: start shape, tools, vertices.
HARD: dict[str, tuple[dict[str, Any], int]] = {
    "strip that curls up": (_strip((1, 0, 0), 6.0), 540),
    "helical strip": (_strip((1, 0.6, 0), 3.0), 540),
    "rim grown tenfold": (
        {
            "shape": "disc",
            "thickness": 0.02,
            "curved": False,
            "tools": [
                {
                    "kind": "surface",
                    "where": {"kind": "band", "along": "radius", "low": 0.6, "high": 1.0},
                    "stretch": (10.0, 1.0),
                }
            ],
        },
        500,
    ),
}


def grown(values: dict[str, Any], vertices: int, tolerance: float) -> tuple[dict[str, Any], State | None]:
    """Return what a run to time 1 costs and shows, and its state; the error it ends in."""
    engine = Engine(GrowthParams.parse(values), vertices, tolerance, history=False)
    begun, touched = time.process_time(), None
    try:
        while engine.state.time < 1 - 1e-9:
            engine.advance(1e9, until=engine.state.time + engine.params.step)
            if touched is None and engine.distance:
                touched = engine.state.time
        state = engine.reach(1.0, Context())
    except SolverError as error:
        cpu = time.process_time() - begun
        return {"cpu": cpu, "failed": type(error).__name__, "reached": engine.state.time, "touched": touched}, None
    found = {"cpu": time.process_time() - begun, "touched": touched, "iterations": state.iterations}
    found |= {"vertices": len(state.x), "crossings": crossings(state.x, state.mesh.triangles)}
    return found, state


def cost(names: list[str], quality: str) -> None:
    """Tell what the default costs beside contact = 0."""
    settings = choose(quality)  # type: ignore[arg-type]
    cases = {name: (values, vertices) for name, (values, vertices) in HARD.items()}
    for path in sorted(_FOLDER.glob("*.toml")):
        cases[path.stem] = (tomllib.loads(path.read_text(encoding="utf-8")), settings.vertices)
    head = (
        *("case", "vertices", "seeds", "CPU s, contact = 0", "default", "ratio", "of each seed", "touches from t"),
        *("crossings, 0", "default"),
    )
    sheet = Sheet("growth-contact", head, "growth")
    for contact in (0.0, 0.05):  # compile
        grown({**HARD["strip that curls up"][0], "contact": contact}, 100, settings.tolerance)
    for name in names or cases:
        values, vertices = cases[name]
        seeds, each = range(_SEEDS) if name in HARD else (values.get("seed", 0),), []
        for seed in seeds:
            pair = [
                grown({**values, **more, "seed": seed}, vertices, settings.tolerance)[0]
                for more in ({"contact": 0.0}, {})
            ]
            each.append({"seed": seed, "free": pair[0], "kept": pair[1]})
        free, kept = (float(np.mean([found[which]["cpu"] for found in each])) for which in ("free", "kept"))
        ratios = [found["kept"]["cpu"] / found["free"]["cpu"] for found in each]
        spread = f"{min(ratios):.2f} to {max(ratios):.2f}" if len(each) > 1 else ""
        touched = [found["kept"]["touched"] for found in each]
        first = "never" if None in touched else f"{min(touched):.2f}"
        counts = [_counted([found[which] for found in each]) for which in ("free", "kept")]
        cells = (f"{free:.2f}", f"{kept:.2f}", f"{kept / free:.2f}", spread, first, *counts)
        sheet.add(
            (name, str(vertices), str(len(each)), *cells), case=name, start=vertices, ratio=kept / free, each=each
        )
    if not names:
        sheet.keep(quality=quality)


def _counted(runs: list[dict[str, Any]]) -> str:
    """Return how many edges cross in the mean, none, or the errors that runs ended in."""
    failed = sorted({run["failed"] for run in runs if "failed" in run})
    if failed:
        return ", ".join(failed)
    counts = [run["crossings"] for run in runs]
    return f"{np.mean(counts):.0f}" if any(counts) else "none"


def _least(work: Callable[[], Any]) -> float:
    took = []
    for _ in range(5):
        begun = time.process_time()
        work()
        took.append(time.process_time() - begun)
    return min(took)


def _ours(state: State, distance: float, way: np.ndarray) -> tuple[dict[str, float], float]:
    areas, x = vertex_areas(state), state.x
    found = {"search": _least(lambda: Touching(state, distance, 1.0, areas))}
    touching, gradient = Touching(state, distance, 1.0, areas), np.zeros_like(x)
    found["energy and gradient"] = _least(lambda: touching.energy(x, gradient))
    coupled = touching.coupled(x, 24)
    if coupled:
        pattern = coupled[0]
        blocks = np.zeros((len(pattern.indices), 3, 3))
        found["second derivative"] = _least(lambda: touching.add_hessian(x, pattern, blocks))
    found["step"] = _least(lambda: touching.allowed(x, way, 1.0))
    gradient[:] = 0.0
    touching.energy(x, gradient)
    return found, float(np.abs(gradient).max())


def _theirs(state: State, distance: float, way: np.ndarray) -> tuple[dict[str, float], float]:
    import ipctk

    ipctk.set_num_threads(1)
    x = np.asfortranarray(state.x)
    edges = np.asfortranarray(state.mesh.edges, dtype=np.int32)
    mesh = ipctk.CollisionMesh(x, edges, np.asfortranarray(state.mesh.triangles, dtype=np.int32))
    contacts, barrier = ipctk.NormalCollisions(), ipctk.BarrierPotential(distance, 1.0)
    found = {"search": _least(lambda: contacts.build(mesh, x, distance))}
    found["energy and gradient"] = _least(lambda: (barrier(contacts, mesh, x), barrier.gradient(contacts, mesh, x)))
    found["second derivative"] = _least(lambda: barrier.hessian(contacts, mesh, x))
    then = np.asfortranarray(x + way)
    found["step"] = _least(lambda: ipctk.compute_collision_free_stepsize(mesh, x, then))
    return found, float(np.abs(barrier.gradient(contacts, mesh, x)).max())


def peer(tolerance: float) -> None:
    """Tell one evaluation's milliseconds beside ipctk's."""
    values, vertices = HARD["strip that curls up"]
    state = grown(values, 4 * vertices, tolerance)[1]
    assert state is not None
    flat = Engine(GrowthParams.parse({"shape": "disc", "thickness": 0.3, "imperfection": 0}), vertices).state
    rng = np.random.default_rng(0)
    way = 0.2 * state.length * rng.normal(size=state.x.shape)
    parts = ("search", "energy and gradient", "second derivative", "step")
    sheet = Sheet(
        "growth-contact-peer", ("contact by", *(f"{part} [ms]" for part in parts), "force, flat sheet"), "growth"
    )
    for name, by in (("wizen", _ours), ("ipctk", _theirs)):
        by(state, values["thickness"], way)  # compile
        found, _ = by(state, values["thickness"], way)
        felt = by(flat, 0.3, np.zeros_like(flat.x))[1]
        times = [f"{1e3 * found[part]:.2f}" for part in parts]
        sheet.add((name, *times, f"{felt:.1e}"), by=name, vertices=len(state.x), seconds=found, flat=felt)
    sheet.keep(seed=0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quality", default="preview")
    parser.add_argument("--peer", action="store_true", help="beside ipctk, which has to be installed")
    parser.add_argument("names", nargs="*")
    asked = parser.parse_args()
    registry.get("growth")
    with threadpool_limits(1, user_api="blas"):
        if asked.peer:
            peer(choose("preview").tolerance)
        else:
            cost(asked.names, asked.quality)


if __name__ == "__main__":
    main()
