"""A developed pattern as the start of another run, so that neighbours in parameter space buckle into kindred shapes.

Past the onset the buckles of two samples that differ by a per cent have little in common, and shapes between them
cannot be interpolated. Started from one pattern they keep to it for a while (`docs/dehydration.md` says how long).
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import RectSphereBivariateSpline

from ...arrays import Floats
from ...contract import Context, InvalidInput
from ...fruit import azimuths, colatitudes, lattice
from ..measures.harmonics import remove_low
from ..params import DehydrationParams

__all__ = ["pattern_heights"]


#: Degrees below this are the shape of the other fruit, not its wrinkles.
_LOWEST_DEGREE = 5

#: Share of a stage by which the one that was asked for may differ from a stored one: round-off.
_SAME = 1e-9


def pattern_heights(params: DehydrationParams, directions: Floats, context: Context) -> Floats:
    """Return the heights (n,) [r1] of `params.pattern` at unit `directions` (n, 3) of the parametric sphere.

    They are the stored displacement along the rays of that fresh fruit, without its low degrees, scaled so that the
    largest is `amplitude` exocarp thicknesses of this fruit.

    Raises:
        InvalidInput: there is no such result, it lacks the stage or the displacement, or it has no wrinkles.

    """
    pattern = params.pattern
    assert pattern is not None
    result = context.result(pattern.key)
    if result.attrs.get("solver") != "dehydration" or "displacement" not in result:
        raise InvalidInput(
            f"the result {pattern.key[:12]} holds no displacement of a dehydrated fruit.",
            advice="Name a dehydration run with the field 'displacement'.",
        )
    stages = result["stage"].values
    place = int(np.argmin(abs(stages - pattern.stage)))
    if abs(stages[place] - pattern.stage) > _SAME:
        raise InvalidInput(
            f"the result {pattern.key[:12]} has no stage {pattern.stage:g}.",
            advice=f"It has {', '.join(f'{stage:g}' for stage in stages)}.",
        )
    shift = result["displacement"].transpose("stage", "colatitude", "azimuth", "component").values[place]
    n = len(shift)
    if shift.shape != (n, 2 * n, 3):
        raise InvalidInput(
            f"the result {pattern.key[:12]} covers a part of the surface only.", advice="Run it without a region."
        )
    fresh = DehydrationParams.model_validate_json(result.attrs["params"]).surface(*lattice(n))
    rays = fresh / np.linalg.norm(fresh, axis=-1, keepdims=True)
    wrinkles = remove_low(np.einsum("tpi,tpi->tp", shift.astype(np.float64), rays), _LOWEST_DEGREE)
    highest = abs(wrinkles).max()
    if not highest > 1e-6:
        raise InvalidInput(
            f"the result {pattern.key[:12]} is smooth at stage {pattern.stage:g}.",
            advice="Take a stage past its onset.",
        )
    spline = RectSphereBivariateSpline(colatitudes(n), azimuths(n), wrinkles / highest)
    colatitude = np.arccos(np.clip(directions[:, 1], -1.0, 1.0))
    azimuth = np.arctan2(directions[:, 2], directions[:, 0]) % (2 * np.pi)
    heights: Floats = spline(colatitude, azimuth, grid=False)
    return pattern.amplitude * params.exocarp_thickness * heights
