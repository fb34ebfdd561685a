"""What is meant to break the wood solver, and how each try ends: python -m benchmarks.wood.stress [case ...].

Each case returns what was found; what must not happen ends in `Broken`. A typed error is a good end where one is due.
"""

from __future__ import annotations

import sys
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from benchmarks.tries import Broken, show
from solver.contract import Need, SolverError
from solver.wood import SOLVER

__all__ = ["CASES", "tried"]

_PLAIN: dict[str, Any] = {"fracture": "none", "grain": {"stiffness": 0.0, "strength": 0.0}}
_ROD: dict[str, Any] = {"rods": 1, "radius": 0.002, "vertices": 16, **_PLAIN}
_FEW: dict[str, Any] = {"rods": 9, "vertices": 8}


class Case(NamedTuple):
    """Parameters and how far to run [s]; error: the class that it has to end in, if it must not run."""

    values: dict[str, Any]
    until: float
    error: str = ""


def _box(size: tuple[float, float, float], *way: tuple[float, float, float, float]) -> dict[str, Any]:
    path = [{"time": time, "position": (x, y, z)} for time, x, y, z in way]
    return {"size": size, "path": path}


def _thrown(mass: float, speed: float, spin: float, **shape: Any) -> dict[str, Any]:
    """Return a set-up of few rods at which a body is thrown from above, turned aside."""
    body = {
        "size": (0.02, 0.03, 0.03),
        "mass": mass,
        "velocity": (0.5, 0.2, -speed),
        "spin": (spin, -20.0, 5.0),
        **shape,
    }
    return {**_FEW, "bodies": [{"path": [{"time": 0, "position": (0.05, 0, 0.04), "turn": (0.1, 0.2, 0.3)}], **body}]}


def _press(rods: int, scaling: float) -> dict[str, Any]:
    """Return three blocks about a bundle, pressed within 0.2 s."""
    ends = [_box((0.016, 0.06, 0.01), (0.0, x, 0.0, -0.0151)) for x in (0.02, 0.13)]
    middle = _box((0.016, 0.06, 0.01), (0.0, 0.075, 0.0, 0.0151), (0.2, 0.075, 0.0, 0.009))
    return {
        "rods": rods,
        "vertices": 41,
        "clamp": "none",
        "damping": 50.0,
        "mass_scaling": scaling,
        "bodies": [*ends, middle],
    }


CASES: dict[str, Case] = {
    "rest angle, where Eq. 3.17 is 0/0": Case(_FEW, 1e-4),
    "a bond of which nothing is left to break": Case({**_FEW, "reach": 0.0, "bend": 0.1}, 2e-4),
    "mass breakage at 20 m/s": Case(
        {
            **_FEW,
            "clamp": "both",
            "pull": (20.0, 0, 0),
            "strain_limit": 1e-5,
            "toughness": 0.01,
            "toughness_sliding": 0.01,
        },
        2e-3,
    ),
    "everything breaks in one pass": Case(
        {**_FEW, "bend": 0.2, "strain_limit": 1e-4, "toughness": 0.01, "toughness_sliding": 0.01, "cascade": 1.0}, 1e-3
    ),
    "isolated fragments": Case({**_FEW, "clamp": "none", "bend": 0.1, "reach": 0.0, "strain_limit": 1e-3}, 1e-3),
    "contact of 1e9 N/m": Case(
        {
            **_ROD,
            "gravity": 9.81,
            "clamp": "none",
            "contact_stiffness": 1e9,
            "bodies": [_box((0.3, 0.1, 0.02), (0, 0.075, 0, -0.0101))],
        },
        1e-4,
    ),
    "a body at 100 m/s": Case(
        {**_FEW, "bodies": [_box((0.05, 0.05, 0.05), (0, 0.1, 0, 0.04), (1e-3, 0.1, 0, -0.06))]}, 2e-3
    ),
    "a body of a milligram, at 20 m/s": Case(_thrown(1e-6, 20.0, 3.0), 3e-3),
    "a body of a thousand tons": Case(_thrown(1e6, 20.0, 3.0), 3e-3),
    "a hammer that spins 1600 times a second": Case(_thrown(0.05, 20.0, 1e4), 3e-3),
    "a wedge that is nearly flat, thrown, masses scaled": Case(
        {**_thrown(0.1, 20.0, 3.0, shape="wedge", size=(0, 0.03, 0.03), angle=3.1), "mass_scaling": 100.0}, 3e-3
    ),
    "a bar that turns round a thousand times a second": Case(
        {
            **_FEW,
            "bodies": [
                {
                    "size": (0.2, 0.02, 0.02),
                    "path": [{"time": t, "position": (0.05, 0, 0.03), "turn": (0, 6283 * t, 0)} for t in (0, 3e-3)],
                }
            ],
        },
        3e-3,
    ),
    "a mass on a path": Case(
        {"bodies": [{**_box((0.05, 0.05, 0.05), (0, 0.1, 0, 0.1), (1e-3, 0, 0, 0)), "mass": 1.0}]}, 1e-3, "InvalidInput"
    ),
    "a hammer that begins in the wood": Case(
        {**_FEW, "bodies": [{**_box((0.05, 0.05, 0.05), (0, 0.05, 0, 0.025)), "mass": 1.0}]}, 1e-3, "InvalidGeometry"
    ),
    "edges of 5 micrometres": Case({**_ROD, "length": 2e-3, "radius": 1e-3, "vertices": 400, "unevenness": 0.9}, 2e-8),
    "no rods": Case({"rods": 0}, 1e-3, "InvalidInput"),
    "one rod bent by a third": Case({**_ROD, "bend": 0.3}, 1e-3),
    "two rods": Case({"rods": 2, "vertices": 6, "bend": 0.05}, 1e-3),
    "three vertices": Case({"rods": 9, "vertices": 3, "bend": 0.05}, 1e-3),
    "a bundle of jelly": Case({**_FEW, "stiffness": 1e3, "transverse": 0.0, "shear": 0.0, "gravity": 9.81}, 0.1),
    "an explicit step 1000 times too long": Case({**_FEW, "bend": 0.02, "step": 1e-3}, 1e-3),
    "masses scaled a million times, at 100 m/s": Case(
        {
            **_FEW,
            "mass_scaling": 1e6,
            "bodies": [_box((0.05, 0.05, 0.05), (0, 0.1, 0, 0.04), (1e-3, 0.1, 0, -0.06))],
        },
        2e-3,
    ),
    "loose chips that fall on a body, masses scaled": Case(
        {
            **_FEW,
            "clamp": "none",
            "reach": 0.0,
            "mass_scaling": 2500.0,
            "gravity": 9.81,
            "bodies": [_box((0.4, 0.4, 0.02), (0, 0.05, 0, -0.025))],
        },
        0.3,
    ),
    "pressed until it breaks, masses scaled": Case(_press(9, 1e4), 0.2),
    "pressed, masses scaled a million times": Case(_press(9, 1e6), 0.2),
    "loose rods that part and touch": Case(
        {**_FEW, "clamp": "both", "pull": (5.0, 0, 0), "rod_contact": True, "strain_limit": 2e-3}, 5e-4
    ),
    "rods that part and touch, masses scaled": Case({**_press(9, 1e4), "rod_contact": True, "strain_limit": 2e-3}, 0.2),
}


def tried(name: str) -> str:
    """Run a case; return how it ended.

    Raises:
        Broken: not finite, no error where one is due, or an energy balance that is lost.

    """
    case = CASES[name]
    found, said = None, ""
    try:
        params = SOLVER.parse(case.values)
        found = SOLVER.solve(params, Need(stages=(case.until / 2, case.until), quality="preview"))
    except SolverError as error:
        said = f"{type(error).__name__}: {error}"
        if not error.advice and not case.error:
            raise Broken(f"no advice: {said}") from error
        found = error.partial
    if case.error and not said.startswith(case.error):
        raise Broken(f"no {case.error}")
    if found is None:
        return said
    if not np.isfinite(found.rod_position).all() or not np.isfinite(found.elastic_energy).all():
        raise Broken("not finite")
    if float(found.residual.max()) > 0.5:
        raise Broken("the balance of energy is lost")
    broken = int(found.broken_rods[-1]), int(found.broken_bonds[-1])
    return f"{said} {broken[0]} breaks, {broken[1]} bonds; balance {float(found.residual.max()):.0e}".strip()


if __name__ == "__main__":
    show({name: partial(tried, name) for name in CASES}, sys.argv[1:], "wood")
