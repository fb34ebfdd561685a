"""Stages just past the onset that are handed over smooth, though smooth spheres are not stable there any more.

The march holds rest volumes while a stage settles, so that what is marched is as soft in bulk as its own modulus says,
and buckles later than flesh: 5 to 30 % later in shrinkage, more the thicker and the stiffer the skin. Between the two
onsets buckles grow only as fast as rest volumes follow, slower than what a stage is waited for.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Floats
from .fresh.closed_form import onset_estimate
from .params import DehydrationParams
from .settings import Settings

__all__ = ["is_smooth", "note"]

#: Height of bumps (rms) below which a sphere is smooth [te].
_SMOOTH = 0.1
#: The estimate of the onset is that far off at most; and buckles stand so far past the march's own onset.
_OFF, _STANDING = 0.8, 1.15


def is_smooth(params: DehydrationParams, surface: Floats) -> bool:
    """Return whether a sphere's surface (nc, 3) has no buckles yet; fruits of other shapes are not looked at."""
    if not (params.is_sphere and params.dries_evenly):
        return False
    radius = np.sqrt(np.einsum("ni,ni->n", surface, surface))
    return float(radius.std()) < _SMOOTH * params.exocarp_thickness


def note(params: DehydrationParams, settings: Settings, smooth: Sequence[float]) -> str | None:
    """Return what is to be said of the stages at which a sphere was handed over `smooth`; None where it is stable."""
    estimate = onset_estimate(params.modulus_ratio, params.stone[0])
    near = [s for s in smooth if s > _OFF * estimate]
    if not near:
        return None
    from .bifurcation import onset

    begins, ends = (onset(params, kappa_ratio=k).s_cr for k in (settings.kappa_ratio, settings.march_kappa_ratio))
    past = [f"{s:g}" for s in near if begins is not None and s > begins]
    if not past or ends is None:
        return None
    return (
        f"s = {', '.join(past)}: just past the onset ({begins:.3g}), where the smooth shape that stands here is not "
        f"stable. Buckles are found from s = {_STANDING * ends:.2g} on."
    )
