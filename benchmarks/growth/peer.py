"""Ours against newton's CPU cloth: a disc whose rest lengths grow at once by 1 + 0.3 r^4, from the same noise.

python -m benchmarks.growth.peer PYTHON [vertices]     PYTHON: an interpreter that has newton (benchmarks/peers)

Both are judged by one energy and gradient, ours: energy and largest force over mu l against CPU seconds of one thread.
Newton's membrane is neo-Hookean with the same moduli, which differs beyond small strains, and its hinges have about the
same stiffness: its residual in our energy would not reach 0, its energy would come close.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.figures import Sheet
from solver import shell
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.settling.energy import StepEnergy
from solver.growth.settling.minimise import lbfgs, quasi_newton
from solver.growth.settling.tangent import Tangent

_STEPS = (10, 50, 100, 200)
_THICKNESS = 0.01


def main(python: str, vertices: int) -> None:
    state = Engine(GrowthParams.parse({"shape": "disc", "tools": [], "imperfection": 0}), vertices).state
    flat, triangles = state.x, state.mesh.triangles
    x = flat + np.random.default_rng(0).normal(0, 1e-3, flat.shape) * [0, 0, 1]
    growth = 1 + 0.3 * np.linalg.norm(flat[triangles].mean(axis=1), axis=1) ** 4
    state = replace(state, x=x, g=shell.metric(flat, triangles) * growth[:, None] ** 2)
    # lame = mu in both; newton's hinge has half its stiffness times the rest length, ours k; mu is 1e3 there
    material = shell.Material(_THICKNESS, 1 / 3)
    stiffness = shell.hinge_stiffness(state.g, state.mesh, material.flexural)
    edge_ke = 1e3 * 2 * np.median(stiffness) / state.length

    def tell(name: str, seconds: float, y: np.ndarray) -> None:
        value, gradient = StepEnergy(state, material, 0.0, (), Tangent(state.mesh))(y.astype(float))
        size = float(np.abs(gradient).max()) / state.length
        height = float(np.ptp(y[:, 2]))
        sheet.add(
            (name, f"{seconds:.2f}", f"{value:.6f}", f"{size:.1e}", f"{height:.3f}"),
            way=name, cpu=seconds, energy=float(value), residual=size, height=height,
        )  # fmt: skip

    sheet = Sheet("growth-peer", ("way", "CPU s", "energy", "residual", "height"), "growth")
    tell("start", 0.0, x)
    for name, way in (("quasi-Newton", quasi_newton), ("L-BFGS", lbfgs)):
        for _ in range(2):  # the first compiles
            energy = StepEnergy(state, material, 0.0, (), Tangent(state.mesh))
            begun, marks, ends = time.process_time(), [1e-2, 1e-3], []
            for k, point in enumerate(way(energy, x)):
                while marks and point.gradient <= marks[0] * state.length:
                    ends.append((marks.pop(0), time.process_time() - begun, point.x))
                if not marks or k > 20_000:
                    break
        for goal, seconds, y in ends:
            tell(f"{name}, to {goal:g}", seconds, y)
    with tempfile.TemporaryDirectory() as folder:
        given, out = Path(folder) / "disc.npz", Path(folder) / "out.npz"
        np.savez(given, points=x, triangles=triangles, growth=growth, edge_ke=edge_ke)
        script = Path(__file__).parents[1] / "peers" / "newton_disc.py"
        subprocess.run([python, script, given, out, *map(str, _STEPS)], check=True, stdout=subprocess.DEVNULL)
        found = np.load(out)
        for step, seconds, y in zip(_STEPS, found["seconds"], found["positions"], strict=True):
            tell(f"newton {found['version']}, {step} steps", seconds, y)
    sheet.keep(vertices=len(x))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 2600)
