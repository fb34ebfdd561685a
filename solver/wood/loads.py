"""What a test bench would read: mean forces and moments of bodies and grips between stages, and how far they went."""

from __future__ import annotations

from typing import Any

import numpy as np

from .params import Body, WoodParams

__all__ = ["MADE", "READ", "measured"]

#: What each reading is made of, a sum since the start: force and moment are its differences over those of the stages.
SUMS = {
    "body_force": "body_impulse",
    "body_torque": "body_moment",
    "grip_force": "grip_impulse",
    "grip_torque": "grip_moment",
}
#: What readings are made of.
MADE = {**SUMS, "body_shift": "body_place"}
READ = ("body_force", "body_torque", "body_shift", "grip_force", "grip_torque", "grip_shift", "grip_turn")


def _along(paths: list[tuple[list[float], list[Any]]], times: np.ndarray) -> np.ndarray:
    """Return how far (n, m, 3) things on m paths (times, places or rotation vectors) have gone at n times."""
    found = np.zeros((len(times), len(paths), 3))
    for k, (when, where) in enumerate(paths):
        places = np.array(where, float)
        for c in range(3):
            found[:, k, c] = np.interp(times, when, places[:, c]) - places[0, c]
    return found


def _flown(body: Body, r: int, rows: list[dict[str, Any]]) -> tuple[list[float], list[Any]]:
    """Return the path (times, places) of body r; where one with a mass has flown is known at the stages."""
    if body.mass is None:
        return [w.time for w in body.path], [w.position for w in body.path]
    return [0.0, *(row["stage"] for row in rows)], [body.path[0].position, *(row["body_place"][r] for row in rows)]


def measured(name: str, rows: list[dict[str, Any]], params: WoodParams) -> np.ndarray:
    """Return a reading (n, m, 3): means since the stage before, of the first since time 0.

    At time 0 nothing has acted yet, and forces are 0. Shifts and turns are means, too, as the forces and moments that
    belong to them.
    """
    times = np.concatenate([[0.0], [row["stage"] for row in rows]])
    if name in SUMS:
        sums = np.array([row[SUMS[name]] for row in rows])
        change = np.diff(np.concatenate([np.zeros((1, *sums.shape[1:])), sums]), axis=0)
        span = np.diff(times)[:, None, None]
        found: np.ndarray = np.where(span > 0, change / np.where(span > 0, span, 1.0), 0.0)
        return found
    if name == "body_shift":
        paths = [_flown(body, r, rows) for r, body in enumerate(params.bodies)]
    else:
        rest = [(0.0, (0.0, 0.0, 0.0))]
        paths = []
        for grip in params.grips:
            ways = [(p.time, p.shift if name == "grip_shift" else p.turn) for p in grip.path] or rest
            paths.append(([w[0] for w in ways], [w[1] for w in ways]))
    gone = _along(paths, times)
    middle: np.ndarray = (gone[1:] + gone[:-1]) / 2
    return middle
