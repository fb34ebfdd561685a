"""File formats of whole results: name -> `Export`, and `write`.

A new format is a function `(Sequence, Options) -> bytes` in its own module, one line in `EXPORTS`, and one test that
reads its output with a reader that is not ours.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import InvalidQuery, UnfitFormat, Wrong
from ..vocabulary import row_of
from . import animation, caches, maps, text, usd, usdz
from .options import Options
from .view import Sequence, of_run

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["EXPORTS", "STILLS", "Export", "Options", "Sequence", "of_run", "prepared", "write"]


class Export(NamedTuple):
    """A format of results: its name, its media type and suffix, and what it asks of the result.

    single: it holds one stage. kept: all stages must have the same triangles. laid: so must they, and in texture
    coordinates, even where there is one stage.
    """

    name: str
    media_type: str
    suffix: str
    title: str
    encode: Callable[[Sequence, Options], bytes]
    single: bool = False
    kept: bool = False
    laid: bool = False


#: In order of growing preference, as for `service.formats.FORMATS`. Parameters of a media type tell apart what is the
#: same kind of file; answers carry the type without them.
EXPORTS: Mapping[str, Export] = {
    e.name: e
    for e in (
        Export("exr", "image/x-exr", ".exr", "OpenEXR map of one stage's fields", maps.exr, single=True, laid=True),
        Export(
            "png", "image/png", ".png", "16-bit PNG map of one field of one stage", maps.png, single=True, laid=True
        ),
        Export(
            "png-zip",
            "application/zip; of=png",
            ".png.zip",
            "16-bit PNG maps, one set per stage",
            maps.png_zip,
            laid=True,
        ),
        Export("obj-zip", "application/zip; of=obj", ".obj.zip", "OBJ files, one per stage", text.obj_zip),
        Export("ply-zip", "application/zip; of=ply", ".ply.zip", "PLY files, one per stage", text.ply_zip),
        Export("usda", "model/vnd.usda", ".usda", "USD as text, sampled over time", usd.usda),
        Export("usdc", "model/vnd.usdc", ".usdc", "USD, sampled over time", usd.usdc),
        Export("usdz", "model/vnd.usdz+zip", ".usdz", "USD with baked textures in one file", usdz.usdz, laid=True),
        Export("mdd", "application/x-mdd", ".mdd", "MDD vertex cache", caches.mdd, kept=True),
        Export("pc2", "application/x-pc2", ".pc2", "PC2 vertex cache", caches.pc2, kept=True),
        Export("ply", "model/x-ply", ".ply", "PLY of one stage, with colours and fields", text.ply, single=True),
        Export("animation", "model/gltf-binary; stages=all", ".glb", "animated binary glTF 2.0", animation.animation),
    )
}

#: How one stage of any result is written where the result is not a plain lattice.
STILLS: Mapping[str, Callable[[Sequence, Options], bytes]] = {"glb": animation.animation, "obj": text.obj}


def prepared(run: xr.Dataset, options: Options, stage: float | None = None, single: bool = False) -> Sequence:
    """Return what is to be written: all stages, or the one asked for, or the last one for formats that hold one.

    Raises:
        UnfitFormat: the result holds no whole surface.
        InvalidQuery: it has no such stage, or the cut is no plane through it.

    """
    if options.cut is not None:
        run = _opened(run, options.cut, stage, single)
    whole = replace(of_run(run), colour=options.colour, scale=options.scale)
    if stage is None:
        return whole.at(-1) if single else whole
    return whole.at(row_of(whole.stages, stage))


def _opened(run: xr.Dataset, cut: str, stage: float | None, single: bool) -> xr.Dataset:
    from sweeps import opened
    from sweeps.errors import InvalidOption

    try:
        where = opened.parsed(cut)
        days = np.arange(run.sizes.get("stage", 0))
        if single or stage is not None:
            # the others would be cut in vain; one that is not there is refused by name
            days = days[-1:] if stage is None else days[np.isclose(run["stage"].values, stage, rtol=1e-9, atol=1e-9)]
        return opened.opened(run.isel(stage=days) if len(days) and "vertex_count" not in run else run, where)
    except InvalidOption as error:
        raise InvalidQuery.of([Wrong("cut", error.message.rstrip("."), error.advice)]) from None


def write(sequence: Sequence, export: Export, options: Options) -> bytes:
    """Return a sequence as a file's bytes.

    Raises:
        UnfitFormat: the format cannot hold it.
        Unavailable: the format's library is not installed.

    """
    if export.kept and len(sequence) > 1 and not sequence.stays:
        others = ", ".join(e.name for e in EXPORTS.values() if not (e.kept or e.single or e.laid))
        raise UnfitFormat(
            f"{export.name} moves vertices that stay, and this result's triangles change from stage to stage.",
            advice=f"Ask for one of {others}.",
        )
    return export.encode(sequence, options)
