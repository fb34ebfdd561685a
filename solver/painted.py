"""Maps that somebody painted over a round body, by colatitude and azimuth about the y axis."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from .arrays import Floats

__all__ = ["Painted", "PaintedMap", "Photo", "painted", "photographed"]

Share = Annotated[float, Field(ge=0.0, le=1.0)]


def _square(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    if rows and {len(row) for row in rows} != {2 * len(rows)}:
        raise ValueError(f"a painted map of {len(rows)} rows has {2 * len(rows)} values in each")
    return rows


#: Rows from the pole y > 0 down, each around the y axis from x towards z: n rows of 2 n values from 0 to 1.
Painted = Annotated[tuple[tuple[Share, ...], ...], Field(max_length=512), AfterValidator(_square)]


class PaintedMap(BaseModel):
    """A painted map and what it stands for; the rows alone, as of a picture, mean all the rest as it is by default."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    values: Painted

    @model_validator(mode="before")
    @classmethod
    def _alone(cls, value: Any) -> Any:
        return {"values": value} if isinstance(value, list | tuple) else value


class Photo(PaintedMap):
    """A photograph of a round body that fills it, as seen from a side; rows of brightness from its top down."""

    azimuth: float = Field(
        90.0, ge=0, le=360, description="Where it was taken from, about the y axis, from x towards z [degree]"
    )


def photographed(photo: Photo, rays: Floats, unseen: float) -> Floats:
    """Return a photograph at unit rays (v, 3), bilinear: far away and upright; `unseen` on the half that faces away."""
    from scipy import ndimage

    values, angle = np.array(photo.values, dtype=float), np.radians(photo.azimuth)
    towards = np.array([np.cos(angle), 0.0, np.sin(angle)])
    # who looks from there has this to the right: up x towards
    right = np.array([np.sin(angle), 0.0, -np.cos(angle)])
    down, along = (1 - rays[:, 1]) / 2, (1 + rays @ right) / 2
    n, m = values.shape
    at = [down * n - 0.5, along * m - 0.5]
    seen = ndimage.map_coordinates(values, at, order=1, mode="nearest")
    found: Floats = np.where(rays @ towards > 0, seen, unseen)
    return found


def painted(rows: tuple[tuple[float, ...], ...], rays: Floats) -> Floats:
    """Return a painted map at unit rays (v, 3), bilinear; beyond a pole the rows go on on the other side."""
    from scipy import ndimage

    values = np.array(rows, dtype=float)
    n, m = values.shape
    padded = np.concatenate([np.roll(values[:1], n, axis=1), values, np.roll(values[-1:], n, axis=1)])
    down = np.arccos(np.clip(rays[:, 1], -1, 1)) * n / np.pi + 0.5
    along = np.arctan2(rays[:, 2], rays[:, 0]) % (2 * np.pi) * m / (2 * np.pi)
    padded = np.concatenate([padded, padded[:, :1]], axis=1)
    found: Floats = ndimage.map_coordinates(padded, [down, along], order=1, mode="nearest")
    return found
