"""How stiff a split plank is before its crack grows: python -m benchmarks.wood.cantilever [RODS:VERTICES ...].

The double cantilever beam of `benchmarks.wood.fracture`, drawn apart a little, unbreakable. Force over opening is held
against corrected beam theory (ISO 15024) and against plane elasticity of one half (scikit-fem, quadratic quads, what is
not split held on the middle), which share no code with the bundle.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from skfem import Basis, BilinearForm, ElementQuad2, ElementVector, MeshQuad, condense, solve
from skfem.helpers import sym_grad

from benchmarks.figures import Sheet

from .fracture import DCB, E_ACROSS, WIDE, E, G, chi, trial

_LITTLE = dataclasses.replace(DCB, way=0.003, last=0.15)
_MESHES = ("24:17", "24:33", "24:65", "48:33", "48:65", "96:33", "96:65")
_HEAD = ("rods", "vertices", "over beam theory", "over plane elasticity", "CPU s")


def beam(crack: float) -> float:
    """Return force over opening [N/m] by beam theory at a crack of this length [m]."""
    return float(3 * E * WIDE * DCB.high**3 / 12 / (2 * (crack + chi() * DCB.high) ** 3))


def plane(crack: float, along: int = 640, up: int = 20) -> float:
    """Return force over opening [N/m] in plane stress without Poisson's effect, as the bundle has none."""
    high, tip = DCB.high, DCB.length - crack
    x = [
        np.linspace(0, tip, int(along * tip / DCB.length)),
        np.linspace(tip, DCB.length, int(along * crack / DCB.length)),
    ]
    x = np.unique(np.concatenate([*x, tip + np.linspace(-high, high, 4 * up + 1)]).round(9))
    basis = Basis(MeshQuad.init_tensor(x, np.linspace(0, high, up + 1)), ElementVector(ElementQuad2()))

    @BilinearForm
    def form(u: Any, v: Any, _: Any) -> Any:
        e, d = sym_grad(u), sym_grad(v)
        return E * e[0, 0] * d[0, 0] + E_ACROSS * e[1, 1] * d[1, 1] + 4 * G * e[0, 1] * d[0, 1]

    stiffness, place = form.assemble(basis), basis.doflocs
    upwards = basis.project(lambda p: np.stack([0 * p[0], 1 + 0 * p[0]])) > 0.5
    jaw = upwards & np.isclose(place[0], DCB.length)
    held = np.isclose(place[0], 0) | jaw | (upwards & np.isclose(place[1], 0) & (place[0] <= tip + 1e-9))
    moved = solve(*condense(stiffness, x=jaw.astype(float), D=np.flatnonzero(held)))
    # each half goes half the way
    return float((stiffness @ moved)[jaw].sum() * WIDE / 2)


def main(meshes: Sequence[str]) -> None:
    """Print a row for each mesh and keep all."""
    sheet = Sheet("wood-cantilever", _HEAD, "wood")
    for word in meshes:
        rods, vertices = map(int, word.split(":"))
        begun = time.process_time()
        run = trial(_LITTLE, rods, vertices, fracture="none")
        cpu = time.process_time() - begun
        # from where it moves evenly on
        late = slice(len(run["way"]) // 2, None)
        found = float((run["force"] / run["way"])[late].mean())
        split = float(run["area"][0]) / WIDE
        ratios = found / beam(split), found / plane(split)
        sheet.add(
            (rods, vertices, *(f"{ratio:.3f}" for ratio in ratios), f"{cpu:.0f}"),
            rods=rods, vertices=vertices, seed=0, split_m=split, stiffness_N_m=found, cpu_s=cpu,
            over_beam=ratios[0], over_plane=ratios[1],
        )  # fmt: skip
    sheet.keep()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="*", default=_MESHES, metavar="RODS:VERTICES", help="default: %(default)s")
    main(parser.parse_args().meshes)
