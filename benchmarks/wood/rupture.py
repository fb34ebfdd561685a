"""Why sticks of spruce break below their modulus of rupture: python -m benchmarks.wood.rupture.

The bench's stick in three-point bending, one change at a time, strain limit that of the published rupture without a law
of size. Besides, the strain of the lowest fibre in plane elasticity (scikit-fem, quadratic quads) over beam theory's: a
load on the whole section keeps it from warping, a load on top does not. No code is shared with the bundle.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from skfem import Basis, BilinearForm, ElementQuad2, ElementVector, MeshQuad, condense, solve
from skfem.helpers import sym_grad

from benchmarks.figures import Sheet

from .bench import PUBLISHED, SPECIES, bending, bent, size_share

__all__ = ["fibre"]

_HEAD = ("stick", "loaded", "seed", "rupture over the published", "rods broken", "bonds broken", "CPU s")
_EVEN: Mapping[str, Any] = {"grain": {"strength": 0.0, "stiffness": 0.0}}
_TOUGH: Mapping[str, Any] = {
    "toughness": 2.5e3, "toughness_sliding": 7e3, "cleavage": 1e8, "shear_strength": 1e8,
}  # fmt: skip
_CASES: tuple[tuple[str, Mapping[str, Any], bool, int], ...] = (
    ("even, bonds ten times as tough", {**_EVEN, **_TOUGH}, False, 1),
    ("even", _EVEN, False, 1),
    ("with grain", {}, False, 1),
    ("even, bonds ten times as tough", {**_EVEN, **_TOUGH}, True, 1),
    ("even", _EVEN, True, 1),
    ("with grain", {}, True, 1),
    ("with grain", {}, True, 2),
    ("with grain", {}, True, 3),
)


def fibre(wood: Mapping[str, Any], on_top: bool, side: float = 0.025, span: float = 0.36) -> float:
    """Return the strain of the lowest fibre below the load over beam theory's, plane stress without Poisson's effect.

    on_top: the load lies on a fifth of the side each way on top; else it holds the whole section.
    """
    stiff, across, shear = wood["stiffness"], wood["transverse"], wood["shear"]
    x = np.concatenate([[0.0], np.geomspace(1e-4, span / 2, 160)])
    basis = Basis(MeshQuad.init_tensor(x, np.linspace(-side / 2, side / 2, 31)), ElementVector(ElementQuad2()))

    @BilinearForm
    def form(u: Any, v: Any, _: Any) -> Any:
        e, d = sym_grad(u), sym_grad(v)
        return stiff * e[0, 0] * d[0, 0] + across * e[1, 1] * d[1, 1] + 4 * shear * e[0, 1] * d[0, 1]

    stiffness, place = form.assemble(basis), basis.doflocs
    upwards = basis.project(lambda p: np.stack([0 * p[0], 1 + 0 * p[0]])) > 0.5
    middle = np.isclose(place[0], 0)
    top = np.isclose(place[1], side / 2) & (place[0] <= side / 5)
    jaw = upwards & (top if on_top else middle)
    held = jaw | (middle & ~upwards) | (np.isclose(place[0], span / 2) & upwards)
    moved = solve(*condense(stiffness, x=-1e-3 * jaw, D=np.flatnonzero(held)))
    force = -2 * float((stiffness @ moved)[jaw].sum())
    low = np.flatnonzero(np.isclose(place[1], -side / 2) & ~upwards)
    low = low[np.argsort(place[0][low])][:3]
    own = float(np.gradient(moved[low], place[0][low])[1])
    return own / (1.5 * force * span / side**2 / stiff)


def main() -> None:
    """Print a row for each case and keep all."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    sheet = Sheet("wood-rupture", _HEAD, "wood")
    wood, published = SPECIES["spruce"], PUBLISHED["spruce"][1]
    limit = wood["strain_limit"] * size_share()
    for name, change, faces, seed in _CASES:
        begun = time.process_time()
        run = bending({**wood, "strain_limit": limit, **change}, seed, faces=faces)
        rupture, cpu = bent(run["way"], run["force"])[1], time.process_time() - begun
        loaded = "on the faces" if faces else "whole sections"
        sheet.add(
            (name, loaded, seed, f"{rupture / published:.3f}", run["rods"], run["bonds"], f"{cpu:.0f}"),
            case=name, loaded=loaded, seed=seed, over_published=rupture / published, cpu_s=cpu,
        )  # fmt: skip
    strains = {name: fibre(wood, on_top) for name, on_top in (("whole section", False), ("on top", True))}
    for name, strain in strains.items():
        print(f"plane elasticity, loaded {name}: lowest fibre {strain:.3f} of beam theory's strain")
    sheet.keep(fibre_over_beam=strains, size_share=size_share())


if __name__ == "__main__":
    main()
