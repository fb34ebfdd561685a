"""Equilibria under loads that grow evenly and have their full size at 1 s."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...contract import Context, NotConverged
from ...linalg.multifrontal import analyse, factorise
from ..forces.hessian import Stiffness
from ..fracture import strained
from ..model.motion import CONTACT, WORK
from ..model.state import State, Wood, copied
from ..params import WoodParams
from .explicit import forces
from .moment import Reached, begin, reached, strength

__all__ = ["equilibrium", "static"]

_TOLERANCE = 1e-6
#: Coupled pairs of vertices in the smallest front.
_LEAF = 800


def equilibrium(state: State, params: WoodParams, factor: float, full: np.ndarray) -> tuple[State, float]:
    """Return the state at rest under `factor` times the loads `full` (v, 3) [N], from one near it, and the residual.

    Raises:
        NotConverged: the way of loads could not be followed; residual and the factor reached say how far it came.

    """
    wood = state.wood
    m = wood.motion
    free = m.held == 0
    stiffness = Stiffness(m.x, wood.rods, wood.bonds, free)
    row = np.repeat(np.arange(stiffness.size), np.diff(stiffness.indptr))
    pairs = np.column_stack([row, stiffness.indices])[row <= stiffness.indices]
    centres = m.x[free][pairs].mean(axis=1)
    # short bundles are cut lengthwise: a third of the work that cuts across the longest side leave
    order = analyse(pairs, centres, stiffness.indptr, stiffness.indices, leaf_size=_LEAF, thin=True)
    done, increment = 0.0, 1.0
    share = np.linalg.norm(full) or 1.0
    begun = float((m.load * full).sum() / share**2)
    least = 1e-9 * strength(wood, params)
    while done < 1:
        goal = min(done + increment, 1.0)
        x = m.x.copy()
        m.load[:] = full * (begun + goal * (factor - begun))
        norm, wanted = np.inf, max(_TOLERANCE * float(np.linalg.norm(m.load)), least)
        for _ in range(30):
            forces(m, wood.rods, wood.turns, wood.bodies, state.scratch, False, 0.0, 1.0, state.books)
            r = state.scratch.f[free].ravel()
            last, norm = norm, float(np.linalg.norm(r))
            if norm <= wanted or not np.isfinite(norm) or norm > 1e6 * max(last, 1e-300):
                break
            blocks = stiffness.blocks(m.x, wood.rods, wood.bonds, 1e-12 * float(wood.rods.k.max() / params.length))
            try:
                step = factorise(order, blocks).solve(r).reshape(-1, 3)
            except np.linalg.LinAlgError:
                norm = np.inf
                break
            # a step that turns edges by more than a radian is not one of Newton's
            m.x[free] += step * min(1.0, float(wood.rods.rest.min()) / max(float(np.abs(step).max()), 1e-300))
        if norm <= wanted:
            done, increment = goal, 2 * increment
            continue
        m.x[:], increment = x, increment / 4
        if increment < 1e-4:
            raise NotConverged(
                f"no equilibrium was found beyond {begun + done * (factor - begun):.3g} times the loads.",
                advice="Apply smaller loads or a greater stiffness, or take the explicit mode, with damping.",
                residual=norm / max(wanted / _TOLERANCE, 1e-300),
            )
    return state, norm / max(float(np.linalg.norm(m.load)), least / _TOLERANCE)


def _unhurt(state: State, params: WoodParams, time: float) -> None:
    """Refuse a state at rest in which something would have crushed.

    Raises:
        NotConverged: see above.

    """
    rods = state.wood.rods
    strain = 1 / (state.scratch.inverse * rods.rest) - rods.free
    over = float(-strain[(rods.alive == 1) & (rods.k > 0)].min(initial=0.0)) / params.crush_strain
    if over > 1:
        raise NotConverged(
            f"at {time:.3g} times the loads a rod is pressed to {over:.2g} times what crushes it, and equilibria crush "
            "nothing.",
            advice="Apply smaller loads, leave compressive_strength out, or let it crush in mode explicit.",
            residual=over - 1,
        )


def _bears(state: State, params: WoodParams, time: float) -> None:
    """Refuse a state at rest in which something would have broken: an equilibrium breaks nothing.

    Raises:
        NotConverged: see above; it says how far the loads are beyond what is borne.

    """
    wood, scratch = state.wood, state.scratch
    rods, _, _ = strained(wood, scratch, params.fracture == "stress")
    b = wood.bonds
    loaded = scratch.each[0] / b.opens + scratch.each[1] / b.slides
    bonds = float(np.sqrt(loaded[b.on == 1].max(initial=0.0)))
    if max(rods, bonds) <= 1:
        return
    what = f"a rod is strained to {rods:.2g} times" if rods >= bonds else f"a bond is loaded to {bonds:.2g} times"
    raise NotConverged(
        f"at {time:.3g} times the loads {what} what it bears, and equilibria break nothing.",
        advice="Apply smaller loads, set fracture none for the unbroken shape, or let it break in mode explicit.",
        residual=max(rods, bonds) - 1,
    )


def static(wood: Wood, params: WoodParams, times: Sequence[float], context: Context) -> Iterator[Reached]:
    """Yield equilibria; loads grow evenly with time and have their full size at 1 s.

    Raises:
        NotConverged: there is none, or something would have broken on the way.
        Cancelled: the observer asked to stop.

    """
    full = wood.motion.load.copy()
    wood.motion.load[:] = 0.0
    wood.motion.v[:] = 0.0
    state, error = begin(wood), 0.0
    start = float(state.books[: CONTACT + 1].sum())
    for wanted in times:
        context.check_cancelled()
        before, load = state.wood.motion.x.copy(), state.wood.motion.load.copy()
        state, error = equilibrium(state, params, wanted, full)
        _unhurt(state, params, wanted)
        if params.fracture != "none":
            _bears(state, params, wanted)
        way = state.wood.motion.x - before
        state.books[WORK] += float(((load + state.wood.motion.load) / 2 * way).sum())
        yield reached(wanted, copied(state._replace(steps=state.steps + 1)), start, error, True)
        state = state._replace(steps=state.steps + 1)
