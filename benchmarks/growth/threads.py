"""What a second thread is good for in growth: python -m benchmarks.growth.threads [--vertices 100000]

Seconds by the clock, the least of many, of energy and gradient on a disc that has grown a little: the solver's kernels
on one thread, and the same kernels on two halves of the triangles and of the hinges, each with a gradient of its own,
added up afterwards. Then what a step of growth spends by part, and what it could gain if all that two threads can share
went as much faster: forces, second derivatives, factors and reading them (Amdahl).
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import time
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.figures import Sheet
from benchmarks.growth.__main__ import CASES
from solver import shell
from solver.arrays import Floats, Ints
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.shapes import start
from solver.shell.bending import bending
from solver.shell.membrane import membrane

_TIMES = 200
#: Words in the names of files or functions of what two threads could share.
_PARTS = {
    "forces": ("/shell/membrane", "/shell/bending", "/shell/mean"),
    "second derivatives": ("/shell/hessian", "/shell/pattern"),
    "factors": ("/linalg/cholesky", "/linalg/multifrontal", "/linalg/fronts"),
    "reading factors": ("/linalg/substitution",),
}


@numba.njit(parallel=True)
def _halves(
    x: Floats, triangles: Ints, g: Floats, hinges: Ints, rest: Floats, stiffness: Floats, lame: float, own: Floats
) -> float:
    """Return the energy of both halves and their gradients (2, n, 3) in `own`."""
    energies = np.zeros(2)
    for half in numba.prange(2):
        a, b = half * len(triangles) // 2, (half + 1) * len(triangles) // 2
        energies[half] = membrane(x, triangles[a:b], g[a:b], lame, own[half])
        a, b = half * len(hinges) // 2, (half + 1) * len(hinges) // 2
        energies[half] += bending(x, hinges[a:b], rest[a:b], stiffness[a:b], own[half])
    return float(energies.sum())


@numba.njit(parallel=True)
def _together(own: Floats, gradient: Floats) -> None:
    """Add both gradients up, and leave none."""
    for half in numba.prange(2):
        for i in range(half * len(gradient) // 2, (half + 1) * len(gradient) // 2):
            for d in range(3):
                gradient[i, d] = own[0, i, d] + own[1, i, d]
                own[0, i, d] = own[1, i, d] = 0.0


def _least(work: Callable[[], Any]) -> float:
    took = []
    work()
    for _ in range(_TIMES):
        begun = time.perf_counter()
        work()
        took.append(time.perf_counter() - begun)
    return min(took)


def kernels(vertices: int) -> dict[str, float]:
    """Return seconds of energy and gradient on one thread and on two, and by how much their gradients differ."""
    mesh = start("disc", vertices, 1.0)
    top, material = shell.topology(mesh.triangles, len(mesh.x)), shell.Material(0.02)
    g = 1.02 * shell.metric(mesh.x, mesh.triangles)
    x = mesh.x + np.random.default_rng(0).normal(0, 1e-4, mesh.x.shape)
    stiffness, rest = shell.hinge_stiffness(g, top, material.flexural), np.zeros(len(top.hinges))
    one, two, own = np.zeros_like(x), np.zeros_like(x), np.zeros((2, *x.shape))

    def alone() -> None:
        one[:] = 0.0
        membrane(x, mesh.triangles, g, material.lame, one)
        bending(x, top.hinges, rest, stiffness, one)

    def shared() -> None:
        _halves(x, mesh.triangles, g, top.hinges, rest, stiffness, material.lame, own)
        _together(own, two)

    found = {"one": _least(alone), "two": _least(shared)}
    return found | {"apart": float(np.abs(one - two).max() / np.abs(one).max())}


def shares(vertices: int) -> dict[str, float]:
    """Return the shares of a disc's first four steps, of 3 % growth at its rim, that go into each part."""
    values, tool = CASES["leaf rim 3 %"]
    params = GrowthParams.parse({**values, "tools": [tool], "step": 1.0, "remesh": 1.3})
    Engine(params, 9000).advance(1e9, until=1.0)  # compile
    engine, profile = Engine(params, vertices), cProfile.Profile(time.process_time)
    profile.enable()
    engine.advance(1e9, until=1.0)
    while engine.steps < 4:
        engine.advance(1e9, until=engine.steps + 1.0)
    profile.disable()
    spent = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    whole = sum(row[2] for row in spent.values())
    return {
        part: sum(row[2] for (file, _, _), row in spent.items() if any(word in file for word in words)) / whole
        for part, words in _PARTS.items()
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vertices", type=int, default=100_000)
    asked = parser.parse_args()
    sheet = Sheet("growth-threads", ("part", "share of four steps", "faster on two threads"), "growth")
    numba.set_num_threads(2)
    found = kernels(asked.vertices)
    faster = found["one"] / found["two"]
    with threadpool_limits(1, user_api="blas"):
        parts = shares(asked.vertices)
    for part, share in parts.items():
        cells = (part, f"{share:.2f}", f"{faster:.2f}" if part == "forces" else "not tried")
        sheet.add(cells, part=part, share=share, **(found if part == "forces" else {}))
    shared = sum(parts.values())
    bound = 1 / (1 - shared + shared / faster)
    sheet.add(
        ("a step, if all of them went so", f"{shared:.2f}", f"{bound:.2f}"), part="all", share=shared, bound=bound
    )
    sheet.keep(vertices=asked.vertices)


if __name__ == "__main__":
    main()
