"""Past the onset, by somebody else: an eighth of a sphere in FElupe, from the mesh and the imperfection that ours has.

    python -m benchmarks.dehydration.precision.eighth --peer PYTHON [--quality preview default] [--picture FILE.png]

PYTHON is an interpreter with felupe and pypardiso (benchmarks/peers/felupe_eighth.py: its elements, its Newton's
method, kappa = 1000 mu). Twice: from the fresh shape on its own, and from our settled states, which it moves to its own
equilibria nearby. A thick skin, te = 0.1 and gamma = 10, whose buckles do not touch (record dehydration-eighth).

Record dehydration-newton: what Newton's method takes there, in FElupe and at the least: its iterations times one
factor of our own of a matrix that couples what its tangent does, assembly and line searches left out.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

from benchmarks.figures import ROOT, Sheet
from solver.arrays import Floats, Ints
from solver.contract import Context, Quality
from solver.dehydration import SOLVER, path
from solver.dehydration.kernel import positions
from solver.dehydration.settings import choose
from solver.linalg.multifrontal import analyse, factorise

from .record import answer

_FRUIT = {"te": 0.1, "gamma": 10.0, "mirrors": "xyz"}
_STAGES = (0.05, 0.1, 0.125, 0.15, 0.2)
#: From our order of an element's nodes to VTK's.
_VTK = [0, 4, 6, 2, 1, 5, 7, 3]
_HEAD = (
    *("quality", "who", "s", "roughness [r1]", "range [r1]", "energy [mu r1^3]", "least eigenvalue"),
    *("like ours", "from ours, rms of roughness", "CPU s"),
)


_NEWTON = (
    *("quality", "nodes", "steps", "Newton iterations", "FElupe, CPU", "one factor of ours", "as many", "the march"),
    "at least so many times the march",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peer", required=True, help="a Python that imports felupe")
    parser.add_argument("--quality", nargs="+", default=["preview", "default"])
    parser.add_argument("--picture", type=Path, help="radii of the eighth at the last stage, side by side")
    asked = parser.parse_args()
    sheet = Sheet("dehydration-eighth", _HEAD, "dehydration")
    newton = Sheet("dehydration-newton", _NEWTON, "dehydration")
    for quality in asked.quality:
        shown = _compare(sheet, newton, quality, asked.peer)
    if asked.picture:
        _draw(asked.picture, *shown)
    sheet.keep(fruit=_FRUIT)
    newton.keep(fruit=_FRUIT)


def _compare(sheet: Sheet, newton: Sheet, quality: Quality, peer: str) -> tuple[Floats, dict[str, Floats]]:
    """Add the rows of one quality; return the skin's fresh nodes and everybody's last ones."""
    import tempfile

    params = SOLVER.parse(_FRUIT)
    # compiled outside of the clock
    _ours(path.Path(params, choose(params, quality, _STAGES[-1]), Context()), _STAGES[:1])
    road = path.Path(params, choose(params, quality, _STAGES[-1]), Context())
    mesh = road.motion.sector.mesh
    skin = mesh.surface_nodes
    begin = time.process_time()
    ours, energies = _ours(road)
    cpu = time.process_time() - begin
    _rows(sheet, quality, "wizen", ours[:, skin], ours[:, skin], {"energy": energies}, cpu)
    last = {"wizen": ours[-1, skin]}
    with tempfile.TemporaryDirectory() as folder:
        given, start, out = (Path(folder, f"{name}.npz") for name in ("mesh", "start", "out"))
        fresh = positions(road.motion.layout.fresh)
        np.savez(
            given, points=fresh, cells=mesh.connectivity[:, _VTK], core=~mesh.is_exocarp, fixed=mesh.fixed,
            gamma=params.modulus_ratio,
        )  # fmt: skip
        np.savez(start, nodes=ours)
        script = ROOT / "benchmarks" / "peers" / "felupe_eighth.py"
        command = [peer, str(script), "--mesh", str(given), "--out", str(out), "--stages", ",".join(map(str, _STAGES))]
        for name, more in {"FElupe": [], "FElupe from ours": ["--start", str(start)]}.items():
            told = answer([*command, *more], limit=3600.0)
            if "failed" in told:
                raise SystemExit(f"{name}: {told['failed']}")
            with np.load(out) as found:
                nodes = found["nodes"][:, skin]
            columns = {of: [stage[of] for stage in told["stages"]] for of in ("energy", "least")}
            columns["energy"] = [8 * value for value in columns["energy"]]
            _rows(sheet, quality, f"{name} {told['version']}", nodes, ours[:, skin], columns, told["cpu"])
            if not more:
                least = told["newton"] * (one := _factor_seconds(fresh, mesh.connectivity))
                newton.add(
                    (quality, len(fresh), told["steps"], told["newton"], f"{told['cpu']:.0f} s", f"{one:.2f} s",
                     f"{least:.0f} s", f"{cpu:.1f} s", f"{least / cpu:.0f}"),
                    quality=quality, nodes=len(fresh), steps=told["steps"], newton=told["newton"],
                    peer_cpu=told["cpu"], factor_cpu=one, march_cpu=cpu,
                )  # fmt: skip
            last[name] = nodes[-1]
    return fresh[skin], last


def _factor_seconds(nodes: Floats, elements: Ints) -> float:
    """Return the processor seconds, the least of three, that our factor takes of a matrix that couples the nodes of
    each trilinear element: numbers only, the order of elimination is found before.
    """
    pairs = sparse.coo_array(
        (np.ones(elements.size * 8), (np.repeat(elements, 8, axis=1).ravel(), np.tile(elements, (1, 8)).ravel())),
        shape=(len(nodes), len(nodes)),
    ).tocsr()
    # as many as the neighbours and one on the diagonal, minus one beside it: definite
    rows = np.repeat(np.arange(len(nodes)), np.diff(pairs.indptr))
    scalars = np.where(rows == pairs.indices, np.diff(pairs.indptr)[rows] + 1.0, -1.0)
    order = analyse(elements, nodes[elements].mean(axis=1), pairs.indptr, pairs.indices)
    seconds = []
    for _ in range(3):
        begin = time.process_time()
        factorise(order, scalars[:, None, None] * np.eye(3), definite=True)
        seconds.append(time.process_time() - begin)
    return min(seconds)


def _ours(road: path.Path, stages: Sequence[float] = _STAGES) -> tuple[Floats, list[float]]:
    """Return all nodes (stages, n, 3) of our settled states, and their energies."""
    kept: list[Floats] = []
    settle = path.settle

    def watched(motion: Any, state: Any, *rest: Any, **more: Any) -> path.State:
        found = settle(motion, state, *rest, **more)
        kept.append(positions(state))
        return found

    path.settle = watched  # type: ignore[attr-defined]
    try:
        # a rung below is settled as well: the last one is the stage's
        found = [(road.stage(s, _STAGES[-1]), len(kept)) for s in stages]
    finally:
        path.settle = settle  # type: ignore[attr-defined]
    return np.array([kept[count - 1] for _, count in found]), [state.energy for state, _ in found]


def _rows(
    sheet: Sheet, quality: str, who: str, nodes: Floats, ours: Floats, columns: dict[str, list[float]], cpu: float
) -> None:
    for k, s in enumerate(_STAGES):
        radius, mine = (np.linalg.norm(x[k], axis=1) for x in (nodes, ours))
        rough = float(radius.std())
        like = float(np.corrcoef(radius, mine)[0, 1])
        away = float(np.sqrt(((nodes[k] - ours[k]) ** 2).sum(axis=1).mean()) / mine.std())
        least = columns["least"][k] if "least" in columns else None
        sheet.add(
            (quality, who, f"{s:g}", f"{rough:.4f}", f"{np.ptp(radius):.3f}", f"{columns['energy'][k]:.3f}",
             "" if least is None else f"{least:.2f}", "" if nodes is ours else f"{like:.2f}",
             "" if nodes is ours else f"{away:.2f}", f"{cpu:.0f}" if s == _STAGES[-1] else ""),
            quality=quality, who=who, s=s, roughness=rough, range=float(np.ptp(radius)),
            energy=columns["energy"][k], least=least, like=like, away=away, cpu=cpu,
        )  # fmt: skip


def _draw(file: Path, fresh: Floats, last: dict[str, Floats]) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(last), figsize=(3.2 * len(last), 3.4), layout="constrained")
    rays = fresh / np.linalg.norm(fresh, axis=1)[:, None]
    # seen along the diagonal of the octant
    across = np.array([[1, -1, 0], [-1, -1, 2]]) / np.sqrt([[2], [6]])
    radii = {who: np.linalg.norm(x, axis=1) for who, x in last.items()}
    low, high = min(r.min() for r in radii.values()), max(r.max() for r in radii.values())
    for axis, (who, radius) in zip(np.atleast_1d(axes), radii.items(), strict=True):
        drawn = axis.tricontourf(*(rays @ across.T).T, radius, np.linspace(low, high, 21), cmap="magma")
        axis.set_title(who, fontsize=10)
        axis.set_aspect("equal")
        axis.axis("off")
    figure.colorbar(drawn, ax=axes, label="radius [r1]", shrink=0.8)
    figure.savefig(file, dpi=90)


if __name__ == "__main__":
    main()
