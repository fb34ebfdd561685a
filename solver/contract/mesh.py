"""Triangle meshes as values of parameters."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, model_validator

__all__ = ["GivenMesh"]


class GivenMesh(BaseModel):
    """Base of the meshes that users give; its children say how many points and triangles they take, and in what units.

    Read from text it refuses, with what to write instead.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _read(cls, values: object) -> object:
        if isinstance(values, str):
            raise ValueError("expected points and faces; on the command line, --set mesh=@FILE reads them from a file")
        return values
