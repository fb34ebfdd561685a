"""What may be chosen about a file of a whole result, with bounds: one model for query and command line."""

from __future__ import annotations

from typing import Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from ..errors import InvalidQuery, Wrong

__all__ = ["Options"]


#: Pixels and threads of a file that shows all, where nobody says how many.
_PIXELS, _THREADS = 1024, 12_000


class Options(BaseModel):
    """Choices that formats share; each takes what it knows and leaves the rest alone."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    colour: str = Field("auto", description="auto: skin, rot and mould where there are any; none; or a field's name")
    scale: float = Field(1.0, gt=0, le=1e6, description="Length in the file of the result's unit of length")
    fps: float = Field(24.0, ge=1, le=240, description="Frames per second")
    step: float = Field(12.0, gt=0, le=1000, description="Frames from one stage to the next")
    textures: int = Field(0, ge=0, le=4096, description="Pixels of baked textures in place of vertex colours; 0: none")
    threads: int = Field(0, ge=0, le=200_000, description="Most threads of mould, as curves or cards; 0: none")
    full: bool = Field(
        False,
        description="All that is known of the looks: threads, stem and calyx; GLB and USDZ: pictures of colour, "
        "roughness, normals and height, finer than the mesh",
    )
    cut: str | None = Field(
        None,
        max_length=200,
        description="Cut open: X,Y,Z of a point and of the normal to the half that goes, e.g. 0,0,0,0,0,1",
    )
    map: str | None = Field(None, description="Field of a baked map; the first one if left out")
    size: int = Field(512, ge=2, le=8192, description="Pixels of a map, along and down")
    low: float | None = Field(None, description="Value that a 16-bit map shows as 0")
    high: float | None = Field(None, description="Value that a 16-bit map shows as 65535")

    @field_validator("textures")
    @classmethod
    def _not_tiny(cls, value: int) -> int:
        if value == 1:
            raise ValueError("a texture has at least 2 pixels")
        return value

    @property
    def pixels(self) -> int:
        """Pixels of pictures, 0: none."""
        return self.textures or (_PIXELS if self.full else 0)

    @property
    def grown(self) -> int:
        """Most threads."""
        return self.threads or (_THREADS if self.full else 0)

    @classmethod
    def parse(cls, values: dict[str, Any]) -> Self:
        """Validate what was given; None stands for the default.

        Raises:
            InvalidQuery: with every wrong choice named.

        """
        try:
            return cls.model_validate({name: value for name, value in values.items() if value is not None})
        except ValidationError as error:
            wrong = [
                Wrong(str(item["loc"][0]), item["msg"].removeprefix("Value error, "), f"Got {item['input']!r:.40}.")
                for item in error.errors()
            ]
            raise InvalidQuery.of(wrong) from None
