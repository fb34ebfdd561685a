"""A coarser sheet that shows a fine one the way: some of its vertices, with what strains and bends it between them.

Where a sheet buckles the way is long, and steps of the minimiser cost what the mesh is large. Where the shape is going
shows on a coarser one. So large sheets are settled coarse first, from where they are; what that moves is carried over,
smoothly, and the fine sheet goes on from there. Whether it is a better place to begin, the fine sheet's energy says.
(Nested iteration; Brandt 1977, and Nash 2000, doi 10.1080/10556780008805795, for minima.)

Its rest state is the shape less what strains and bends the fine one there, as tensors in space: so it is in balance
about where the fine sheet is.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

import numpy as np
from numba import njit

from ... import shell
from ...arrays import Floats, Ints
from ...shell.normals import normals
from ..state import State
from ..tooling.holding import loosened
from .cells import Coarser, carried, coarser
from .energy import StepEnergy
from .minimise import longest, quasi_newton
from .tangent import Tangent

__all__ = ["FEWEST", "begun_coarser"]

#: Vertices below which a sheet finds its way as it is, and below which a coarser one has no coarser one of its own.
FEWEST, _LEAST = 8000, 2000
#: Residual of the coarser sheet over the finer one's, and most steps to it: there they cost little, and what it has
#: not come to the finer one has to find.
_FINER, _STEPS = 0.3, 600
#: Forces over the goal up to which a sheet is near its equilibrium, and needs nobody to show it the way.
_NEAR = 10
#: Cosine of the turn of a normal beyond which the inverse is taken anew before the finer sheet goes on.
_TURNED = 0.995


def begun_coarser(energy: StepEnergy, x: Floats, goal: float, fewest: int = FEWEST) -> Generator[None, None, Floats]:
    """Find where to begin from x (n, 3), by a coarser sheet where it shows the way; yields after pieces of work.

    goal: largest force. fewest: vertices of a sheet that asks.
    """
    if len(x) < fewest or longest(energy(x)[1]) <= _NEAR * goal:
        return x
    found = coarser(energy.state.mesh, x)
    yield
    if found is None:
        return x
    there = yield from _shown(energy, x, found, goal)
    triangles = energy.state.mesh.triangles
    turned = (normals(x, triangles) * normals(there, triangles)).sum(axis=1).min() < _TURNED
    if energy.ready and turned:
        yield from energy.refactor(there)
    return there


def _shown(energy: StepEnergy, x: Floats, found: Coarser, goal: float) -> Generator[None, None, Floats]:
    """Find where a coarser sheet leads to from x (n, 3), if that is lower; yields after pieces of work."""
    # what is finer than the coarser sheet is noise at the start of a run, and would count as strain
    x = _lower(energy, x, carried(found, x, x[found.seeds], x[found.seeds]) - x)
    sheet = _sheet(energy, found, x)
    yield
    if sheet is None:
        return x
    coarse = energy.part(sheet, Tangent(sheet.mesh))
    goal *= _FINER * sheet.length / energy.state.length
    y, steps = (yield from begun_coarser(coarse, sheet.x, goal, _LEAST)), 0
    for point in quasi_newton(coarse, y):
        steps += point.x is not y
        y = point.x
        if point.gradient <= goal or point.stuck or steps >= _STEPS or not np.isfinite(point.gradient):
            break
        yield
    return _lower(energy, x, carried(found, x, sheet.x, y - sheet.x))


def _lower(energy: StepEnergy, x: Floats, way: Floats) -> Floats:
    """Return where a way (n, 3) leads to from x (n, 3), or x if that is lower."""
    way = np.where(energy.free, way, 0.0)
    there = x + energy.allowed(x, way, 1.0) * way
    return there if energy(there)[0] < energy(x)[0] else x


def _sheet(energy: StepEnergy, found: Coarser, x: Floats) -> State | None:
    """Return the coarser sheet of a state at x (n, 3); None where its rest state is none."""
    state, mesh = energy.state, found.mesh
    y, triangles = x[found.seeds], state.mesh.triangles
    sizes = shell.areas(state.g)
    now = shell.metric(x, triangles)
    bent = shell.from_angles(shell.angles(x, state.mesh.hinges) - state.rest, state.g, state.mesh)
    strain, bend = (_averaged(x, triangles, forms, sizes, found) for forms in ((now - state.g) / 2, bent))
    own = shell.metric(y, mesh.triangles)
    g = own - 2 * _seen(y, mesh.triangles, strain)
    if not (g[:, 0] * g[:, 2] - g[:, 1] ** 2 > 1e-3 * own[:, 0] * own[:, 2]).all() or not (g[:, [0, 2]] > 0).all():
        return None
    angles = shell.angles(y, mesh.hinges)
    rest = angles - shell.added_angles(_seen(y, mesh.triangles, bend), g, mesh)
    sheet = replace(
        state,
        x=y,
        mesh=mesh,
        g=g,
        rest=rest,
        held=state.held[found.seeds],
        matter={name: values[found.seeds] for name, values in state.matter.items()},
        drift=None, shares={}, spots={}, curves={}, corners={}, faces={},
    )  # fmt: skip
    return loosened(sheet)


def _averaged(x: Floats, triangles: Ints, forms: Floats, sizes: Floats, found: Coarser) -> Floats:
    """Return the means in space (f', 3, 3), by `sizes` (f,), of what triangles at x have as `forms` (f, 3).

    Of those in each coarser triangle; one in which there are none takes what there is about its corners.
    """
    coarse, n = found.mesh.triangles, len(found.seeds)
    total, weight = np.zeros((len(coarse), 3, 3)), np.zeros(len(coarse))
    _average(x, triangles, forms, sizes, found.within, total, weight)
    bare = weight == 0
    if bare.any():
        about, beside = np.zeros((n, 3, 3)), np.bincount(coarse.ravel(), np.repeat(weight, 3), n)
        np.add.at(about, coarse, total[:, None])
        total[bare], weight[bare] = about[coarse[bare]].sum(axis=1), beside[coarse[bare]].sum(axis=1)
    return total / weight[:, None, None]


@njit(cache=True, error_model="numpy")
def _average(
    x: Floats, triangles: Ints, forms: Floats, sizes: Floats, within: Ints, total: Floats, weight: Floats
) -> None:
    dual, here = np.empty((2, 3)), np.empty((3, 3))
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        aa = ab = bb = 0.0
        for d in range(3):
            a, b = x[j, d] - x[i, d], x[k, d] - x[i, d]
            aa += a * a
            ab += a * b
            bb += b * b
        determinant = aa * bb - ab * ab
        if not determinant > 0:
            continue
        for d in range(3):
            a, b = x[j, d] - x[i, d], x[k, d] - x[i, d]
            dual[0, d], dual[1, d] = (bb * a - ab * b) / determinant, (aa * b - ab * a) / determinant
        for d in range(3):
            for h in range(3):
                here[d, h] = (
                    forms[t, 0] * dual[0, d] * dual[0, h]
                    + forms[t, 1] * (dual[0, d] * dual[1, h] + dual[1, d] * dual[0, h])
                    + forms[t, 2] * dual[1, d] * dual[1, h]
                )
        for corner in range(3):
            c = within[triangles[t, corner]]
            weight[c] += sizes[t]
            total[c] += sizes[t] * here


def _seen(y: Floats, triangles: Ints, tensors: Floats) -> Floats:
    """Return what triangles at y (m, 3) have of tensors (f, 3, 3), along their edges (f, 3)."""
    a, b = y[triangles[:, 1]] - y[triangles[:, 0]], y[triangles[:, 2]] - y[triangles[:, 0]]
    along, across = (tensors @ a[:, :, None])[..., 0], (tensors @ b[:, :, None])[..., 0]
    return np.stack([(a * along).sum(-1), (b * along).sum(-1), (b * across).sum(-1)], -1)
