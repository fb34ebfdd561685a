"""USD with its textures in one file: an archive of the scene and a picture of colour and of roughness for each stage.

Pictures are baked into the mesh's own texture coordinates, or into such as xatlas lays out where it has none. `file` of
the textures is sampled over time; a program that does not follow that shows the last stage's.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import UnfitFormat
from .matter import Pictures
from .options import Options
from .skins import looked
from .usd import composed

if TYPE_CHECKING:
    from .view import Sequence

__all__ = ["usdz"]

#: Pixels of a picture where nobody says.
_PIXELS = 1024


def usdz(sequence: Sequence, options: Options) -> bytes:
    """Return a sequence as an archive; `textures` is the size of its pictures [pixel].

    Raises:
        UnfitFormat: it has no colours, or its triangles change.
        Unavailable: usd-core is not installed, or xatlas for a mesh without texture coordinates.

    """
    sequence = sequence.unwrapped("Ask for usdc: colours are those of the vertices.")
    if not sequence.coloured:
        raise UnfitFormat("textures need colours, and this result has none.", advice="Ask for usdc.")
    with tempfile.TemporaryDirectory(prefix="wizen-") as text:
        folder = Path(text)
        pictures = _drawn(sequence, options, folder)
        stage = composed(sequence, options, pictures)
        from pxr import Sdf  # `composed` has said so if it is missing

        stage.GetRootLayer().Export(str(folder / "result.usdc"))
        out = Sdf.ZipFileWriter.CreateNew(str(folder / "result.usdz"))
        # what is to be opened comes first
        for name in ("result.usdc", *(name for kind in pictures.files.values() for _, name in kind)):
            out.AddFile(str(folder / name), name)
        out.Save()
        return (folder / "result.usdz").read_bytes()


def _drawn(sequence: Sequence, options: Options, folder: Path) -> Pictures:
    """Write the pictures of all stages and return their names."""
    from PIL import Image

    size = options.pixels or _PIXELS
    found = Pictures({}, [])
    for number, surface in enumerate(sequence):
        at = 1 + number * options.step
        look = looked(sequence, surface, size, options.full)
        drawn = {"diffuseColor": look.colour, "roughness": look.roughness}
        drawn |= {"normal": look.normal, "displacement": look.height}
        found.heights.append((at, look.low, look.high))
        for what, pixels in drawn.items():
            if pixels is None:
                continue
            name = f"{what}{number}.png"
            Image.fromarray(pixels).save(folder / name, "PNG")
            found.files.setdefault(what, []).append((at, name))
    return found
