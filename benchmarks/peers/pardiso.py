"""Our multifrontal factor against MKL's Pardiso on the implicit road's tangents: python -m benchmarks.peers.pardiso.

Needs pypardiso and MKL, which wizen does not: any environment's, on PYTHONPATH. Both work with one thread, in turns, in
CPU seconds. Pardiso takes the matrix for positive definite, which ours does not need to be told, and is analysed once.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pypardiso
from scipy import sparse

from benchmarks.figures import Sheet
from solver.dehydration.implicit import build_model, build_quadratic_mesh, graded_layers
from solver.dehydration.params import DehydrationParams
from solver.linalg.multifrontal import factorise

_SIZES, _ROUNDS = (6, 10, 14), 9
#: Solves per factor: a step of Newton's method; a search for a buckling mode, about.
_USES = {"a step of Newton": 1, "a buckling mode": 60}


def measured(size: int) -> dict[str, Any]:
    """Return unknowns, seconds of every round and how far the solutions are apart."""
    fruit = DehydrationParams()
    model = build_model(fruit, build_quadratic_mesh(fruit, size, graded_layers(4, 0.8), "octant"), 1000.0)
    zero = np.zeros((len(model.mesh.connectivity), 8))
    data = model.sweep(model.mesh.positions, model.stretch(0.0), zero).data
    analysis = model.analysis
    whole = sparse.bsr_array((data, analysis.indices, analysis.indptr)).tocsr()
    upper = sparse.csr_matrix(sparse.triu((whole + whole.T) / 2, format="csr"))
    right = np.random.default_rng(0).normal(size=whole.shape[0])
    peer = pypardiso.PyPardisoSolver(mtype=2)

    def phase(number: int) -> Any:
        peer.set_phase(number)
        return peer._call_pardiso(upper, right[:, None]).ravel()

    begin = time.process_time()
    phase(11)
    analysed = time.process_time() - begin
    phase(22)
    ours = factorise(analysis, data)
    works = {
        "ours factor": lambda: factorise(analysis, data),
        "mkl factor": lambda: phase(22),
        "ours solve": lambda: ours.solve(right),
        "mkl solve": lambda: phase(33),
    }
    seconds: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(_ROUNDS):
        for name, work in works.items():
            begin = time.process_time()
            work()
            seconds[name].append(time.process_time() - begin)
    apart = float(np.linalg.norm(phase(33) - ours.solve(right)) / np.linalg.norm(ours.solve(right)))
    return {"unknowns": len(right), "analysis": analysed, "seconds": seconds, "apart": apart}


def main() -> None:
    """Measure all sizes and keep what came of it."""
    head = ["unknowns", "factor, ours [ms]", "MKL [ms]", "solve, ours [ms]", "MKL [ms]", "MKL's analysis [ms]"]
    sheet = Sheet("linalg-peer", [*head, *(f"ours / MKL, {use}" for use in _USES)])
    for size in _SIZES:
        run = measured(size)
        least = {name: 1e3 * min(values) for name, values in run["seconds"].items()}
        ratios = [
            (least["ours factor"] + n * least["ours solve"]) / (least["mkl factor"] + n * least["mkl solve"])
            for n in _USES.values()
        ]
        names = ("ours factor", "mkl factor", "ours solve", "mkl solve")
        cells = [f"{run['unknowns']:,}", *(f"{least[name]:.1f}" for name in names), f"{1e3 * run['analysis']:.0f}"]
        sheet.add([*cells, *(f"{ratio:.2f}" for ratio in ratios)], **run)
    sheet.keep(versions={"pypardiso": pypardiso.__version__})


if __name__ == "__main__":
    main()
