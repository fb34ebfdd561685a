"""Draw Fig. 4.2's runs: three seeds of one branch under three blocks, a row each, blocks and all.

python -m examples.wood.splinters OUT.png [--slow] [SEED ...]; writes OUT-SEED.glb, animated, beside it. The press of
`splinter.toml` is fast and explicit; with --slow it is the thesis', in three seconds, on scaled masses (`press.toml`).
"""

from __future__ import annotations

import sys
import time
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np

from service.sequences import EXPORTS, Options, prepared, write
from solver.contract import Need, Quality
from solver.wood import SOLVER, Body, WoodParams
from sweeps.outputs import triangles
from sweeps.pictures.sheet import Panel, sheet

#: File, stages [s], quality.
_FAST: tuple[str, tuple[float, ...], Quality] = ("splinter.toml", (0.015, 0.03, 0.045, 0.06), "preview")
_SLOW: tuple[str, tuple[float, ...], Quality] = ("press.toml", (0.75, 1.5, 2.25, 3.0), "preview")
_SEEDS = (1, 2, 3)
_AROUND = 48
_STEEL = (0.25, 0.28, 0.32)


def _solid(body: Body, when: float) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (v, 3) [m] and triangles (f, 3) of a cylinder along y, as it stands at a time [s]."""
    angle = np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)
    ring = body.size[0] / 2 * np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    half = np.array([0, body.size[1] / 2, 0])
    # the ends have vertices of their own, so that their edges are sharp
    points = np.concatenate([ring - half, ring + half, ring - half, ring + half])
    n = np.arange(_AROUND)
    m = (n + 1) % _AROUND
    side = np.concatenate(
        [np.stack([n, m, n + _AROUND], axis=1), np.stack([m, m + _AROUND, n + _AROUND], axis=1)],
    )
    fan = np.stack([0 * n[1:-1], n[1:-1], m[1:-1]], axis=1)
    faces = np.concatenate([side, fan + 2 * _AROUND, fan[:, ::-1] + 3 * _AROUND])
    times = [w.time for w in body.path]
    at = [np.interp(when, times, [w.position[c] for w in body.path]) for c in range(3)]
    return points + np.array(at), faces


def _with_bodies(panel: Panel, params: WoodParams, view: np.ndarray, when: float) -> Panel:
    """Return the panel with the bodies in it."""
    position, faces, colour = panel.position, panel.triangles, panel.colour
    assert faces is not None
    if colour is None:
        colour = np.broadcast_to((0.4, 0.23, 0.11), position.shape)
    for body in params.bodies:
        points, more = _solid(body, when)
        faces = np.concatenate([faces, more + len(position)])
        position = np.concatenate([position, (points - view[:3]) / view[3]])
        colour = np.concatenate([colour, np.broadcast_to(_STEEL, points.shape)])
    return replace(panel, position=position, triangles=faces, colour=colour)


def main(out: Path, slow: bool, seeds: tuple[int, ...]) -> None:
    """Solve, draw and export."""
    name, stages, quality = _SLOW if slow else _FAST
    values = tomllib.loads(Path(__file__).with_name(name).read_text())
    need = Need(stages=stages, quality=quality, fields=("mesh_position", "inside", "broken_rods", "broken_bonds"))
    rows, labels = [], []
    for seed in seeds:
        params, begun = SOLVER.parse(values | {"seed": seed}), time.process_time()
        assert isinstance(params, WoodParams)
        run = SOLVER.solve(params, need)
        cpu = time.process_time() - begun
        view = np.asarray(run.attrs["view"], float)
        panels = zip(triangles(run), stages, strict=True)
        rows.append([_with_bodies(panel, params, view, when) for panel, when in panels])
        labels.append(f"seed {seed}")
        broken = int(run.broken_rods[-1]), int(run.broken_bonds[-1])
        counts = f"{broken[0]} breaks of {run.attrs['rods']} rods, {broken[1]} of {run.attrs['bonds']} bonds"
        print(f"seed {seed}: {counts}, {cpu:.0f} CPU s", flush=True)
        options = Options()
        out.with_name(f"{out.stem}-{seed}.glb").write_bytes(
            write(prepared(run, options), EXPORTS["animation"], options)
        )
    above = [f"t = {stage:g} s" if slow else f"t = {1000 * stage:g} ms" for stage in stages]
    out.write_bytes(sheet(rows, title="Splinters", row_labels=labels, column_labels=above, pixels=300))


if __name__ == "__main__":
    words = [word for word in sys.argv[2:] if word != "--slow"]
    main(Path(sys.argv[1]), "--slow" in sys.argv, tuple(int(seed) for seed in words) or _SEEDS)
