"""The stiffness of contacts with rigid bodies, vertex by vertex, as the implicit scheme factors it."""

from __future__ import annotations

import numpy as np

from .bodies import press
from .stepping import State

__all__ = ["RUBBING", "contacts"]

#: Slip at which friction has its full size [m/s].
RUBBING = 1e-3


def contacts(state: State, dt: float) -> np.ndarray | None:
    """Return the stiffness (v, 3, 3) [N/m]: along the normal, and what friction resists; None without bodies."""
    wood, s = state.wood, state.scratch
    m = wood.motion
    if not len(wood.bodies.kind):
        return None
    out = np.zeros((len(m.x), 3, 3))
    for r in range(len(wood.bodies.kind)):
        one = type(wood.bodies)(*(a[r : r + 1] for a in wood.bodies))
        normal, none = np.zeros_like(m.x), np.zeros((1, len(m.x)))
        smooth = one._replace(friction=np.zeros(1))
        centre, speed = s.centre[r : r + 1], s.speed[r : r + 1]
        books = np.zeros((1, 3)), np.zeros(2), none, none
        press(m.x, m.v, normal, m.mass, m.held, smooth, centre, speed, dt, RUBBING, *books)
        size = np.linalg.norm(normal, axis=1)
        n = normal / np.maximum(size, 1e-300)[:, None]
        along = n[:, :, None] * n[:, None, :]
        slip = m.v - speed[0]
        slip -= n * (slip * n).sum(1)[:, None]
        # between the secant of friction and its slope, which is nothing where it slides
        drag = one.friction[0] * s.lagged[r] / np.maximum(np.linalg.norm(slip, axis=1), RUBBING / 2) / dt
        # at a normal force N the stiffness is sqrt(2 k N / ease), up to k
        k, ease = one.k[0], one.ease[0]
        stiff = np.minimum(k, np.sqrt(2 * k * size / ease)) if ease > 0 else np.full(len(size), k)
        touching = size > 0
        out[touching] += (stiff[:, None, None] * along + drag[:, None, None] * (np.eye(3) - along))[touching]
    return out
