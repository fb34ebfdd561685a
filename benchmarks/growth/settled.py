"""How far what a run hands over is from rest: python -m benchmarks.growth.settled [--vertices 1000] [NAME ...]

Every file of the gallery is grown to each of the solver's stages. What is handed over is settled once more, nothing
growing: to the same goal, to one a thousand times finer, and by the way on, a step of growth of no length whose forces
may be a millionth of a step's at most. Such a step of a run remeshes first for what grew before it, and so it cannot be
laid on what it came from: here it keeps the mesh. Told are the largest moves of a vertex, over the mean rest edge, at
the worst of the stages, and the largest residual of what was handed over: the largest force over that of an edge that
is stretched or folded by 1.
"""

from __future__ import annotations

import argparse
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.figures import Sheet
from solver.contract import Context, SolverError
from solver.growth import SOLVER
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.settling.active import Habit
from solver.growth.settling.energy import vertex_areas
from solver.growth.settling.stage import residual, settled
from solver.growth.settling.tangent import Tangent
from solver.growth.settling.touching import touches
from solver.growth.state import State
from solver.growth.stepping import Carried, Steps
from solver.linalg.abreast import finished

_FOLDER = Path(__file__).parents[2] / "examples" / "growth"
_GOAL, _FINER, _FINEST = 1e-3, 1e-3, 1e-6


def moved(state: State, params: GrowthParams, distance: float, goal: float) -> float:
    """Return how far the vertices of a state move at most, over the mean rest edge, when it is settled to a goal."""
    found = state
    for nearer in settled(state, params, goal, distance):
        found = nearer
    return float(np.linalg.norm(found.x - state.x, axis=1).max()) / state.length


def stepped(state: State, params: GrowthParams, distance: float) -> float:
    """Return how far the vertices of a state move at most, over the mean rest edge, in a step that grows nothing."""
    still = params.model_copy(update={"remesh": 0.0, "plasticity": 0.0})
    steps = Steps(still, _GOAL * _FINEST, 4000, np.inf, 10**9, 0.0, params.thickness)
    work = steps.step(state, Carried(Tangent(state.mesh), Habit(), distance), params.tools, params.solids, 0.0)
    found, _ = finished(work)
    return float(np.linalg.norm(found.x - state.x, axis=1).max()) / state.length


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vertices", type=int, default=1000)
    parser.add_argument("names", nargs="*")
    asked = parser.parse_args()
    paths = [_FOLDER / f"{name}.toml" for name in asked.names] or sorted(_FOLDER.glob("*.toml"))
    head = ("file", "vertices", "residual", "moves, same goal [edge]", "finer goal [edge]", "a step [edge]")
    sheet = Sheet("growth-settled", head, "growth")
    for path in paths:
        params = GrowthParams.parse(tomllib.loads(path.read_text(encoding="utf-8")))
        engine = Engine(params, asked.vertices, _GOAL, history=False)
        stages: list[dict[str, Any]] = []
        try:
            for time in SOLVER.stages.default:
                state = engine.reach(time, Context())
                # parts may have come near each other only when the stage was settled: the way on has not seen it
                near = touches(state, params.thickness, vertex_areas(state))
                distance = engine.distance or near * params.thickness
                moves = [moved(state, params, distance, goal * _GOAL) for goal in (1.0, _FINER)]
                found = {"residual": residual(state, params), "same": moves[0], "finer": moves[1]}
                stages.append({"time": time, **found, "step": stepped(state, params, distance)})
        except SolverError as error:
            sheet.add((path.stem, "", str(error), "", "", ""), file=path.stem, stages=stages, failed=str(error))
            continue
        worst = [max(stage[name] for stage in stages) for name in ("residual", "same", "finer", "step")]
        cells = path.stem, str(len(state.x)), *(f"{value:.1e}" for value in worst)
        sheet.add(cells, file=path.stem, vertices=len(state.x), start=asked.vertices, stages=stages)
    if not asked.names:
        sheet.keep(finer=_FINER)


if __name__ == "__main__":
    with threadpool_limits(1, user_api="blas"):
        main()
