"""What no equilibrium is, though a minimiser may end there: a sheet that falls for ever, a surface inside out."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from ...contract import NotConverged, Unstable
from ..params import GrowthParams
from ..shapes import Mesh
from ..state import State
from .energy import StepEnergy
from .loads import area_vectors

__all__ = ["check_held", "check_near", "check_outward", "enclosed"]

#: Share of the load beyond which what is left over is no rounding, and standard deviations of what vertices leave over.
_LEFT, _DEVIATIONS = 0.3, 3.0
#: Share of all loads that their sum is wrong by where they cancel: rounding, however they are added up.
_DIGITS = 1e-12
#: Sizes of a shape that it may move by in one step.
_AWAY = 50.0


def enclosed(mesh: Mesh) -> float:
    """Return the volume inside a closed surface; negative where it is inside out."""
    return float(np.vdot(area_vectors(mesh.x, mesh.triangles), mesh.x)) / 3


def check_held(energy: StepEnergy, state: State, goal: float, last: float) -> None:
    """Refuse a shape on which loads pull that nothing takes up; goal: largest force that a vertex may leave over.

    Raises:
        NotConverged: it falls.

    """
    if energy.load is None:
        return
    # along directions in which nothing is held, loads and solids have to balance
    free = ~state.held.any(axis=0)
    left = np.abs(energy(state.x)[1].sum(axis=0)) * free
    pulled = float(np.abs(energy.load.sum(axis=0)).max())
    least = max(_DEVIATIONS * goal * np.sqrt(len(state.x)), _DIGITS * float(np.abs(energy.load).sum()))
    for axis, name in enumerate("xyz"):
        if left[axis] > max(_LEFT * pulled, least):
            raise NotConverged(
                f"nothing holds the sheet along {name}: at growth time {state.time:g} it falls without end.",
                advice="Attach a part of it, or let it lie on a solid that is wide enough.",
                last_stage=last,
                residual=float(left[axis]) / state.length,
            )


def check_near(state: State, x: Floats, last: float) -> None:
    """Refuse to follow a shape that has gone from a state to x (n, 3) without an end in sight.

    Raises:
        NotConverged: it has.

    """
    size = float(np.ptp(state.x, axis=0).max())
    gone = float(np.abs(x.mean(axis=0) - state.x.mean(axis=0)).max())
    if not gone <= _AWAY * size:
        raise NotConverged(
            f"the sheet falls: it has gone {gone / size:.0f} times its size by growth time {state.time:g}.",
            advice="Attach a part of it, or let it lie on a solid that is wide enough.",
            last_stage=last,
        )


def check_outward(state: State, volume: float, last: float, params: GrowthParams) -> None:
    """Refuse a closed surface that has turned inside out; volume: at the start, 0 for an open one.

    Raises:
        Unstable: it has.

    """
    now = enclosed(Mesh(state.x, state.mesh.triangles)) if volume else 0.0
    if now * volume < 0:
        advice = "Less suction, or a thicker sheet" if params.pressure < 0 else "Shorter steps, or slower growth"
        raise Unstable(
            f"the surface has turned inside out by growth time {state.time:g}: it encloses {now:.3g}.",
            advice=f"{advice}; with contact = {params.thickness:g} it cannot pass through itself, and takes its time.",
            last_stage=last,
        )
