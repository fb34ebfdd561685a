"""Other ways to predict a shape between samples: python -m benchmarks.peers.surrogates [--held-out STORE].

On the table that comes with wizen, by the same measures as its own methods: POD with radial basis functions, POD with
Kriging (SMT), and a POD-DeepONet, a small network from parameters and stage to the modes' coefficients (Lu et al. 2022,
doi:10.1016/j.cma.2022.114778). Each sample is predicted from the others, or with `--held-out`, a store with runs
between the samples, these from all (record dehydration-surrogates). Needs SMT and scikit-learn (both BSD-3) beside
wizen: pip install smt.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import RBFInterpolator

from benchmarks.figures import Sheet
from solver import registry
from solver.arrays import Array, Floats
from store import starter
from store.blending import methods
from store.lookup import ShapeTable
from store.store import Store
from store.surfaces import measures
from store.surfaces.measures import Measures, Surface, lattice_for
from sweeps.refining import score as scores

#: Share of the displacements' variance that the modes keep.
_KEPT = 0.9999
_HEAD = ("", "s", "roughness", "bands [dB]", "slopes W1 [degree]", "patchiness", "correlation", "training [s]")

#: From points (m, axes), scaled to 0 to 1, and values (m, k), to a function of a point that returns (k,).
Fit = Callable[[Floats, Floats], Callable[[Floats], Floats]]


def rbf(points: Floats, values: Floats) -> Callable[[Floats], Floats]:
    """Thin-plate splines with a linear polynomial."""
    found = RBFInterpolator(points, values, kernel="thin_plate_spline", degree=1)
    return lambda point: np.asarray(found(point[None])[0])


def kriging(points: Floats, values: Floats) -> Callable[[Floats], Floats]:
    """SMT's Kriging of each coefficient, with a constant trend."""
    from smt.surrogate_models import KRG

    models = []
    for column in values.T:
        model = KRG(print_global=False, theta0=[1.0] * points.shape[1], seed=0)
        model.set_training_values(points, column)
        model.train()
        models.append(model)
    return lambda point: np.array([float(model.predict_values(point[None])[0, 0]) for model in models])


def network(points: Floats, values: Floats) -> Callable[[Floats], Floats]:
    """Two hidden layers of 64, by L-BFGS; the mean of three seeds."""
    from sklearn.neural_network import MLPRegressor

    scale = np.maximum(np.abs(values).max(), 1e-12)
    models = [
        MLPRegressor(
            hidden_layer_sizes=(64, 64), activation="tanh", solver="lbfgs", alpha=1e-3, max_iter=400, random_state=seed
        ).fit(points, values / scale)
        for seed in range(3)
    ]
    return lambda point: np.asarray(scale * np.mean([model.predict(point[None])[0] for model in models], axis=0))


class Trained(NamedTuple):
    """A prediction of all stages, and what it took [s of processor]."""

    predict: Callable[[Floats, float], Array]
    seconds: float


def by_stage(fit: Fit) -> Callable[[Floats, Array, tuple[float, ...]], Trained]:
    """Return a surrogate that is fitted at each stage alone."""

    def train(points: Floats, fields: Array, stages: tuple[float, ...]) -> Trained:
        begin, found = time.process_time(), {}
        for j, stage in enumerate(stages):
            mean, modes, values = pod(fields[:, j])
            found[stage] = mean, modes, fit(points, values)
        seconds = time.process_time() - begin

        def predict(point: Floats, stage: float) -> Array:
            mean, modes, at = found[stage]
            return mean + np.tensordot(at(point), modes, 1)

        return Trained(predict, seconds)

    return train


def at_once(fit: Fit) -> Callable[[Floats, Array, tuple[float, ...]], Trained]:
    """Return a surrogate of parameters and stage."""

    def train(points: Floats, fields: Array, stages: tuple[float, ...]) -> Trained:
        begin, last = time.process_time(), max(stages)
        mean, modes, values = pod(fields.reshape(-1, *fields.shape[2:]))
        wider = np.array([[*point, stage / last] for point in points for stage in stages])
        at = fit(wider, values)
        seconds = time.process_time() - begin
        return Trained(lambda point, s: mean + np.tensordot(at(np.array([*point, s / last])), modes, 1), seconds)

    return train


def pod(fields: Array) -> tuple[Array, Array, Floats]:
    """Return mean (...), modes (k, ...) and coefficients (m, k) of fields (m, ...)."""
    mean = fields.mean(axis=0)
    flat = (fields - mean).reshape(len(fields), -1)
    left, size, right = np.linalg.svd(flat, full_matrices=False)
    share = np.cumsum(size**2) / max(float((size**2).sum()), 1e-300)
    k = min(int(np.searchsorted(share, _KEPT)) + 1, len(size))
    return mean, right[:k].reshape(k, *fields.shape[1:]), left[:, :k] * size[:k]


SURROGATES = {
    "POD + RBF": by_stage(rbf),
    "POD + Kriging (SMT)": by_stage(kriging),
    "POD-DeepONet": at_once(network),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--held-out", type=Path, help="a store with runs that the table does not hold")
    held = parser.parse_args().held_out
    store = Store.open(starter.ROOT)
    table = ShapeTable.open(store, surfaces=registry.surface)
    cases, _ = scores.cases(store, table, held)
    sheet = Sheet("dehydration-surrogates", _HEAD, table.info.solver)
    for method, name in ((methods.DEFAULT, f"default, `{methods.DEFAULT}`"), ("idw", "the paper's, `idw`")):
        for stage in table.stages:
            found = [_compared(case, case.found(method, stage), stage) for case in cases]
            _row(sheet, name, stage, measures.mean(found), None)
    points, samples = _scaled(table), [table.sample(i) for i in range(table.size)]
    fields = np.stack([[_stored(table, sample, s) for s in table.stages] for sample in samples])
    low, high = _corners(table)
    for name, train in SURROGATES.items():
        trained = []
        for i, _ in enumerate(cases):
            others = np.arange(len(points)) != (i if held is None else -1)
            trained.append(train(points[others], fields[others], table.stages))
            if held is not None:  # one for all
                trained = trained * len(cases)
                break
        for stage in table.stages:
            found = []
            for i, (case, one) in enumerate(zip(cases, trained, strict=True)):
                point = points[i] if held is None else (_logs(_values(case.label)) - low) / (high - low)
                found.append(_compared(case, one.predict(point, stage), stage))
            _row(sheet, name, stage, measures.mean(found), float(np.mean([one.seconds for one in trained])))
    sheet.keep(cases=[case.label for case in cases], held_out=held is not None, digest=table.digest)


def _compared(case: scores.Case, found: Array, stage: float) -> Measures:
    return measures.compare(Surface(case.fresh, found), Surface(case.fresh, case.truth(stage)))


def _row(sheet: Sheet, name: str, stage: float, m: Measures, seconds: float | None) -> None:
    cells = (f"{m.rgh:.3f}", f"{m.dB:.2f}", f"{m.W1:.2f}", f"{m.patch:.3f}", f"{m.corr:.2f}")
    last = "" if seconds is None else f"{seconds:.2f}"
    sheet.add((name, f"{stage:g}", *cells, last), method=name, s=stage, seconds=seconds, **m._asdict())


def _stored(table: ShapeTable, sample: dict[str, float], stage: float) -> Array:
    n = lattice_for(table.resolution)
    found = table.at(sample, stage, resolution=n, fields=("displacement",), apart=False).displacement
    assert found is not None
    return found.astype(float)


def _logs(values: dict[str, float]) -> Floats:
    return np.log(np.array(list(values.values())))


def _values(label: str) -> dict[str, float]:
    return {name.strip(): float(value) for name, _, value in (part.partition(" = ") for part in label.split(","))}


def _corners(table: ShapeTable) -> tuple[Floats, Floats]:
    logs = np.array([_logs(table.sample(i)) for i in range(table.size)])
    return logs.min(axis=0), logs.max(axis=0)


def _scaled(table: ShapeTable) -> Floats:
    """Return the samples' places (m, axes), in logarithms from 0 to 1."""
    low, high = _corners(table)
    return np.array([(_logs(table.sample(i)) - low) / (high - low) for i in range(table.size)])


if __name__ == "__main__":
    main()
