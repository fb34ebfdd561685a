"""NumPy's own archive: the numbers as they are, read by `numpy.load` without pickle."""

from __future__ import annotations

import io
import json
from typing import TYPE_CHECKING

import numpy as np

from .about import About, extras, lattice

if TYPE_CHECKING:
    from store.shape import Shape

__all__ = ["encode"]


def encode(shape: Shape, about: About) -> bytes:
    """Return position, displacement, colatitude, azimuth and poles, plus `about`: a JSON text with query, units and, as
    `lattice`, which points make a triangle.

    Equal shapes give equal bytes: the archive holds no time stamps.
    """
    told = {**extras(shape, about), "lattice": lattice(len(shape.colatitude), len(shape.azimuth), about)}
    arrays = {
        "position": shape.position,
        "displacement": shape.displacement,
        "colatitude": shape.colatitude,
        "azimuth": shape.azimuth,
        "poles": shape.poles,
        "about": np.array(json.dumps(told, sort_keys=True)),
    }
    file = io.BytesIO()
    np.savez(file, **{name: array for name, array in arrays.items() if array is not None})  # type: ignore[arg-type]
    return file.getvalue()
