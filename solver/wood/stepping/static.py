"""Equilibria under loads that grow evenly and have their full size at 1 s."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress

import numpy as np

from ...contract import Context, NotConverged
from ...linalg.multifrontal import Analysis, analyse, factorise
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
#: What is added to a stiffness, over that of stretching the length: so that what hangs loose has one, and where it is
#: to be shown positive, which is more than rounding; and over its largest entry.
_LOOSE, _SOFT, _ROUNDED = 1e-12, 1e-9, 1e-12
#: How far a state may be from its equilibrium, over its length or over how far loads have moved it; and shares of the
#: usual residual that take it there: a load that bends what is slender is next to nothing beside what it bears.
_AWAY, _WAY = 1e-5, 0.01
_FINER = (1e-3, 1e-6, 1e-9)

#: Stiffness of what is free, and the order in which it is factorised.
Pattern = tuple[Stiffness, Analysis]


def equilibrium(
    state: State,
    params: WoodParams,
    factor: float,
    full: np.ndarray,
    pattern: Pattern | None = None,
    finer: float = 1.0,
) -> tuple[State, float]:
    """Return the state at rest under `factor` times the loads `full` (v, 3) [N], from one near it, and the residual.

    pattern: that of the state's wood where it is known. finer: the residual that will do, over the usual one.

    Raises:
        NotConverged: the way of loads could not be followed; residual and the factor reached say how far it came.

    """
    wood = state.wood
    m = wood.motion
    free = m.held == 0
    stiffness, order = pattern or _pattern(wood)
    done, increment = 0.0, 1.0
    share = np.linalg.norm(full) or 1.0
    begun = float((m.load * full).sum() / share**2)
    least = 1e-9 * strength(wood, params)
    while done < 1:
        goal = min(done + increment, 1.0)
        x = m.x.copy()
        m.load[:] = full * (begun + goal * (factor - begun))
        norm, wanted = np.inf, finer * max(_TOLERANCE * float(np.linalg.norm(m.load)), least)
        for _ in range(30):
            forces(m, wood.rods, wood.turns, wood.bodies, state.scratch, False, 0.0, 1.0, state.books)
            r = state.scratch.f[free].ravel()
            last, norm = norm, float(np.linalg.norm(r))
            if norm <= wanted or not np.isfinite(norm) or norm > 1e6 * max(last, 1e-300):
                break
            blocks = stiffness.blocks(m.x, wood.rods, wood.bonds, _LOOSE * float(wood.rods.k.max() / params.length))
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


def _pattern(wood: Wood) -> Pattern:
    """Return the pattern of a wood where it is."""
    x, free = wood.motion.x, wood.motion.held == 0
    stiffness = Stiffness(x, wood.rods, wood.bonds, free)
    row = np.repeat(np.arange(stiffness.size), np.diff(stiffness.indptr))
    pairs = np.column_stack([row, stiffness.indices])[row <= stiffness.indices]
    # short bundles are cut lengthwise: a third of the work that cuts across the longest side leave
    centres = x[free][pairs].mean(axis=1)
    return stiffness, analyse(pairs, centres, stiffness.indptr, stiffness.indices, leaf_size=_LEAF, thin=True)


def _lasts(state: State, params: WoodParams, time: float, error: float, pattern: Pattern) -> float:
    """Return how far [m] a state at rest still is from its equilibrium, by a step of Newton's.

    Dead loads do not stiffen, so that the elastic energy's second derivative tells whether the least push would end it.

    Raises:
        NotConverged: it would: wood buckles before it comes there.

    """
    wood, (stiffness, order) = state.wood, pattern
    m, unit = wood.motion, float(wood.rods.k.max()) / params.length
    blocks = stiffness.blocks(m.x, wood.rods, wood.bonds, _LOOSE * unit)
    # of what is softer in bending than what would be added nothing could be told
    slender = 0.75 * (params.wide / params.length) ** 2 < 10 * _SOFT
    for more in (0.0,) if slender else (0.0, max(_SOFT * unit, _ROUNDED * float(np.abs(blocks).max()))):
        blocks[stiffness.diagonal] += more * np.eye(3)
        with suppress(np.linalg.LinAlgError):
            left = factorise(order, blocks, definite=True).solve(state.scratch.f[m.held == 0].ravel())
            return float(np.abs(left).max(initial=0.0))
    raise NotConverged(
        f"at {time:.3g} times the loads the wood has buckled: what balances them would not last"
        f"{', or it is so slender that rounding hides whether it would' if slender else ''}.",
        advice=f"Apply smaller loads or a greater stiffness{', make it shorter or thicker' if slender else ''}, or let "
        "it give way in mode explicit, with damping.",
        residual=error,
    )


def _found(state: State, params: WoodParams, time: float, full: np.ndarray, rest: np.ndarray) -> tuple[State, float]:
    """Return the state at rest at a time and its residual, no farther from it than tells; rest (v, 3) [m]: unloaded.

    Raises:
        NotConverged: there is none, or none that lasts.

    """
    pattern = _pattern(state.wood)
    state, error = equilibrium(state, params, time, full, pattern)
    finer = iter(_FINER)
    while True:
        away = _lasts(state, params, time, error, pattern)
        if away <= max(_AWAY * params.length, _WAY * float(np.abs(state.wood.motion.x - rest).max())):
            return state, error
        try:
            state, error = equilibrium(state, params, time, full, pattern, next(finer))
        except (NotConverged, StopIteration):
            raise NotConverged(
                f"at {time:.3g} times the loads the wood is still {away:.2g} m from its equilibrium: it is so slender "
                "that they are next to nothing beside what it bears.",
                advice="Make it shorter or thicker, or take the explicit mode, with damping.",
                residual=error,
            ) from None


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
        NotConverged: there is none, or none that lasts, or something would have broken on the way.
        Cancelled: the observer asked to stop.

    """
    full = wood.motion.load.copy()
    wood.motion.load[:] = 0.0
    wood.motion.v[:] = 0.0
    state, rest = begin(wood), wood.motion.x.copy()
    start = float(state.books[: CONTACT + 1].sum())
    for wanted in times:
        context.check_cancelled()
        before, load = state.wood.motion.x.copy(), state.wood.motion.load.copy()
        state, error = _found(state, params, wanted, full, rest)
        _unhurt(state, params, wanted)
        if params.fracture != "none":
            _bears(state, params, wanted)
        way = state.wood.motion.x - before
        state.books[WORK] += float(((load + state.wood.motion.load) / 2 * way).sum())
        yield reached(wanted, copied(state._replace(steps=state.steps + 1)), start, error)
        state = state._replace(steps=state.steps + 1)
