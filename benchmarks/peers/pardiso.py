"""Our multifrontal factor against MKL's Pardiso, user by user: python -m benchmarks.peers.pardiso.

Needs the extra `mkl`. Both work with one thread, in turns, in CPU seconds. Pardiso is told either that a matrix is
positive definite, or only that it is symmetric (pivots of one and two rows, as ours has them); it analyses a pattern
once, outside of the ratios.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pypardiso
from scipy import sparse

from benchmarks.figures import Sheet
from benchmarks.linalg import shell_matrix, wood_matrix
from solver.dehydration.implicit import build_model, build_quadratic_mesh, graded_layers
from solver.dehydration.implicit.newton import masked
from solver.dehydration.params import DehydrationParams
from solver.growth.settling.tangent import LEAF
from solver.linalg.multifrontal import Analysis, analyse, factorise
from solver.wood.stepping import static

_ROUNDS = 9
#: Pardiso's kinds of symmetric matrices.
_KINDS = {"definite": 2, "indefinite": -2}
#: Solves per factor of a search for a buckling mode, about.
_SEARCH = 60

Made = tuple[Analysis, np.ndarray]


def _implicit(size: int) -> Made:
    fruit = DehydrationParams()
    model = build_model(fruit, build_quadratic_mesh(fruit, size, graded_layers(4, 0.8), "octant"), 1000.0)
    zero = np.zeros((len(model.mesh.connectivity), 8))
    data = model.sweep(model.mesh.positions, model.stretch(0.0), zero).data
    return model.analysis, masked(model.pattern, data, model.free)


def _growth() -> Made:
    mesh, pattern, x, blocks = shell_matrix()
    pairs = np.concatenate([mesh.edges, mesh.hinges[:, 2:]])
    return analyse(pairs, x[pairs].mean(axis=1), pattern.indptr, pattern.indices, leaf_size=LEAF), blocks


def _wood() -> Made:
    x, indptr, indices, pairs, blocks = wood_matrix()
    centres = x[pairs].mean(axis=1)
    return analyse(pairs, centres, indptr, indices, leaf_size=static._LEAF, thin=True), blocks


#: Users, and the kind of matrix that each must count on.
_USERS: dict[str, tuple[Callable[[], Made], str]] = {
    **{f"implicit road, {n} quads a side": (lambda n=n: _implicit(n), "indefinite") for n in (6, 10, 14)},
    "growth settling": (_growth, "definite"),
    "wood at rest": (_wood, "indefinite"),
}


def _peer(upper: sparse.csr_matrix, right: np.ndarray, kind: int) -> Callable[[int], np.ndarray]:
    """Return what runs a phase of Pardiso with the settings of `solver.linalg.pardiso`."""
    peer = pypardiso.PyPardisoSolver(mtype=kind)
    peer.libmkl.MKL_Set_Num_Threads_Local(1)
    for number, value in ({1: 1, 2: 2, 10: 13} if kind > 0 else {1: 1, 2: 2, 10: 8, 21: 1}).items():
        peer.set_iparm(number, value)

    def phase(number: int) -> np.ndarray:
        peer.set_phase(number)
        return peer._call_pardiso(upper, right[:, None]).ravel()

    return phase


def measured(make: Callable[[], Made]) -> dict[str, Any]:
    """Return unknowns, seconds of every round and how far the solutions are apart."""
    analysis, data = make()
    whole = sparse.bsr_array((data, analysis.indices, analysis.indptr)).tocsr()
    upper = sparse.csr_matrix(sparse.triu((whole + whole.T) / 2, format="csr"))
    upper.sort_indices()
    right = np.random.default_rng(0).normal(size=whole.shape[0])
    peers = {name: _peer(upper, right, kind) for name, kind in _KINDS.items()}
    ours = factorise(analysis, data)
    works: dict[str, Callable[[], Any]] = {"ours factor": lambda: factorise(analysis, data)}
    works["ours solve"] = lambda: ours.solve(right)
    analysed = {}
    for name, phase in peers.items():
        begin = time.process_time()
        phase(11)
        analysed[name] = time.process_time() - begin
        works[f"{name} factor"] = lambda phase=phase: phase(22)
        works[f"{name} solve"] = lambda phase=phase: phase(33)
    seconds: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(_ROUNDS):
        for name, work in works.items():
            begin = time.process_time()
            work()
            seconds[name].append(time.process_time() - begin)
    size = np.linalg.norm(ours.solve(right))
    apart = {name: float(np.linalg.norm(phase(33) - ours.solve(right)) / size) for name, phase in peers.items()}
    return {"unknowns": len(right), "analysis": analysed, "seconds": seconds, "apart": apart}


def main() -> None:
    """Measure all users and keep what came of it."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    whose = ("ours", *_KINDS)
    head = ["user", "unknowns", *(f"{name} [ms]" for name in ("ours", "MKL, definite", "MKL, indefinite"))]
    ratios = [f"ours / MKL, {name}" for name in _KINDS]
    sheet = Sheet("linalg-peer", [*head, *ratios, "needs", "ours / MKL, a buckling mode", "MKL's analysis [ms]"])
    for user, (make, needs) in _USERS.items():
        run = measured(make)
        least = {name: 1e3 * min(values) for name, values in run["seconds"].items()}

        def spent(name: str, solves: int, least: dict[str, float] = least) -> float:
            return least[f"{name} factor"] + solves * least[f"{name} solve"]

        cells = [user, f"{run['unknowns']:,}"]
        cells += [f"{least[f'{name} factor']:.1f} + {least[f'{name} solve']:.1f}" for name in whose]
        cells += [f"{spent('ours', 1) / spent(name, 1):.2f}" for name in _KINDS]
        search = f"{spent('ours', _SEARCH) / spent('indefinite', _SEARCH):.2f}"
        sheet.add([*cells, needs, search, f"{1e3 * run['analysis'][needs]:.0f}"], user=user, needs=needs, **run)
    sheet.keep(versions={"pypardiso": pypardiso.__version__})


if __name__ == "__main__":
    main()
