"""Where a shrinking fruit starts to buckle, and into what.

`onset` chooses the road by the fruit's shape: concentric spheres in one dimension ("radial"), fruits with a circular
equator in the meridional plane ("meridional"), any other in three dimensions ("full"). `base_state` is the smooth
shape before the onset.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from threadpoolctl import threadpool_limits

from ...contract import Context, InvalidInput
from ..params import DehydrationParams
from .base import BaseState, base_state
from .result import AxisymmetricMode, FieldMode, Method, Onset, Road, SurfaceMode, Tie

__all__ = ["AxisymmetricMode", "BaseState", "FieldMode", "Onset", "SurfaceMode", "Tie", "base_state", "onset"]


def onset(
    params: DehydrationParams,
    *,
    method: Method = "exact",
    kappa_ratio: float | None = None,
    quality: str = "default",
    road: Road | None = None,
    context: Context | None = None,
) -> Onset:
    """Return where the fruit starts to buckle, and its first mode.

    method: "exact" is the first shrinkage at which the tangent on the shrunk shape is singular; "linear" is the
    eigenproblem of Liu et al. 2014, Eq. 11, linearised at the fresh shape: 11 to 33 % too high for the spheres of the
    tests, 4 to 9 % for the axisymmetric fruits of Table 1, and at about 1.5 times the degree. kappa_ratio: bulk over
    shear modulus of both layers, None for incompressible. road: None takes the cheapest one that the shape allows.

    A fruit that stays smooth up to s = 0.6 is an answer, not a failure: `s_cr` is None and `reason` says so. It is the
    whole fruit's onset, whatever `params.mirrors` say, and `reason` says that too: runs between these planes may start
    later, as they have no modes that are odd about them.

    Raises:
        InvalidInput: unknown method, quality or road, a road that the shape does not allow, kappa_ratio off its range,
            flesh that does not shrink evenly.
        NotConverged: the smooth state or its modes were not found.

    """
    if method not in ("exact", "linear"):
        raise InvalidInput(f"unknown method {method!r}.", advice="Known: exact, linear.")
    if quality not in ("preview", "default", "fine"):
        raise InvalidInput(f"unknown quality {quality!r}.", advice="Known: preview, default, fine.")
    if kappa_ratio is not None and not 5 <= kappa_ratio <= 1e6:
        raise InvalidInput(
            f"kappa_ratio = {kappa_ratio:g} lies outside 5 to 1e6.", advice="Leave it out for incompressible layers."
        )
    if not params.dries_evenly:
        raise InvalidInput(
            "the onset is known for flesh that shrinks evenly only.", advice="Leave out wetness, anisotropy and light."
        )
    best: Road = "radial" if params.is_sphere else "meridional" if params.is_axisymmetric else "full"
    roads: tuple[Road, ...] = ("radial", "meridional", "full")
    if road is not None and (road not in roads or roads.index(road) < roads.index(best)):
        raise InvalidInput(f"this fruit has no {road!r} road.", advice=f"Leave it out, or take {best!r}.")
    # two threads take longer for fronts of some hundreds, and round otherwise; only libraries that are loaded are held
    find = _road(road or best)
    with threadpool_limits(1, user_api="blas"):
        found = find(params, method=method, kappa_ratio=kappa_ratio, quality=quality, context=context)
    if not params.mirrors or found.s_cr is None:
        return found
    mirrored = f"this is the whole fruit's onset: with mirrors = {params.mirrors} a run has fewer modes, maybe later"
    return replace(found, reason="; ".join(filter(None, (found.reason, mirrored))))


def _road(road: Road) -> Callable[..., Onset]:
    """Return what follows a road, imported when it is first taken."""
    if road == "radial":
        from .radial import onset_radial

        return onset_radial
    if road == "meridional":
        from .meridional import onset_meridional

        return onset_meridional
    from .full import onset_full

    return onset_full
