"""What a second thread is good for in growth: python -m benchmarks.growth.threads [--vertices 100000]

Seconds by the clock, the least of several: energy and gradient, the factors that a step takes and what reads them, on
one thread and on two, as runs have them: with the same bytes. Then the first four steps of growth, and what share of
them on one thread each part is.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import config
from threadpoolctl import threadpool_limits

from benchmarks.figures import Sheet
from benchmarks.growth.__main__ import CASES
from solver import shell
from solver.arrays import Floats
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.settling.tangent import Tangent
from solver.growth.shapes import start
from solver.linalg.abreast import finished
from solver.linalg.multifrontal import factorise
from solver.shell.inverse import Inverse, fronts_of, inverse_of
from solver.shell.normals import normals

#: Words in the names of files or functions of the parts of a step.
_PARTS = {
    "energy and gradient": ("/shell/membrane", "/shell/bending", "/shell/mean"),
    "factors": ("/linalg/cholesky", "/linalg/multifrontal", "/linalg/abreast"),
    "reading factors": ("/linalg/substitution",),
}


def _least(work: Callable[[], Any], times: int) -> float:
    took = []
    work()
    for _ in range(times):
        begun = time.perf_counter()
        work()
        took.append(time.perf_counter() - begun)
    return min(took)


class Grown:
    """A flat disc that has grown a little, and what steps do with it."""

    def __init__(self, vertices: int) -> None:
        mesh = start("disc", vertices, 1.0)
        self.mesh, self.top, self.material = mesh, shell.topology(mesh.triangles, len(mesh.x)), shell.Material(0.02)
        self.g = 1.02 * shell.metric(mesh.x, mesh.triangles)
        self.x = mesh.x + np.random.default_rng(0).normal(0, 1e-4, mesh.x.shape)
        self.stiffness = shell.hinge_stiffness(self.g, self.top, self.material.flexural)
        self.sheet, self.rest = shell.Halves(self.top), np.zeros(len(self.top.hinges))
        self.tangent, self.fronts = Tangent(self.top), fronts_of(self.top, self.x)
        pattern = self.tangent.pattern
        self.blocks = np.zeros((pattern.blocks, 3, 3))
        lame, places = self.material.lame, pattern.of_triangles
        shell.membrane_tangent(self.x, mesh.triangles, self.g, lame, places, self.blocks)
        shell.bending_tangent(self.x, self.top.hinges, self.stiffness, pattern.of_hinges, self.blocks)
        self.blocks[pattern.diagonal] += 1e-5 * np.eye(3)

    def gradient(self) -> Floats:
        """Return the gradient of stretching and bending."""
        found = np.zeros_like(self.x)
        self.sheet(self.x, self.g, self.material.lame, None, self.rest, self.stiffness, found)
        return found

    def inverse(self) -> Inverse:
        """Return both factors of the approximate inverse, as steps take them."""
        work = inverse_of(
            self.fronts, self.tangent.pattern, self.blocks, normals(self.x, self.mesh.triangles),
            np.zeros(len(self.x), np.bool_),
        )  # fmt: skip
        return finished(work)


def kernels(vertices: int) -> dict[str, tuple[float, float]]:
    """Return seconds on one thread and on two by part."""
    sheet, took = Grown(vertices), {}
    analysis, inverse = sheet.tangent.analysis(sheet.x), sheet.inverse()
    work: dict[str, tuple[Callable[[], Any], int]] = {
        "energy and gradient": (sheet.gradient, 200),
        "factors": (sheet.inverse, 5),
        "reading factors": (lambda: inverse.apply(sheet.x), 50),
        "factor of the whole tangent": (lambda: factorise(analysis, sheet.blocks), 5),
    }
    for name, (what, times) in work.items():
        parts = {}
        for count in (1, 2):
            config.NUMBA_NUM_THREADS = count
            parts[count] = _least(what, times)
        took[name] = parts[1], parts[2]
    return took


def steps(case: str, vertices: int, threads: int) -> tuple[float, dict[str, float]]:
    """Return the seconds of a case's first four steps by the clock, and the share of the processor's in each part."""
    config.NUMBA_NUM_THREADS = threads
    values, tool = CASES[case]
    params = GrowthParams.parse({**values, "tools": [tool], "step": 1.0, "remesh": 1.3})
    Engine(params, 9000).advance(1e9, until=1.0)  # compile
    engine, profile = Engine(params, vertices), cProfile.Profile()
    begun = time.perf_counter()
    profile.enable()
    for step in range(4):
        engine.advance(1e9, until=step + 1.0)
    profile.disable()
    took = time.perf_counter() - begun
    spent = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    return took, {
        part: sum(row[2] for (file, _, _), row in spent.items() if any(word in file for word in words)) / took
        for part, words in _PARTS.items()
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vertices", type=int, default=100_000)
    asked = parser.parse_args()
    head = ("what", "share of four steps of a disc", "one thread [s]", "two threads [s]", "faster")
    sheet = Sheet("growth-threads", head, "growth")
    with threadpool_limits(1, user_api="blas"):
        found = kernels(asked.vertices)
        shares: dict[str, float] = {}
        for case in CASES:
            (one, parts), (both, _) = steps(case, asked.vertices, 1), steps(case, asked.vertices, 2)
            shares = shares or parts
            found[f"four steps, {case}"] = one, both
    for name, (one, both) in found.items():
        share = shares.get(name)
        cells = ("" if share is None else f"{share:.2f}", f"{one:.3g}", f"{both:.3g}")
        sheet.add((name, *cells, f"{one / both:.2f}"), part=name, one=one, two=both, share=share)
    sheet.keep(vertices=asked.vertices)


if __name__ == "__main__":
    main()
