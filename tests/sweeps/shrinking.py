"""A real solver with a closed form: a homogeneous fruit without a stone's hold shrinks freely, u = -s X.

It stands outside the package, as a fifth solver would, and is found through its entry point. Every solve adds a line
to the file `$SHRINKING_LOG`, so that tests can count them.
"""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import ClassVar

import numpy as np
import xarray as xr
from pydantic import Field

from solver.contract import Cancelled, Context, Cost, InvalidInput, Need, NotConverged, Solver, StageAxis, Unstable
from solver.fresh import SURFACE
from solver.fruit import Fruit, azimuths, colatitudes, lattice

__all__ = ["SOLVER"]


class ShrinkingParams(Fruit):
    axes: ClassVar[Mapping[str, tuple[str, int | None]]] = {**Fruit.axes, "gamma": ("modulus_ratio", None)}

    modulus_ratio: float = Field(10.0, ge=1, le=1000, description="of no consequence here")
    pause: float = Field(0.0, ge=0, description="Seconds that a stage takes")
    trouble: str = Field(
        "", description="What goes wrong: diverges, breaks, refuses, crashes, kills, hangs, once, waits"
    )


def _count(word: str) -> int:
    log = os.environ.get("SHRINKING_LOG")
    if log is None:
        return 0
    with Path(log).open("a") as file:
        file.write(word + "\n")
    return Path(log).read_text().splitlines().count(word)


def _run(params: ShrinkingParams, need: Need, context: Context) -> xr.Dataset:
    solve = f"{params.exocarp_thickness:g} {params.modulus_ratio:g} {params.seed}"
    times = _count(solve)
    _trouble(params, need, context, times)
    for i in range(len(need.stages)):
        until = time.monotonic() + params.pause
        while time.monotonic() < until:
            context.check_cancelled()
            time.sleep(0.01)
        context.report((i + 1) / len(need.stages), f"stage {i}")
        if params.trouble == "waits" and i == 0:
            _wait(context)
    return _result(params, need, need.stages)


def _wait(context: Context) -> None:
    """Wait while `$SHRINKING_LOG.hold` names fewer solves than have begun: no test hangs on their seconds."""
    log = os.environ["SHRINKING_LOG"]
    begun, hold = len(Path(log).read_text().splitlines()), Path(f"{log}.hold")
    with suppress(FileNotFoundError):  # it is gone: go on
        while int(hold.read_text()) < begun:
            context.check_cancelled()
            time.sleep(0.01)


def _trouble(params: ShrinkingParams, need: Need, context: Context, times: int) -> None:
    match params.trouble:
        case "diverges":
            first = need.stages[0]
            raise NotConverged(
                "it diverged.", advice="Take care.", partial=_result(params, need, (first,)), last_stage=first
            )
        case "breaks":
            raise Unstable("it blew up.", advice="Ask for less.")
        case "refuses":
            raise InvalidInput("it will not.", advice="Ask for something else.")
        case "crashes":
            raise ZeroDivisionError("a defect")
        case "kills":
            os.kill(os.getpid(), 9)
        case "hangs":
            time.sleep(600)  # one call, like a factorisation: nobody looks up
        case "once" if times == 1:
            raise NotConverged("not at the first try.")
        case "cancels":
            raise Cancelled("nobody asked.")


def _result(params: ShrinkingParams, need: Need, stages: tuple[float, ...]) -> xr.Dataset:
    n = need.resolution
    assert n is not None
    s = np.asarray(stages)
    fresh = params.surface(*lattice(n))
    u = -s[:, None, None, None] * fresh
    grid = ("stage", "colatitude", "azimuth", "component")
    fields = {
        "displacement": (grid, u.astype(need.dtype)),
        "position": (grid, (fresh + u).astype(need.dtype)),
        "mean_radius": ("stage", (1 - s) * (1 + params.exocarp_thickness)),
        "volume": ("stage", 4 / 3 * np.pi * ((1 - s) * (1 + params.exocarp_thickness)) ** 3),
    }
    return xr.Dataset(
        {name: value for name, value in fields.items() if name in need.fields}
        | {
            "converged": ("stage", np.ones(len(s), bool)),
            "residual": ("stage", np.zeros(len(s))),
            "iterations": ("stage", np.arange(len(s))),
            "seconds": ("stage", np.full(len(s), time.perf_counter() % 1)),
        },
        coords={
            "stage": s,
            "colatitude": colatitudes(n),
            "azimuth": azimuths(n),
            "component": ["x", "y", "z"],
        },
    )


SOLVER = Solver(
    name="shrinking",
    version="1",
    title="Free shrinking",
    params=ShrinkingParams,
    fields=("position", "displacement", "mean_radius", "volume"),
    default_fields=("displacement", "mean_radius", "volume"),
    stages=StageAxis("s", "shrinkage", "1", -0.3, 0.6, (0.1, 0.2)),
    default_resolution={"preview": 8, "default": 12, "fine": 16},
    tolerances={"preview": 0.2, "default": 0.1, "fine": 0.05},
    presets={"sphere": {"radii": (1.0,) * 8, "stone": (0.4, 0.4), "exocarp_thickness": 0.04}},
    run=_run,
    cost=lambda params, need: Cost(0.01, 1000),
    surface=SURFACE,
)
