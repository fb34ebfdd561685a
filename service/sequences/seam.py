"""Texture coordinates of a mesh whose vertices lie several times on its picture."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.arrays import Array, Words32

__all__ = ["Seam"]


class Seam(NamedTuple):
    """Texture coordinates (w, 2), v down, of a mesh cut open: `copies` (w) says which vertex each one repeats.

    triangles: (f, 3), the mesh's own in the same order, as indices into the w copies.
    """

    uv: Array
    copies: NDArray[np.intp]
    triangles: Words32
