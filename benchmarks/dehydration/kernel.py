"""Time of the explicit kernel per element and step, against the C prototype.

python -m benchmarks.dehydration.kernel

One thread, no contact. All contestants take turns in one run, so that the ratios hold even where the machine is noisy;
times are CPU time, the median over the turns. Beside them: arithmetic and memory traffic per element and step,
counted, and what this machine reaches for each alone, measured.

The C prototype (`reference/expl.c`) is compiled with gcc; without gcc its row is left out.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import shutil
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("NUMBA_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from benchmarks.figures import keep
from solver.dehydration.fresh.mesh import cubed_sphere
from solver.dehydration.kernel import Layout, build_layout, march, new_state, positions
from solver.dehydration.kernel.algebra import CORE_PLANES, EXOCARP_PLANES, ONE_POINT_PLANES
from solver.dehydration.kernel.elements import core_forces, exocarp_forces, one_point_forces
from solver.dehydration.kernel.metric import inverse_jacobians, quadrature
from solver.fem import HEX8

from .machine_limits import machine_limits

CORE_LEVELS = 0.4 + 0.6 * np.array([0, 0.25, 0.45, 0.62, 0.76, 0.87, 0.95, 1])
SKIN_LEVELS = np.array([1.02, 1.04])
THETA, DAMPING, KAPPA, GAMMA = 0.99, 0.02, 30.0, 10.0


def sphere_mesh(n: int) -> dict[str, Any]:
    """Arguments of `build_layout` for a sphere with stone 0.4, te = 0.04, 7 core and 2 exocarp layers."""
    sphere = cubed_sphere(n)
    radii = np.concatenate([CORE_LEVELS, SKIN_LEVELS])
    levels = len(radii)
    base = sphere.quads[:, [0, 3, 1, 2]] * levels
    layer = np.arange(levels - 1)
    skin = np.tile(layer >= len(CORE_LEVELS) - 1, len(base))
    mu = np.where(skin, GAMMA, 1.0)
    return {
        "positions": (sphere.directions[:, None] * radii[:, None]).reshape(-1, 3),
        "connectivity": (base[:, None, :, None] + layer[:, None, None] + np.array([0, 1])).reshape(-1, 8),
        "is_exocarp": skin,
        "mu": mu,
        "kappa": KAPPA * mu,
        "fixed": np.tile(np.arange(levels) == 0, len(sphere.directions)),
    }


class Prototype:
    """The C prototype on the same mesh, masses and moduli."""

    def __init__(self, mesh: dict[str, Any], layout: Layout, folder: Path) -> None:
        library = folder / "expl.so"
        flags = ["-O3", "-march=native", "-ffast-math", "-fopenmp", "-mprefer-vector-width=512", "-shared", "-fPIC"]
        source = Path(__file__).with_name("reference") / "expl.c"
        subprocess.run(["gcc", *flags, str(source), "-o", str(library), "-lm"], check=True, capture_output=True)
        self.run = ctypes.CDLL(str(library)).run
        self.nodes = layout.nodes
        parts = [np.flatnonzero(mesh["is_exocarp"] == kind) for kind in (False, True)]
        parts = [np.concatenate([part, np.repeat(part[-1:], -len(part) % 16)]) for part in parts]
        self.blocks = [len(part) // 16 for part in parts]
        elements = np.concatenate(parts)
        connectivity = mesh["connectivity"][elements]
        self.connectivity = connectivity.reshape(-1, 16, 8).transpose(0, 2, 1).astype(np.int32, order="C")
        self.geometry: list[tuple[np.ndarray, ...]] = []
        for exocarp, part in zip((False, True), parts, strict=True):
            points, weights = quadrature(exocarp)
            inverse, det = inverse_jacobians(mesh["positions"][mesh["connectivity"][part]], points)
            planes = inverse.reshape(-1, 16, len(points), 9).transpose(0, 2, 3, 1).astype(np.float32, order="C")
            volumes = (det * weights).reshape(-1, 16, len(points)).transpose(0, 2, 1).astype(np.float32, order="C")
            slopes = HEX8.gradients(points).transpose(0, 2, 1).astype(np.float32, order="C")
            self.geometry.append((planes, volumes, slopes))
        self.mu = mesh["mu"][elements].astype(np.float32)
        self.kappa = mesh["kappa"][elements].astype(np.float32)
        real = np.concatenate([np.arange(len(part)) < len(np.unique(part)) for part in parts])
        owner = connectivity[real].ravel()
        order = np.argsort(owner, kind="stable")
        self.rows = np.arange(len(elements) * 8).reshape(-1, 8)[real].ravel()[order].astype(np.int32)
        counts = np.bincount(owner, minlength=layout.nodes)
        self.row_start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        self.inverse_mass = layout.inverse_mass
        self.state = np.zeros((layout.nodes, 4), np.float32)
        self.state[:, :3] = mesh["positions"]
        self.velocity = np.zeros_like(self.state)
        self.forces = np.zeros((len(elements) * 8, 4), np.float32)

    def __call__(self, steps: int) -> None:
        """March."""

        def pointer(array: np.ndarray) -> ctypes.c_void_p:
            return array.ctypes.data_as(ctypes.c_void_p)

        single, nothing = ctypes.c_float, ctypes.c_void_p(None)
        (planes_a, volumes_a, slopes_a), (planes_b, volumes_b, slopes_b) = self.geometry
        self.run(
            steps, self.nodes, *self.blocks, pointer(self.connectivity), pointer(self.state), pointer(self.velocity),
            pointer(self.inverse_mass), pointer(planes_a), pointer(volumes_a), 8, pointer(slopes_a),
            pointer(planes_b), pointer(volumes_b), 10, pointer(slopes_b), pointer(self.mu), pointer(self.kappa),
            single(THETA), single(THETA), pointer(self.forces), pointer(self.row_start), pointer(self.rows),
            single(DAMPING), pointer(np.zeros(5)), 0, 0, nothing, nothing, single(0), single(0), nothing, nothing,
            nothing, 0, nothing, 0,
        )  # fmt: skip


class Ours:
    """One back end and core element of the kernel."""

    def __init__(self, layout: Layout, backend: Any, one_point: bool) -> None:
        self.layout, self.options = layout, {"backend": backend, "one_point": one_point}
        self.state, self.velocity = new_state(layout)

    def __call__(self, steps: int) -> None:
        """March."""
        march(self.layout, self.state, self.velocity, steps, theta=(THETA, THETA), damping=DAMPING, **self.options)


class Counter:
    """Abstract number of the element algebra that counts what is done with it."""

    operations = 0

    def _count(self, *_: Any) -> Counter:
        Counter.operations += 1
        return self

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = _count
    minimum = maximum = inverse_cube_root = _count


def operations_of(forces_of: Callable[..., Any]) -> int:
    """Additions, multiplications, divisions and comparisons of one element; 14 for an inverse cube root."""
    Counter.operations = 0
    number = Counter()
    forces_of(number, [[number] * 3] * 8, lambda _: number, number)
    roots = {core_forces: 8, exocarp_forces: 10, one_point_forces: 1}[forces_of]
    return Counter.operations + 13 * roots


def traffic_of(layout: Layout, one_point: bool) -> float:
    """Bytes per element and step that must cross the caches at least once: every array read and written in full."""
    core = layout.one_point_planes if one_point else layout.core_planes
    rows = 4.0 * 3 * layout.face_offsets.size
    read = core.nbytes + layout.exocarp_planes.nbytes + layout.face_offsets.nbytes + layout.rows.nbytes
    read += layout.row_start.nbytes + layout.inverse_mass.nbytes
    state = 16.0 * layout.nodes
    # The state is gathered by the elements, then it and the velocity are read and written by the nodes; a store of a
    # force row fetches its line first.
    return float(read + 3 * rows + 5 * state) / layout.elements


def compare(n: int, steps: int, turns: int) -> dict[str, Any]:
    mesh = sphere_mesh(n)
    start = time.process_time()
    layout = build_layout(**mesh)
    setup = time.process_time() - start
    vector = Ours(layout, "vector", False)
    contestants: dict[str, Ours | Prototype] = {
        "vector": vector,
        "scalar": Ours(layout, "scalar", False),
        "vector, one-point core": Ours(layout, "vector", True),
    }
    with tempfile.TemporaryDirectory() as folder:
        if shutil.which("gcc"):
            contestants["C prototype"] = Prototype(mesh, layout, Path(folder))
        times: dict[str, list[float]] = {name: [] for name in contestants}
        for advance in contestants.values():
            advance(steps)
        for _ in range(turns):
            for name, advance in contestants.items():
                start = time.process_time()
                advance(steps)
                times[name].append((time.process_time() - start) / steps / layout.elements * 1e6)
    if "C prototype" in contestants:
        apart = np.abs(contestants["C prototype"].state[:, :3] - positions(vector.state)).max()
        moved = np.abs(positions(vector.state) - mesh["positions"]).max()
        # Same physics, other rounding: a check that both march the same thing.
        assert apart < 0.02 * moved, (apart, moved)
    reference = times.get("C prototype", times["vector"])
    rows = {}
    for name, values in times.items():
        rows[name] = {
            "us_per_element_step": statistics.median(values),
            "best": min(values),
            "speedup": statistics.median(r / v for r, v in zip(reference, values, strict=True)),
        }
    skin = float(np.mean(mesh["is_exocarp"]))
    work: dict[str, dict[str, float]] = {}
    for name, core, one_point in (("vector", core_forces, False), ("vector, one-point core", one_point_forces, True)):
        work[name] = {
            "flops": (1 - skin) * operations_of(core) + skin * operations_of(exocarp_forces),
            "bytes": traffic_of(layout, one_point),
        }
    limits = machine_limits(layout.nbytes())
    for name, counted in work.items():
        counted["us_of_arithmetic"] = counted["flops"] / limits["gflops"] / 1e3
        counted["us_of_traffic"] = counted["bytes"] / limits["copy_GBps_memory"] / 1e3
        rows[name] |= counted
    return {
        "mesh": {"n": n, "elements": layout.elements, "nodes": layout.nodes, "MB": layout.nbytes() / 1e6},
        "planes": {"core": CORE_PLANES, "one_point": ONE_POINT_PLANES, "exocarp": EXOCARP_PLANES},
        "layout_seconds": setup,
        "rows": rows,
        "limits": limits,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n", type=int, default=24, help="elements per cube edge")
    parser.add_argument("--steps", type=int, default=60, help="steps per turn")
    parser.add_argument("--turns", type=int, default=9)
    options = parser.parse_args()
    result = compare(options.n, options.steps, options.turns)
    mesh = result["mesh"]
    print(f"{mesh['elements']} elements, {mesh['MB']:.0f} MB, layout {result['layout_seconds']:.2f} s")
    print(f"{'':24}{'us':>9}{'best':>9}{'speed-up':>10}{'flops':>8}{'bytes':>8}{'us arith.':>11}{'us traffic':>12}")
    for name, row in result["rows"].items():
        text = f"{name:24}{row['us_per_element_step']:9.4f}{row['best']:9.4f}{row['speedup']:10.2f}"
        if "flops" in row:
            text += f"{row['flops']:8.0f}{row['bytes']:8.0f}{row['us_of_arithmetic']:11.4f}{row['us_of_traffic']:12.4f}"
        print(text)
    print("machine:", ", ".join(f"{name} {value:.0f}" for name, value in result["limits"].items()))
    rows = [{"kernel": name, **row} for name, row in result.pop("rows").items()]
    keep("dehydration-kernel", rows, "dehydration", **result)


if __name__ == "__main__":
    main()
