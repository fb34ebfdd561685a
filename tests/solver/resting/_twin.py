"""The steps of falling bodies in plain numpy, with scipy's rotations: written from the kernel's docstrings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

ROLLING = 1.5


def radius(table: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Bilinear radii of a table (n, 2n) in unit directions (..., 3); beyond the first and last row as there."""
    n = len(table)
    t = np.arccos(np.clip(directions[..., 1], -1, 1)) * n / np.pi - 0.5
    p = np.arctan2(directions[..., 2], directions[..., 0]) * n / np.pi
    i, j = np.floor(t).astype(int), np.floor(p).astype(int)
    rows = np.clip(np.stack([i, i + 1]), 0, n - 1)
    columns = np.stack([j, j + 1]) % (2 * n)
    a, b = np.stack([1 - (t - i), t - i]), np.stack([1 - (p - j), p - j])
    return sum(table[rows[k], columns[m]] * a[k] * b[m] for k in (0, 1) for m in (0, 1))


def distance(table: np.ndarray, scale: float, x: np.ndarray) -> np.ndarray:
    """Signed distance along the radius, positive outside."""
    r = np.linalg.norm(x, axis=-1)
    return r - scale * radius(table, x / r[..., None])


@dataclass
class Bodies:
    """All bodies; turns as quaternions x, y, z, w."""

    at: np.ndarray
    turn: np.ndarray
    speed: np.ndarray
    spin: np.ndarray
    kind: np.ndarray
    scale: np.ndarray
    tables: np.ndarray
    points: np.ndarray
    reach: np.ndarray
    mass: np.ndarray
    inertia: np.ndarray
    bowl: np.ndarray
    friction: float
    contacts: int = 0

    def step(self, h: float, drag: float) -> float:
        """One step; the largest speed before it was limited."""
        was = self.at.copy(), self.turn.copy()
        touching = np.zeros(len(self.at), bool)
        self.speed[:, 1] -= h
        self.speed *= 1 - drag * h
        self.spin *= 1 - drag * h
        self.at += h * self.speed
        for i, spin in enumerate(self.spin):
            self._spin(i, h * spin)
        for i in range(len(self.at)):
            for j in range(i):
                if np.linalg.norm(self.at[i] - self.at[j]) >= self.reach[i] + self.reach[j]:
                    continue
                for a, b in ((i, j), (j, i)):
                    found = self._meet(a, b)
                    if found is not None:
                        touching[[a, b]] = True
                        self._part(a, b, *found, was)
        for i in range(len(self.at)):
            for _ in range(3):
                found = self._ground(i)
                if found is None:
                    break
                touching[i] = True
                self._part(i, None, *found, was)
        self.contacts += int(touching.sum())
        return self._speeds(h, was, touching)

    def _spin(self, i: int, by: np.ndarray) -> None:
        q = self.turn[i]
        x, w = q[:3].copy(), q[3]
        q[:3] += 0.5 * (w * by + np.cross(by, x))
        q[3] -= 0.5 * by @ x
        q /= np.linalg.norm(q)

    def _meet(self, i: int, j: int):
        moved = Rotation.from_quat(self.turn[i]).apply(self.points[self.kind[i]] * self.scale[i]) + self.at[i]
        back = Rotation.from_quat(self.turn[j]).inv()
        local = back.apply(moved - self.at[j])
        table, scale = self.tables[self.kind[j]], self.scale[j]
        depth = -distance(table, scale, local)
        depth[np.linalg.norm(local, axis=1) >= self.reach[j]] = 0
        k = depth.argmax()
        if depth[k] <= 0:
            return None
        x = local[k]
        r = np.linalg.norm(x)
        steps = 0.15 * r * np.eye(3)
        slope = distance(table, scale, x + steps) - distance(table, scale, x - steps)
        slope /= np.linalg.norm(slope) + 1e-12
        return moved[k], back.inv().apply(slope), depth[k] * max(slope @ x / r, 0.2)

    def _ground(self, i: int):
        x = Rotation.from_quat(self.turn[i]).apply(self.points[self.kind[i]]) * self.scale[i] + self.at[i]
        inner, thick, rim = self.bowl
        rows = [(-x[:, 1], np.tile([0.0, 1.0, 0.0], (len(x), 1)))]
        if inner > 0:
            middle = np.array([0, inner + thick, 0])
            away = x - middle
            r = np.linalg.norm(away, axis=1)
            inside = np.linalg.norm(self.at[i] - middle) < inner + 0.5 * thick
            depth = r - inner if inside else inner + thick - r
            rows.append((np.where(x[:, 1] > rim, -1, depth), away / r[:, None] * (-1 if inside else 1)))
        depths = np.stack([depth for depth, _ in rows], axis=1)
        k, which = np.unravel_index(depths.argmax(), depths.shape)
        return (x[k], rows[which][1][k], depths[k, which]) if depths[k, which] > 0 else None

    def _part(self, i: int, j: int | None, point: np.ndarray, normal: np.ndarray, depth: float, was) -> None:
        ends = [(i, 1.0)] if j is None else [(i, 1.0), (j, -1.0)]
        arms = [point - self.at[b] for b, _ in ends]
        slip = np.zeros(3)
        for (b, sign), arm in zip(ends, arms, strict=True):
            local = Rotation.from_quat(self.turn[b]).inv().apply(arm)
            slip += sign * (point - was[0][b] - Rotation.from_quat(was[1][b]).apply(local))
        slip -= normal * (slip @ normal)
        push = depth / self._give(ends, arms, normal)
        self._push(ends, arms, normal, push)
        length = np.linalg.norm(slip)
        if length >= 1e-12:
            along = slip / length
            self._push(ends, arms, along, -min(length / self._give(ends, arms, along), self.friction * push))

    def _give(self, ends, arms, along: np.ndarray) -> float:
        turned = [np.cross(arm, along) for arm in arms]
        return sum(1 / self.mass[b] + t @ t / self.inertia[b] for (b, _), t in zip(ends, turned, strict=True))

    def _push(self, ends, arms, along: np.ndarray, amount: float) -> None:
        for (b, sign), arm in zip(ends, arms, strict=True):
            self.at[b] += sign * amount / self.mass[b] * along
            self._spin(b, sign * amount / self.inertia[b] * np.cross(arm, along))

    def _speeds(self, h: float, was, touching: np.ndarray) -> float:
        self.speed[:] = (self.at - was[0]) / h
        q, p = self.turn, was[1]
        w = (q * p).sum(axis=1)
        between = -q[:, 3:] * p[:, :3] + q[:, :3] * p[:, 3:] - np.cross(q[:, :3], p[:, :3])
        self.spin[:] = 2 / h * np.where(w >= 0, 1, -1)[:, None] * between
        size = np.linalg.norm(self.speed, axis=1)
        self.speed[touching] *= 1 - ROLLING * h
        self.spin[touching] *= 1 - ROLLING * h
        self.speed *= np.where(size > 12, 12 / np.maximum(size, 12), 1)[:, None]
        return float(size.max())
