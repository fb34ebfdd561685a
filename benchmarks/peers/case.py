"""The common case in plain numpy, for scripts in a peer's own environment, where this project is not installed.

One octant of a sphere: stone 0.4 fixed, core to 1 (mu = 1) shrunk by theta in one load step, skin to 1.04 (mu = 10),
kappa = 1000 mu. Hexahedra: three patches of na x na, nc core layers (each 0.8 of its outer neighbour, as our own
implicit solver grades them), ne skin layers.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

STONE, INTERFACE, OUTSIDE = 0.4, 1.0, 1.04
MU_CORE, MU_SKIN, KAPPA_RATIO = 1.0, 10.0, 1000.0
GROWTH = 0.8
#: A residual at which every code's error is that of its mesh.
TOLERANCE = 1e-9


def _at(i: int, j: int, k: int) -> int:
    return i + 3 * j + 9 * k


#: From lexicographic order (first index fastest) to VTK's.
LINEAR = [0, 1, 3, 2, 4, 5, 7, 6]
QUADRATIC = [
    *(_at(i, j, k) for k in (0, 2) for i, j in ((0, 0), (2, 0), (2, 2), (0, 2))),
    *(_at(i, j, k) for k in (0, 2) for i, j in ((1, 0), (2, 1), (1, 2), (0, 1))),
    *(_at(i, j, 1) for i, j in ((0, 0), (2, 0), (2, 2), (0, 2))),
    *(_at(i, j, 1) for i, j in ((0, 1), (2, 1), (1, 0), (1, 2))),
    _at(1, 1, 0), _at(1, 1, 2), _at(1, 1, 1),
]  # fmt: skip


def _patches() -> list[np.ndarray]:
    axes, centre = np.eye(3), np.full(3, 3**-0.5)
    found = []
    for i in range(3):
        sides = [axes[i] + axes[(i + k) % 3] for k in (1, 2)]
        found.append(np.stack([axes[i], sides[0] / 2**0.5, centre, sides[1] / 2**0.5]))
    return found


def _radii(core: int, skin: int, order: int) -> np.ndarray:
    thickness = GROWTH ** np.arange(core)[::-1]
    inner = np.concatenate([[0.0], np.cumsum(thickness) / thickness.sum()])
    breaks = np.concatenate([STONE + (INTERFACE - STONE) * inner, np.linspace(INTERFACE, OUTSIDE, skin + 1)[1:]])
    fine = np.arange(order * (len(breaks) - 1) + 1) / order
    return np.interp(fine, np.arange(len(breaks)), breaks)


def hexahedra(sizes: tuple[int, int, int], order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points (n, 3), cells (e, 8 or 27) in lexicographic order, and whether each cell is core."""
    across, core, skin = sizes
    radii, count = _radii(core, skin, order), across * order
    known: dict[tuple[float, ...], int] = {}
    rays: list[np.ndarray] = []
    quads: list[list[int]] = []
    t = np.linspace(0, 1, count + 1)
    weights = np.stack([(1 - t)[:, None] * (1 - t), t[:, None] * (1 - t), t[:, None] * t, (1 - t)[:, None] * t], -1)
    for corners in _patches():
        grid = weights @ corners
        grid /= np.linalg.norm(grid, axis=-1, keepdims=True)
        number = np.empty(grid.shape[:2], int)
        for at in np.ndindex(*number.shape):
            name = tuple(np.round(grid[at], 9) + 0.0)
            number[at] = known.setdefault(name, len(rays))
            if number[at] == len(rays):
                rays.append(grid[at])
        for i in range(0, count, order):
            for j in range(0, count, order):
                quads.append(number[i : i + order + 1, j : j + order + 1].T.ravel().tolist())
    points = (radii[:, None, None] * np.array(rays)).reshape(-1, 3)
    points[np.abs(points) < 1e-14] = 0.0
    surface = np.array(quads)
    levels = np.arange(order + 1) * len(rays)
    layers = [
        (surface[:, None] + (order * k * len(rays) + levels)[:, None]).reshape(len(surface), -1)
        for k in range(core + skin)
    ]
    return points, np.concatenate(layers), np.repeat(np.arange(core + skin) < core, len(surface))


class Answer:
    """What a script was asked, and how it answers: nodes to a file, figures as one line of JSON."""

    def __init__(self) -> None:
        parser = argparse.ArgumentParser()
        parser.add_argument("--theta", type=float, default=0.95)
        parser.add_argument("--mesh", default="4,4,1", help="na,nc,ne")
        parser.add_argument("--out", type=Path, required=True, help="npz of fresh and deformed nodes")
        parser.add_argument("--program", default="", help="executable, where the peer is one")
        options = parser.parse_args()
        self.theta: float = options.theta
        na, nc, ne = (int(size) for size in options.mesh.split(","))
        self.sizes = na, nc, ne
        self.out: Path = options.out
        self.program: str = options.program

    def start(self) -> None:
        """Start the clocks."""
        self._wall, self._cpu = time.perf_counter(), time.process_time()

    def stop(self) -> None:
        """Stop the clocks."""
        self.wall, self.cpu = time.perf_counter() - self._wall, time.process_time() - self._cpu

    def give(self, fresh: np.ndarray, moved: np.ndarray, **figures: Any) -> None:
        """Hand over nodes (n, 3) and their displacements."""
        np.savez(self.out, fresh=fresh, deformed=fresh + moved)
        print(json.dumps({"cpu": self.cpu, "wall": self.wall, **figures}))
