"""Where bodies are: on their ways, or where they have flown. Attitudes are unit quaternions, the real part first."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..model.arrays import Bodies, Poses

__all__ = ["framed", "joined", "pose", "spun", "turning"]


@njit(cache=True, error_model="numpy")
def joined(p: np.ndarray, q: np.ndarray, out: np.ndarray) -> None:
    """Write the turn q (4,) followed by the turn p (4,) to out, which may be either."""
    a = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
    b = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2]
    c = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1]
    d = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]
    out[0], out[1], out[2], out[3] = a, b, c, d


@njit(cache=True, error_model="numpy")
def turning(v0: float, v1: float, v2: float, out: np.ndarray) -> None:
    """Write the turn by a rotation vector [radian] to out (4,)."""
    angle = np.sqrt(v0 * v0 + v1 * v1 + v2 * v2)
    share = np.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    out[0], out[1], out[2], out[3] = np.cos(0.5 * angle), share * v0, share * v1, share * v2


@njit(cache=True, error_model="numpy")
def framed(q: np.ndarray, out: np.ndarray) -> None:
    """Write the turned axes to the columns of out (3, 3)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    out[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    out[0, 1] = 2.0 * (x * y - w * z)
    out[0, 2] = 2.0 * (x * z + w * y)
    out[1, 0] = 2.0 * (x * y + w * z)
    out[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    out[1, 2] = 2.0 * (y * z - w * x)
    out[2, 0] = 2.0 * (x * z - w * y)
    out[2, 1] = 2.0 * (y * z + w * x)
    out[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@njit(cache=True, error_model="numpy")
def spun(bodies: Bodies, r: int, out: np.ndarray) -> float:
    """Write the angular velocity (3,) [radian/s] of a free body to out; return its energy [J]."""
    out[:] = 0.0
    free, flight = bodies.free, bodies.flight
    if (free.guide[r] != 0.0).any():
        return 0.0
    axes = np.empty((3, 3))
    whole = np.empty(4)
    joined(flight.turn[r], free.axes[r], whole)
    framed(whole, axes)
    energy = 0.0
    for k in range(3):
        own = 0.0
        for c in range(3):
            own += axes[c, k] * flight.momentum[r, c]
        energy += 0.5 * own * own / free.inertia[r, k]
        for c in range(3):
            out[c] += axes[c, k] * own / free.inertia[r, k]
    return energy


@njit(cache=True, error_model="numpy")
def _along(
    times: np.ndarray, points: np.ndarray, time: float, pivot: np.ndarray, speed: np.ndarray
) -> tuple[int, float]:
    """Write place and velocity (3,) on a way (w,), (w, 3); return the last waypoint and the time since, -1 at rest."""
    n = len(times)
    last = 0
    while last + 1 < n and times[last + 1] <= time:
        last += 1
    for c in range(3):
        pivot[c] = points[last, c]
        speed[c] = 0.0
    if last + 1 < n and time >= times[last]:
        width = times[last + 1] - times[last]
        if 0.0 < width < np.inf:
            for c in range(3):
                speed[c] = (points[last + 1, c] - points[last, c]) / width
                pivot[c] += speed[c] * (time - times[last])
            return last, time - times[last]
    return last, -1.0


@njit(cache=True, error_model="numpy")
def _turned(bodies: Bodies, r: int, last: int, past: float, poses: Poses) -> None:
    """Write axes and spin of body r so long [s] past a waypoint; less than 0: it rests there."""
    turn, w = np.empty(4), poses.spin[r]
    for c in range(3):
        w[c] = bodies.ways.spins[r, last, c] if past >= 0.0 else 0.0
    past = max(past, 0.0)
    turning(w[0] * past, w[1] * past, w[2] * past, turn)
    joined(turn, bodies.ways.turns[r, last], turn)
    framed(turn, poses.frame[r])


@njit(cache=True, error_model="numpy")
def _flown(bodies: Bodies, r: int, poses: Poses) -> None:
    """Write the place, velocity, axes and spin of body r where it has flown."""
    flight = bodies.flight
    if bodies.turned[r] == 1:
        framed(flight.turn[r], poses.frame[r])
    spun(bodies, r, poses.spin[r])
    w = poses.spin[r]
    a = np.zeros(3)
    for c in range(3):
        for k in range(3):
            a[c] += poses.frame[r, c, k] * (bodies.ways.pivot[r, k] - bodies.free.middle[r, k])
        poses.pivot[r, c] = flight.place[r, c] + a[c]
    poses.speed[r, 0] = flight.v[r, 0] + w[1] * a[2] - w[2] * a[1]
    poses.speed[r, 1] = flight.v[r, 1] + w[2] * a[0] - w[0] * a[2]
    poses.speed[r, 2] = flight.v[r, 2] + w[0] * a[1] - w[1] * a[0]


@njit(cache=True, error_model="numpy")
def pose(bodies: Bodies, time: float, poses: Poses) -> None:
    """Write where bodies are at `time` [s] and how they move; those on ways rest before and after.

    The frames of those that never turn are left as they are: the world's.
    """
    ways = bodies.ways
    for r in range(len(bodies.kind)):
        turns = bodies.turned[r] == 1
        if bodies.free.mass[r] > 0.0:
            _flown(bodies, r, poses)
        else:
            last, past = _along(ways.times[r], ways.points[r], time, poses.pivot[r], poses.speed[r])
            if turns:
                _turned(bodies, r, last, past, poses)
        for c in range(3):
            if not turns:
                poses.centre[r, c] = poses.pivot[r, c] - ways.pivot[r, c]
                poses.box[r, c] = bodies.box[r, c]
                continue
            poses.centre[r, c] = poses.pivot[r, c]
            poses.box[r, c] = 0.0
            for k in range(3):
                poses.centre[r, c] -= poses.frame[r, c, k] * ways.pivot[r, k]
                poses.box[r, c] += abs(poses.frame[r, c, k]) * bodies.box[r, k]
