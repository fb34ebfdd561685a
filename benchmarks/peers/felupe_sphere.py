"""The common case in FElupe: trilinear hexahedra with mean dilatation, Pardiso where it is installed.

Its nearly incompressible body asks for J = 1. Fd = theta I keeps the isochoric energy and moves the volumetric one to
J = theta^3, so the two places where the body compares a volume ratio with 1 are made to compare it with `J0`.
"""

import inspect

import felupe
import numpy as np
from case import KAPPA_RATIO, LINEAR, MU_CORE, MU_SKIN, STONE, TOLERANCE, Answer, hexahedra
from felupe.mechanics import _solidbody_incompressible as original

try:
    from pypardiso import spsolve
except ImportError:
    from scipy.sparse.linalg import spsolve


def shrinkable_body() -> type:
    source = (
        inspect.getsource(original).replace("from ._", "from felupe.mechanics._").replace("from ..", "from felupe.")
    )
    for old, new in (
        ("(v / self.V - 1)", "(v / self.V - self.J0)"),
        ("(self.results.state.J - 1)", "(self.results.state.J - self.J0)"),
    ):
        if old not in source:
            raise SystemExit(f"this FElupe ({felupe.__version__}) has no {old!r}")
        source = source.replace(old, new)
    space = {"__name__": "shrinkable"}
    exec(compile(source, "shrinkable", "exec"), space)
    return space["SolidBodyNearlyIncompressible"]


def main() -> None:
    answer = Answer()
    points, cells, core = hexahedra(answer.sizes, 1)
    cells = cells[:, LINEAR]

    def container(chosen: np.ndarray) -> felupe.FieldContainer:
        mesh = felupe.Mesh(points, chosen, "hexahedron")
        return felupe.FieldContainer([felupe.Field(felupe.RegionHexahedron(mesh), dim=3)])

    field, base = container(cells), shrinkable_body()
    ratio = answer.theta**3
    inner = type("Core", (base,), {"J0": ratio})
    outer = type("Skin", (base,), {"J0": 1.0})
    items = [
        inner(felupe.NeoHooke(mu=MU_CORE * ratio), container(cells[core]), bulk=KAPPA_RATIO * MU_CORE / ratio),
        outer(felupe.NeoHooke(mu=MU_SKIN), container(cells[~core]), bulk=KAPPA_RATIO * MU_SKIN),
    ]
    bounds = {"stone": felupe.Boundary(field[0], mask=np.abs(np.linalg.norm(points, axis=1) - STONE) < 1e-9)}
    for axis, name in enumerate("xyz"):
        skip = tuple(other != axis for other in range(3))
        bounds[name] = felupe.Boundary(field[0], mask=np.abs(points[:, axis]) < 1e-10, skip=skip)
    held, free = felupe.dof.partition(field, bounds)
    answer.start()
    found = felupe.newtonraphson(
        x0=field, items=items, dof0=held, dof1=free, ext0=felupe.dof.apply(field, bounds, held),
        solver=spsolve, tol=TOLERANCE, verbose=0,
    )  # fmt: skip
    answer.stop()
    answer.give(
        points, found.x[0].values, newton=int(found.iterations), unknowns=len(free),
        version=felupe.__version__, element="Q1/P0",
    )  # fmt: skip


if __name__ == "__main__":
    main()
