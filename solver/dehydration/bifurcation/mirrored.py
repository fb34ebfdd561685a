"""The first buckling mode that is its own image in the mirror planes of a fruit of which a part is solved."""

from __future__ import annotations

from ...contract import Context, InvalidInput, NotConverged
from ..params import DehydrationParams
from .field import mode_heights
from .full import crossings
from .result import FieldMode

__all__ = ["mirrored_mode"]


def mirrored_mode(params: DehydrationParams, *, quality: str = "preview", context: Context | None = None) -> FieldMode:
    """Return the first mode that is even about all of `params.mirrors`, by the road that goes parity by parity.

    Raises:
        InvalidInput: the fruit does not buckle.
        NotConverged: no smooth state below the onset, or the modes near the first one are odd about a mirror.

    """
    model, found = crossings(params, quality=quality, context=context)
    if not found:
        raise InvalidInput("there is no buckling mode to start from.", advice='Set imperfection_kind to "waves".')
    mirrors = ["xyz".index(name) for name in params.mirrors]
    for each in found:
        parity = dict(zip(model.mesh.planes, each.parity, strict=True))
        if all(parity[axis] > 0 for axis in mirrors):
            return FieldMode(mode_heights(params, model, each))
    raise NotConverged(
        "no mode near the first has the mirrors' symmetry.", advice='Leave out mirrors, or start from "waves".'
    )
