"""How far the density of rot and mould is expected to be off, as measured on apples against a mesh of 192 cells.

With the paper's rates the error is of second order in the mesh. With those of *P. expansum* it is not: fronts are
narrower than a cell, and within the wounds the colonies leave a pattern that no two meshes share, so that a finer mesh
does not help; totals agree to 0.4 %. The runs are kept in `benchmarks/results/decay-mesh.json`.
"""

from __future__ import annotations

from collections.abc import Mapping

from ..contract import InvalidInput, Quality
from .params import DecayParams
from .presets import PRESETS

__all__ = ["LAST", "MEASURED", "expected_error"]

#: Preset -> quality -> the larger of the relative L2 errors of rot and mould. Fine is what the others are held to: it
#: was measured against nothing.
MEASURED: Mapping[str, Mapping[Quality, float]] = {
    "apple-paper": {"preview": 0.015, "default": 0.0015},
    "apple": {"preview": 0.15, "default": 0.055},
}
#: Up to which day.
LAST = 10.0


def expected_error(params: DecayParams, quality: Quality, last: float) -> float:
    """Return the expected relative L2 error of the densities of a run at `quality` up to day `last`.

    Raises:
        InvalidInput: none was measured for these colonies, that climate, that long, or that quality; says for which.

    """
    advice = f"Name a quality in place of the tolerance: {quality}, say."
    for preset, errors in MEASURED.items():
        known = DecayParams.parse(PRESETS[preset])
        same = (params.climate, params.rot, params.mould) == (known.climate, known.rot, known.mould)
        if same and params.mesh is None and last <= LAST:
            if quality not in errors:
                least = min(errors.values())
                raise InvalidInput(
                    f"no error was measured at {quality}, and {least:g} is the least of those that were.", advice=advice
                )
            return errors[quality]
    raise InvalidInput(
        f"no error was measured for such a run to day {last:g}: only for the colonies of the presets "
        f"{' and '.join(MEASURED)} on a fruit's own surface, to day {LAST:g}.",
        advice=advice,
    )
