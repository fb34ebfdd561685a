"""How far the roughness of a run is expected to be off, as measured on eighths of spheres against finer meshes.

Wrinkled skins bend over lengths of te, so what a mesh adds goes with the square of an element's edge h over te:

    error = RATE (h / te)^2 + SCATTER (min(gamma, 35) / 10)^POWER

The second is what single seeds differ by from their mean. Stiff skins have few and large facets, of which a seed
decides where they stand: at gamma = 10 seeds differ by up to 6 % of their mean, at 30 by 18 %, at 50 by 20 %, where the
worst of all runs is off by 38 %. Past the onset it is a statement on descriptors alone: the pattern itself is chaotic.
The runs are kept in `benchmarks/results/dehydration-meshes.json`.
"""

from __future__ import annotations

import math

from ..contract import InvalidInput, Need, Quality
from .params import DehydrationParams
from .settings import choose, expected_cost

__all__ = ["SCATTER", "expected_error", "of_mesh"]

RATE, SCATTER, POWER, _SATURATED = 0.045, 0.067, 1.17, 35.0

#: Where it was measured: te (0.02 at gamma = 10 alone, by version 5), gamma, the last stage, and the stone.
_THICKNESS, _RATIO, _LAST, _STONE = (0.02, 0.04), (10.0, 50.0), 0.3, 0.4


def expected_error(params: DehydrationParams, quality: Quality, last: float) -> float:
    """Return the expected relative error of the roughness of a run at `quality` up to stage `last`.

    Raises:
        InvalidInput: none was measured for such a fruit; says for which, and what a run takes.

    """
    te, gamma = params.exocarp_thickness, params.modulus_ratio
    measured = (
        params.is_sphere
        and params.dries_evenly
        and _THICKNESS[0] <= te <= _THICKNESS[1]
        and _RATIO[0] <= gamma <= _RATIO[1]
        and 0 <= last <= _LAST
        and params.stone == (_STONE, _STONE)
    )
    settings = choose(params, quality, last)
    if not measured:
        raise InvalidInput(
            f"no error was measured for this fruit (te = {te:g}, gamma = {gamma:g}) to s = {last:g}: only for evenly "
            f"drying spheres with te {_THICKNESS[0]:g} to {_THICKNESS[1]:g}, gamma {_RATIO[0]:g} to {_RATIO[1]:g} and "
            f"stones of {_STONE:g} r1, to s = {_LAST:g}.",
            advice=f"Name a quality in place of the tolerance: {quality} takes {settings.elements:,} elements and "
            f"about {expected_cost(params, Need(stages=(last,), quality=quality)).seconds:.0f} s.",
        )
    return of_mesh(te, gamma, settings.n)


def of_mesh(te: float, gamma: float, n: int) -> float:
    """Return the expected error with n elements along an edge of the cubed sphere, whatever was measured."""
    edge = math.pi / 2 / n
    return float(RATE * (edge / te) ** 2 + SCATTER * (min(gamma, _SATURATED) / 10) ** POWER)
