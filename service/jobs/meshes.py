"""`POST /v1/meshes`: a mesh file of one's own as the value of a parameter. Nothing of it is kept."""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import anyio.to_thread
import numpy as np
from fastapi import APIRouter, Depends, Query, Request
from pydantic import BaseModel, Field

from store.tokens import Token
from sweeps.errors import InvalidOption

from .. import problems
from ..errors import InvalidQuery, Wrong
from ..formats import sent
from ..security import requires

__all__ = ["MeshPage", "router"]

router = APIRouter(tags=["jobs"])

_CONTENT = sent.contents([types[0] for types in sent.MESHES.values()])
#: A length that can be divided by.
_LEAST = 1e-30
#: Digits that places are written with.
_DIGITS = 7


class MeshPage(BaseModel):
    """A mesh as solvers take it, and what it is."""

    mesh: dict[str, Any] = Field(description="The value of the parameter `mesh` of a job")
    points: int = Field(description="Points, those in one place counted once")
    faces: int = Field(description="Triangles")
    borders: int = Field(description="Edges with one triangle alone; none of a closed mesh")
    unit: float = Field(description="Length of the file's unit that became 1: half its longest side; 1 without `fit`")


@router.post(
    "/v1/meshes",
    summary="Read a mesh of one's own",
    responses=problems.responses(400, 401, 403, 413, 422),
    openapi_extra={"requestBody": {"required": True, "content": _CONTENT}},
)
async def mesh(
    request: Request,
    token: Annotated[Token, Depends(requires("run"))],
    fit: Annotated[
        bool, Query(description="Move its middle to the origin and make half its longest side 1, as of presets")
    ] = True,
) -> MeshPage:
    """Answer with what a job's `mesh` is to be. OBJ, PLY, GLB or STL, as the content type says, or the bytes.

    Points in one place become one and keep their order; texture coordinates and materials stay. What is no mesh, points
    elsewhere or promises more than it holds is refused before any reader sees it.
    """
    body = await request.body()
    media = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    return await anyio.to_thread.run_sync(partial(_read, body, media, fit))


def _read(data: bytes, media: str, fit: bool) -> MeshPage:
    """Return a mesh file's page.

    Raises:
        InvalidQuery: it is no mesh that could be taken.

    """
    # what reads meshes is imported with the first of them
    from sweeps.commands.terminal import meshfile

    suffix = sent.suffix_of(media, data, sent.MESHES, "mesh")
    with tempfile.TemporaryDirectory(prefix="wizen-") as folder:
        path = Path(folder) / f"mesh{suffix}"
        path.write_bytes(data)
        try:
            mesh = meshfile.read(path)
        except InvalidOption as error:
            raise InvalidQuery.of([Wrong("mesh", error.message.rstrip("."), error.advice)]) from None
    points = np.array(mesh["points"])
    sides = np.sort(np.array(mesh["faces"])[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    counts = np.unique(sides, axis=0, return_counts=True)[1]
    unit = 1.0
    if fit:
        low, high = points.min(axis=0), points.max(axis=0)
        unit = float((high - low).max() / 2)
        if not unit > _LEAST:
            raise InvalidQuery.of([Wrong("mesh", "all its points are in one place", "Send one that has a size.")])
        points = (points - (low + high) / 2) / unit
        mesh["points"] = np.round(points, _DIGITS).tolist()
    borders = int((counts == 1).sum())
    return MeshPage(mesh=mesh, points=len(points), faces=len(mesh["faces"]), borders=borders, unit=unit)
