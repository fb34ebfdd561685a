"""What is worth knowing of a run before it begins: how it will be run, and what it is asked for that does nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ..contract import InvalidGeometry, InvalidInput, Need
from .choosing import ERROR, decide, error_at
from .model.bundle import SAMPLES
from .model.gripping import NOTHING
from .model.joining import longest_edge
from .model.outline import corners
from .model.sawing import boxes, meets
from .model.state import Wood
from .params import Cut, Grip, WoodParams
from .settings import choose
from .shape.taper import thickness
from .stepping.speeds import slow_enough

__all__ = ["idle", "note", "settled", "whole"]

#: Sections of a taper at which a box may meet it; findings that are told.
_SECTIONS, _MOST = 9, 5
#: Steps over what a wave takes for an edge, at least, about: 2000 rods have .09, 200 .25.
_STEP = 0.05
#: Strain of dead loads on all of the section that no wood bears, whose strain limit is a tenth of it.
_STRAINED = 0.1


def settled(params: WoodParams, vertices: int) -> tuple[WoodParams, dict[str, float], list[str]]:
    """Return the parameters with the mode chosen, the error that is expected of it, and what is to be said of the run.

    Raises:
        InvalidGeometry: a grip holds nothing.
        InvalidInput: something is past the wood between two steps.

    """
    said: dict[str, float] = {}
    notes = []
    if params.mode == "auto":
        choice = decide(params)
        params = params.model_copy(update={"mode": choice.mode, "mass_scaling": choice.scaling})
        said["expected_error"] = choice.error
        notes.append(choice.why)
    edge, most = params.length / (vertices - 1), longest_edge(params, corners(params))
    if params.fracture != "none" and params.rods > 1 and params.reach > 0 and edge > most:
        wanted = math.ceil(params.length / most) + 1
        notes.append(
            f"edges of {1e3 * edge:.3g} mm are longer than the {1e3 * most:.3g} mm that feel a crack's tip: it splits "
            f"at loads that are too high (by .6 at twice that), and all at once; {wanted} vertices on a rod are enough"
        )
    for n, grip in enumerate(params.grips):
        if not _meets(grip, params):
            raise InvalidGeometry(
                f"grip {n} {NOTHING}", advice=f"Move its box into the branch, which is {_where(params)}."
            )
    # no step is shorter than this but where contact or bonds are stiffer than wood is: the run looks again
    slow_enough(params, _STEP * edge * (params.mass_scaling * params.density / params.stiffness) ** 0.5, edge)
    found = [*_beside(params), *_unfelt(params, edge), *_yielding(params)]
    return params, said, notes + _short(found)


def note(params: WoodParams, need: Need) -> str:
    """Return what a reader should know of a run of these parameters; nothing where there is nothing to tell.

    Raises:
        InvalidGeometry: a grip holds nothing.
        InvalidInput: the need names a part of a fruit's surface, or something is past the wood between two steps.

    """
    whole(need)
    chosen, said, notes = settled(params, choose(params, need.quality).vertices)
    last = max(need.stages, default=1.0)
    if chosen.mode == "static" and last < 1:
        notes.append(
            f"loads of equilibria are full at 1 s, and the last stage, at {last:g} s, has {100 * last:.3g} % of them: "
            "name stages up to 1"
        )
    return "; ".join([*notes, *(() if said else _heavy(chosen))])


def whole(need: Need) -> None:
    """Refuse a part of a surface that wood has not.

    Raises:
        InvalidInput: see above.

    """
    if need.region is not None:
        raise InvalidInput("wood has no colatitude and azimuth.", advice="Leave the region out.")


def _heavy(params: WoodParams) -> Iterator[str]:
    """Yield what to say of masses scaled by hand that loads are too fast for; of what moves freely nobody knows."""
    if params.mass_scaling > 1 and params.mode == "explicit":
        error = error_at(params, params.mass_scaling)
        if error > ERROR:
            yield (
                f"loads are too fast for masses scaled {params.mass_scaling:g} times: forces of what is whole are off "
                f"by some {100 * error:.0f} %. Load it more slowly, scale less, or leave mass_scaling out and set mode "
                "auto, which chooses"
            )


def idle(wood: Wood, params: WoodParams) -> list[str]:
    """Return what to say of saw cuts that are in the branch, and pass none of the rods and bonds that are laid."""
    return _short(
        [
            f"cuts[{n}] passes between the {len(wood.grid)} rods and their bonds, and so does nothing: give it a "
            "larger box, or take more rods or vertices"
            for n, cut in enumerate(boxes(params, wood.grid.shape[1]))
            if _meets(cut, params) and not meets(cut, wood.straight, wood.rods, wood.bonds)
        ]
    )


def _short(found: list[str]) -> list[str]:
    more = len(found) - _MOST
    return found[:_MOST] + ([f"the same goes for {more} more"] if more > 0 else [])


def _meets(box: Cut | Grip, params: WoodParams) -> bool:
    """Return whether a box meets the straight bundle; a cut at its very end does not."""
    low, high = max(box.low[0], 0.0), min(box.high[0], params.length)
    if low > high or (isinstance(box, Cut) and (box.high[0] <= 0 or box.low[0] >= params.length)):
        return False
    outline = corners(params)
    return any(
        len(_clipped(outline * scale, box)) > 0
        for scale in thickness(np.linspace(low, high, _SECTIONS if params.taper != 1 else 1), params).tolist()
    )


def _clipped(outline: np.ndarray, box: Cut | Grip) -> np.ndarray:
    """Return the corners of what of a polygon (m, 2) is in a box, which may be flat (Sutherland and Hodgman 1974)."""
    for c in (0, 1):
        for sign, bound in ((1.0, box.low[c + 1]), (-1.0, box.high[c + 1])):
            depth = sign * (outline[:, c] - bound)
            after, there = np.roll(outline, -1, 0), np.roll(depth, -1)
            kept = []
            for p, q, d, e in zip(outline, after, depth, there, strict=True):
                if d >= 0:
                    kept.append(p)
                if (d >= 0) != (e >= 0):
                    kept.append(p + d / (d - e) * (q - p))
            outline = np.array(kept).reshape(-1, 2)
            if not len(outline):
                return outline
    return outline


def _where(params: WoodParams) -> str:
    """Return between which places the straight bundle lies."""
    outline = corners(params) * max(1.0, params.taper)
    (y, z), (v, w) = outline.min(0).tolist(), outline.max(0).tolist()
    return f"from 0 to {params.length:.3g} m along x, {y:.3g} to {v:.3g} m along y and {z:.3g} to {w:.3g} m along z"


def _beside(params: WoodParams) -> Iterator[str]:
    for n, cut in enumerate(params.cuts):
        if not _meets(cut, params):
            yield (
                f"cuts[{n}] meets nothing of the branch, which is {_where(params)}, and so does nothing: move its box "
                "into it, or leave it out"
            )


def _unfelt(params: WoodParams, edge: float) -> Iterator[str]:
    """Yield what to say of notches that weaken nothing, or some rods alone; edge [m]: the mean one."""
    apart = edge / (len(SAMPLES) - 1) if params.fracture == "stress" else edge
    for n, notch in enumerate(params.notches):
        if params.fracture == "none":
            yield f"notches[{n}] does nothing, as nothing breaks: leave it out, or set fracture stress"
        elif notch.depth == 0:
            yield f"notches[{n}] has no depth, and so does nothing: give it one, or leave it out"
        elif notch.width < apart:
            enough = math.ceil(params.length * apart / (edge * notch.width)) + 1
            yield (
                f"notches[{n}] is {1e3 * notch.width:.3g} mm wide, and strengths are known every {1e3 * apart:.3g} mm, "
                f"so that it misses some rods: make it as wide, or {enough} vertices on a rod are enough"
            )


def _yielding(params: WoodParams) -> Iterator[str]:
    """Yield what to say of wood that dead loads stretch out of all shape."""
    if params.clamp == "none":
        return
    section = math.pi * params.wide**2
    # the end is the thinnest of what tapers, and bears next to no weight
    load = math.hypot(*params.tip_load) / min(1.0, params.taper) ** 2
    load += params.density * section * params.length * abs(params.gravity)
    strain = load / (section * params.stiffness)
    if strain > _STRAINED:
        yield (
            f"dead loads could stretch wood of a stiffness of {params.stiffness:.3g} Pa by {strain:.2g} of its length, "
            "which none bears, and of which equilibria are hardly found: give loads "
            f"{math.ceil(strain / _STRAINED)} times smaller, or a stiffness of "
            f"{strain / _STRAINED * params.stiffness:.2g} Pa or more"
        )
