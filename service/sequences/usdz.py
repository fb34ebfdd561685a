"""USD with its textures in one file: an archive of the scene and a picture of colour and of roughness for each stage.

Pictures are baked into the mesh's own texture coordinates, or into such as xatlas lays out where it has none. `file` of
the textures is sampled over time; a program that does not follow that shows the last stage's. A fruit that has one
colour for all of its skin gets small pictures of it, on a mesh with texture coordinates of its own; where nobody knows
the skin, or nothing says where on it a picture lies, the archive holds what `usdc` does.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sweeps.pictures import colours

from ..errors import UnfitFormat
from .matter import Pictures
from .options import Options
from .skins import Look, byte, looked
from .usd import composed

if TYPE_CHECKING:
    from .view import Sequence

__all__ = ["usdz"]

#: Pixels of a picture where nobody says.
_PIXELS = 1024
#: Pixels of a picture that has one colour.
_PLAIN = 8


def usdz(sequence: Sequence, options: Options) -> bytes:
    """Return a sequence as an archive; `textures` is the size of its pictures [pixel].

    Raises:
        UnfitFormat: its triangles change, or `textures` are asked for and it has no colours.
        Unavailable: usd-core is not installed, or xatlas for a mesh without texture coordinates.

    """
    if sequence.coloured or not sequence.kept:
        sequence = sequence.unwrapped("Ask for usdc: colours are those of the vertices.")
    elif options.textures and sequence.worn() is None:
        raise UnfitFormat("textures need colours, and this result has none.", advice="Leave textures out.")
    with tempfile.TemporaryDirectory(prefix="wizen-") as text:
        folder = Path(text)
        pictures = _drawn(sequence, options, folder)
        stage = composed(sequence, options, pictures)
        from pxr import Sdf  # `composed` has said so if it is missing

        stage.GetRootLayer().Export(str(folder / "result.usdc"))
        out = Sdf.ZipFileWriter.CreateNew(str(folder / "result.usdz"))
        files = pictures.files if pictures else {}
        # what is to be opened comes first
        for name in ("result.usdc", *(name for kind in files.values() for _, name in kind)):
            out.AddFile(str(folder / name), name)
        out.Save()
        return (folder / "result.usdz").read_bytes()


def _drawn(sequence: Sequence, options: Options, folder: Path) -> Pictures | None:
    """Write the pictures of all stages and return their names; None where there are none."""
    from PIL import Image

    found = Pictures({}, [])
    for number, look in enumerate(_looks(sequence, options)):
        at = 1 + number * options.step
        drawn = {"diffuseColor": look.colour, "roughness": look.roughness}
        drawn |= {"normal": look.normal, "displacement": look.height}
        found.heights.append((at, look.low, look.high))
        for what, pixels in drawn.items():
            if pixels is None:
                continue
            name = f"{what}{number}.png"
            Image.fromarray(pixels).save(folder / name, "PNG")
            found.files.setdefault(what, []).append((at, name))
    return found if found.files else None


def _looks(sequence: Sequence, options: Options) -> Iterator[Look]:
    """Yield the pictures of each stage; of one colour where a stage is."""
    if sequence.coloured:
        for surface in sequence:
            yield looked(sequence, surface, options.pixels or _PIXELS, options.full)
        return
    for stage in sequence.stages if sequence.seam is not None else ():
        worn = sequence.worn(stage)
        if worn is not None:
            colour = np.broadcast_to(colours.encoded(worn.smooth), (_PLAIN, _PLAIN, 3))
            yield Look(colour.copy(), np.full((_PLAIN, _PLAIN), byte(np.asarray(worn.roughness))))
