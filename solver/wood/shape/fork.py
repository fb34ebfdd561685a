"""A fork: above a place some of the stem's rods bend away, upwards, into a branch; the others stay the stem.

So it is in a tree: the fibres of a branch are those of the stem below it, and no fibre runs from the branch into the
stem above (Shigo 1985, Slater and Ennos 2013). Both limbs together have the stem's section (Leonardo's rule). Below,
the limbs are halves of the stem, as a plane across z parts it; above they become round, level by level: what lies
between two levels of the half keeps its area between two levels of the disk (Knothe 1957).

What held the rods of both together ends where they part: so a fork that is pulled apart splits down the stem.
"""

from __future__ import annotations

import numpy as np

from ..params import WoodParams

__all__ = ["forked", "limbs", "parting"]

#: Length of the bend over radius times angle: the sharpest fibre bends with 1.5 over this many radii.
_BEND = 4.0
#: Levels by which halves and disks are held against each other, and places along by which a bend is summed.
_LEVELS, _PLACES = 2001, 2001


def parting(params: WoodParams) -> float:
    """Return the height z [m] of the plane above which lies the branch's share of a round section's area."""
    assert params.fork is not None
    z = np.linspace(-1, 1, _LEVELS)
    above = np.arccos(z) - z * np.sqrt(np.maximum(1 - z * z, 0))
    return float(params.radius * np.interp(-params.fork.share * np.pi, -above, z))


def limbs(points: np.ndarray, params: WoodParams) -> np.ndarray:
    """Return whether rods at points (k, 2) [m] of the section go into the branch (k,)."""
    if params.fork is None:
        return np.zeros(len(points), bool)
    found: np.ndarray = points[:, 1] > parting(params)
    return found


class _Limb:
    """One limb: its half of the section, the disk that it becomes, and which way it bends. Lengths over the radius."""

    def __init__(self, low: float, high: float, angle: float) -> None:
        self._z = np.linspace(low, high, _LEVELS)
        wide = 2 * np.sqrt(np.maximum(1 - self._z**2, 0))
        step = np.diff(self._z)
        area = np.concatenate([[0.0], np.cumsum(step * (wide[1:] + wide[:-1]) / 2)])
        self._wide = wide
        self.centre = float((step * (wide * self._z)[1:]).sum() / area[-1])
        radius = (area[-1] / np.pi) ** 0.5
        turn = np.linspace(0, np.pi, _LEVELS)
        self._disk = np.interp(area / area[-1], (turn - np.sin(turn) * np.cos(turn)) / np.pi, -radius * np.cos(turn))
        self._round = 2 * np.sqrt(np.maximum(radius**2 - self._disk**2, 0))
        self._angle = angle

    def section(self, y: np.ndarray, z: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return where points stand about the limb's centre, so far on the way from the half to the disk."""
        z = np.clip(z, self._z[0], self._z[-1])
        level = np.interp(z, self._z, self._disk)
        wide = np.maximum(np.interp(z, self._z, self._wide), 1e-9)
        across = y * np.interp(z, self._z, self._round) / wide
        return y + share * (across - y), z - self.centre + share * (level - z + self.centre)

    def axis(self, s: np.ndarray, bend: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return x, z and the angle [radian] of the centre line s beyond the fork, bent over the length `bend`."""
        way = np.linspace(0, 1, _PLACES)
        angle = self._angle * way**2 * (3 - 2 * way)
        step = bend / (_PLACES - 1)
        x, z = (np.concatenate([[0.0], np.cumsum((f[1:] + f[:-1]) / 2 * step)]) for f in (np.cos(angle), np.sin(angle)))
        v, over = np.clip(s / bend, 0, 1), np.maximum(s - bend, 0)
        turned = self._angle * v**2 * (3 - 2 * v)
        x, z = np.interp(v, way, x) + over * np.cos(self._angle), np.interp(v, way, z) + over * np.sin(self._angle)
        return x + np.minimum(s, 0), z, turned


def forked(straight: np.ndarray, names: np.ndarray, params: WoodParams) -> np.ndarray:
    """Return points (k, n, 3) [m] of the straight bundle where the fork takes them; names (k, 2) as in `limbs`."""
    fork, r = params.fork, params.radius
    assert fork is not None
    out, branch, plane = straight.copy(), limbs(names, params), parting(params) / r
    for mine, limb in ((branch, _Limb(plane, 1, fork.angle)), (~branch, _Limb(-1, plane, -fork.lean))):
        at = straight[mine]
        # a tapered bundle's limbs taper about their own centres
        scale = 1 + (params.taper - 1) * at[..., 0] / params.length
        s = (at[..., 0] - fork.at) / r
        bend = _BEND * max(fork.angle, fork.lean)
        v = np.clip(s / bend, 0, 1)
        y, z = limb.section(at[..., 1] / (r * scale), at[..., 2] / (r * scale), v * v * (3 - 2 * v))
        x, up, turn = limb.axis(s, bend)
        out[mine] = np.stack(
            [
                fork.at + r * (x - scale * z * np.sin(turn)),
                r * scale * y,
                r * (limb.centre * _centred(scale, s, fork.at, params) + up + scale * z * np.cos(turn)),
            ],
            -1,
        )
    return out


def _centred(scale: np.ndarray, s: np.ndarray, at: float, params: WoodParams) -> np.ndarray:
    """Return what the limb's centre is scaled by: as the stem below the fork, and no more above it."""
    there = 1 + (params.taper - 1) * at / params.length
    return np.where(s < 0, scale, there)
