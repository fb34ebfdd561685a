"""Whose factor of a positive definite matrix: ours, or that of MKL's Pardiso where somebody asks for it.

It is due where a factor serves one solve and the matrix must be definite: in growth's Newton steps it gains 1.6 times
or more, elsewhere less (docs/dehydration.md, "Sparse factors").
"""

from __future__ import annotations

import os
from functools import cache
from typing import Literal, Protocol, TypeAlias, get_args

from ..arrays import Floats
from ..contract.errors import InvalidInput
from . import multifrontal, pardiso
from .multifrontal import Analysis

__all__ = ["Factor", "Maker", "chosen", "factorise"]

Maker: TypeAlias = Literal["wizen", "mkl-pardiso"]


class Factor(Protocol):
    """What solves."""

    def solve(self, right: Floats) -> Floats:
        """Return x of A x = right, both (size,)."""


def chosen() -> Maker:
    """Return whose factor is asked for: WIZEN_FACTOR, ours by default, installed or not, so that bytes stay.

    Raises:
        InvalidInput: there is no such one, or it is not installed.

    """
    asked = os.environ.get("WIZEN_FACTOR", "wizen")
    for maker in get_args(Maker):
        if asked == maker:
            if maker == "mkl-pardiso":
                _installed()
            return maker  # type: ignore[no-any-return]
    raise InvalidInput(f"WIZEN_FACTOR must be {' or '.join(get_args(Maker))}, not {asked!r}.")


@cache
def _installed() -> None:
    try:
        pardiso.load()
    except ImportError as error:
        raise InvalidInput(
            "WIZEN_FACTOR asks for MKL's Pardiso, which is not installed.",
            advice="Run `pip install -e '.[mkl]'` in wizen's checkout, or leave WIZEN_FACTOR out.",
        ) from error


def factorise(analysis: Analysis, data: Floats) -> Factor:
    """Return the factor of the positive definite matrix with blocks `data` (nnz, 3, 3) on the analysed pattern.

    It may be the only one of its analysis that lives. Raises numpy.linalg.LinAlgError if the matrix is not.
    """
    if chosen() == "mkl-pardiso":
        return pardiso.factorise(analysis, data)
    return multifrontal.factorise(analysis, data, definite=True)
