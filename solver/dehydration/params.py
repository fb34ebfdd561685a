"""Parameters of a dehydration run: the fruit, the two moduli's ratio and the imperfection that starts the buckles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from pydantic import Field

from ..fruit import Fruit

__all__ = ["DehydrationParams"]


class DehydrationParams(Fruit):
    """Liu et al. 2014: F = Fe Fd with Fd = (1 - s) I in the sarcocarp and I in the exocarp, rigid stone."""

    axes: ClassVar[Mapping[str, tuple[str, int | None]]] = {**Fruit.axes, "gamma": ("modulus_ratio", None)}

    modulus_ratio: float = Field(
        10.0,
        ge=1.0,
        le=1000.0,
        description="Shear modulus of the exocarp over that of the sarcocarp",
        json_schema_extra={"units": "1", "axes": ["gamma"]},
    )
    imperfection: float = Field(
        1e-3,
        ge=0.0,
        le=0.01,
        description="Largest amplitude of the seeded smooth bumps on the fresh shape that start the buckles",
        json_schema_extra={"units": "r1"},
    )
