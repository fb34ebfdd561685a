"""How much more a stick bends that is sawn half through: python -m benchmarks.wood.strength.notched [RODS ...].

A cantilever 10 times as long as thick, of the default material, loaded at its end and sawn from above, at rest and
unbreakable. What it bends more than the whole one is held against plane elasticity with a sharp cut (scikit-fem,
quadratic quads that shrink to 10 micrometres at the cut's end), which shares no code with the bundle.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np
from skfem import Basis, BilinearForm, ElementQuad2, ElementVector, FacetBasis, LinearForm, MeshQuad, condense, solve
from skfem.helpers import sym_grad

from benchmarks.figures import Sheet
from solver.contract import Need, Quality
from solver.wood import SOLVER

__all__ = ["bends", "plane"]

#: Length, thickness and width, place of the cut [m]; Young's moduli along and across, shear modulus [Pa].
LENGTH, SIDE, AT = 0.16, 0.016, 0.06
E, E_ACROSS, G = 10e9, 0.5e9, 0.7e9
_STICK: dict[str, Any] = {
    "length": LENGTH,
    "outline": [(-SIDE / 2, -SIDE / 2), (SIDE / 2, -SIDE / 2), (SIDE / 2, SIDE / 2), (-SIDE / 2, SIDE / 2)],
    "vertices": 49,
    "mode": "static",
    "fracture": "none",
    "tip_load": (0, 0, -1),
}
_QUALITIES: tuple[Quality, ...] = ("preview", "default", "fine")
_SEEDS = 3
_HEAD = ("rods", "unevenness", "quality", "bends more [um/N]", "spread of seeds", "over plane elasticity",
         "whole stick [um/N]")  # fmt: skip


def bends(deep: float, rods: int, unevenness: float, quality: Quality, seed: int) -> float:
    """Return the deflection [m/N] at the end of a stick sawn `deep` [m]; 0: a whole one."""
    cuts = [{"low": (AT, -1, SIDE / 2 - deep), "high": (AT, 1, 1)}] if deep else []
    values = {**_STICK, "rods": rods, "unevenness": unevenness, "cuts": cuts, "seed": seed}
    need = Need(stages=(0.0, 1.0), fields=("tip_position",), quality=quality, dtype="float64")
    place = SOLVER.solve(SOLVER.parse(values), need).tip_position.values[:, 2]
    return float(place[0] - place[1])


def _graded(low: float, middle: float, high: float, first: float) -> np.ndarray:
    """Return places from low to high whose distances grow from `first` at the middle."""
    found = [middle]
    for end in (low, high):
        place, step = middle, first
        while abs(end - place) > 1e-12:
            place += np.copysign(min(step, abs(end - place)), end - place)
            found.append(place)
            step = min(1.3 * step, SIDE / 10)
    return np.unique(np.round(found, 10))


def plane(deep: float, first: float = 1e-5) -> float:
    """Return the deflection [m/N] in plane stress without Poisson's effect, as the bundle has none."""
    end = SIDE / 2 - deep
    mesh = MeshQuad.init_tensor(_graded(0, AT, LENGTH, first), _graded(-SIDE / 2, end, SIDE / 2, first))
    p, t = mesh.p, mesh.t.copy()
    # both faces of the cut have vertices of their own
    on = np.flatnonzero(np.isclose(p[0], AT, atol=1e-9) & (p[1] > end + 1e-9))
    other = np.arange(p.shape[1])
    other[on] = p.shape[1] + np.arange(len(on))
    behind = p[0, t].mean(0) > AT
    t[:, behind] = other[t[:, behind]]
    mesh = MeshQuad(np.hstack([p, p[:, on]]), t)
    element = ElementVector(ElementQuad2())
    basis = Basis(mesh, element)

    @BilinearForm
    def form(u: Any, v: Any, _: Any) -> Any:
        e, d = sym_grad(u), sym_grad(v)
        return E * e[0, 0] * d[0, 0] + E_ACROSS * e[1, 1] * d[1, 1] + 4 * G * e[0, 1] * d[0, 1]

    @LinearForm
    def down(v: Any, _: Any) -> Any:
        return -v[1] / SIDE

    load = down.assemble(FacetBasis(mesh, element, facets=mesh.facets_satisfying(lambda x: np.isclose(x[0], LENGTH))))
    held = np.flatnonzero(np.isclose(basis.doflocs[0], 0))
    return float(load @ solve(*condense(form.assemble(basis), load, D=held))) / SIDE


def main(rods: Sequence[int]) -> None:
    """Print a row for each bundle and quality and keep all."""
    sheet = Sheet("wood-notched", _HEAD, "wood")
    deep = SIDE / 2
    wanted = plane(deep) - plane(0.0)
    for count in rods:
        for unevenness in (0.0, 0.3):
            for quality in _QUALITIES:
                whole, sawn = (
                    np.array([bends(d, count, unevenness, quality, seed) for seed in range(_SEEDS)]) for d in (0, deep)
                )
                more = sawn - whole
                sheet.add(
                    (count, unevenness, quality, f"{1e6 * more.mean():.2f}", f"{1e6 * np.ptp(more):.2f}",
                     f"{more.mean() / wanted:.3f}", f"{1e6 * whole.mean():.2f}"),
                    rods=count, unevenness=unevenness, quality=quality, seeds=list(range(_SEEDS)),
                    whole_m_N=whole.tolist(), sawn_m_N=sawn.tolist(), plane_more_m_N=wanted,
                )  # fmt: skip
    sheet.keep()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rods", nargs="*", type=int, default=(24, 48, 96), help="default: %(default)s")
    main(parser.parse_args().rods)
