"""Which part of a split plank's compliance is the mesh's: python -m benchmarks.wood.lumping; a second.

Half of the double cantilever beam as a chain of points on an elastic foundation (Timoshenko's beam, E, G and size as in
`benchmarks.wood.fracture`, foundation of half the height), stiffness over that of a fine mesh. Bending is taken at
edges and the foundation at points in both; shear by the slope of each edge, as finite elements do, or at points by the
mean slope of both edges, as bonds do. No code is shared with the bundle. The crack ends between points.
"""

from __future__ import annotations

import argparse

import numpy as np

from benchmarks.figures import Sheet

from .fracture import DCB, E_ACROSS, WIDE, E, G

__all__ = ["stiffness"]

_HEAD = ("edge [mm]", "shear by edges", "shear at points by the mean slope")
_FINE = 1.25e-4


def stiffness(crack: float, edge: float, by_edges: bool) -> float:
    """Return force over way [N/m] of one half, split over `crack` [m], of edges this long [m]."""
    high, n = DCB.high, round(DCB.length / edge) + 1
    area, matrix = WIDE * high, np.zeros((2 * n, 2 * n))

    def add(energy: float, degrees: list[int], parts: list[float]) -> None:
        matrix[np.ix_(degrees, degrees)] += energy * np.outer(parts, parts)

    x = np.arange(n) * edge
    own = np.minimum(x + edge / 2, DCB.length) - np.maximum(x - edge / 2, 0)
    whole = np.clip(np.minimum(x + edge / 2, DCB.length - crack) - np.maximum(x - edge / 2, 0), 0, None)
    for i in range(n):
        add(2 * E_ACROSS * WIDE / high * whole[i], [2 * i], [1])
        if not by_edges:
            a, b = max(i - 1, 0), min(i + 1, n - 1)
            slope = 1 / ((b - a) * edge)
            add(5 / 6 * G * area * own[i], [2 * b, 2 * a, 2 * i + 1], [slope, -slope, -1])
    for i in range(n - 1):
        add(E * area * high**2 / 12 / edge, [2 * i + 1, 2 * i + 3], [-1, 1])
        if by_edges:
            add(5 / 6 * G * area * edge, [2 * i + 2, 2 * i, 2 * i + 1, 2 * i + 3], [1 / edge, -1 / edge, -0.5, -0.5])
    force = np.zeros(2 * n)
    force[2 * n - 2] = 1.0
    return float(1 / np.linalg.solve(matrix, force)[2 * n - 2])


def main() -> None:
    """Print a row for each edge and keep all."""
    sheet = Sheet("wood-lumping", _HEAD, "wood")
    for edge in (0.01, 0.005, 0.0025, 0.00125):
        crack = DCB.length / 2 + edge / 2
        fine = stiffness(crack, _FINE, True)
        ratios = [stiffness(crack, edge, by_edges) / fine for by_edges in (True, False)]
        sheet.add(
            (f"{1e3 * edge:g}", *(f"{r:.3f}" for r in ratios)), edge=edge, by_edges=ratios[0], by_points=ratios[1]
        )
    sheet.keep()


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    main()
