"""One stage's fields as pictures on the fruit's texture coordinates: 16-bit PNG of one, OpenEXR of all of them.

PNG holds round(65535 (value - low) / (high - low)); low and high stand in the file's text `wizen`. Shares go from 0 to
1 unless told otherwise, or as far as they go beyond, as fresh nutrient does; other fields over what they take on. EXR
holds the values themselves, 32-bit float, a channel each, so it needs no range.
"""

from __future__ import annotations

import io
import json
import tempfile
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from solver.quantities import QUANTITIES
from sweeps.errors import installing

from ..errors import InvalidQuery, Unavailable, UnfitFormat, Wrong
from .options import Options
from .view import lattice_fields

if TYPE_CHECKING:
    from .view import Sequence

__all__ = ["exr", "png", "png_zip"]

#: Time of files in an archive: the same bytes for the same result.
_EPOCH = (1980, 1, 1, 0, 0, 0)
#: What has the fields of surfaces whose triangles change.
_INSTEAD = "Ask for ply, ply-zip, usdc or animation: these hold fields by vertex."
#: How far a share may be beyond 0 or 1 by rounding.
_ROUND_OFF = 1e-5


def _fields(sequence: Sequence) -> dict[str, np.ndarray]:
    """Return the fields (v) of the sequence's one stage.

    Raises:
        UnfitFormat: there are none.

    """
    # on the lattice a map needs no shape
    on_lattice = lattice_fields(sequence.run, sequence.indices[0], sequence.scale) if sequence.lattice else {}
    found = {name: values.ravel() for name, values in on_lattice.items()} or dict(next(iter(sequence)).fields)
    if not found:
        raise UnfitFormat("this result holds no field on its surface.", advice="Solve again with the field you want.")
    return found


def png(sequence: Sequence, options: Options) -> bytes:
    """Return one field of one stage as a 16-bit grey PNG.

    Raises:
        UnfitFormat: no field, or triangles that change.
        InvalidQuery: there is no such field, or the range is empty.

    """
    sequence = sequence.unwrapped(_INSTEAD)
    fields = _fields(sequence)
    name = _named(fields, options) or next(iter(fields))
    return _png(sequence, name, fields[name], _range(name, [fields[name]], options), options.size)


def png_zip(sequence: Sequence, options: Options) -> bytes:
    """Return the maps of all stages in one archive, one set per stage: `stage_0001/rot.png` and so on.

    `map` asks for one field. A field that is no share runs over what it takes on in all stages. `stages.json` says what
    the sets are.

    Raises:
        UnfitFormat: no field, or triangles that change.
        InvalidQuery: there is no such field, or the range is empty.

    """
    sequence = sequence.unwrapped(_INSTEAD)
    ones = [replace(sequence, indices=(index,)) for index in sequence.indices]
    sets = [_fields(one) for one in ones]
    only = _named(sets[0], options)
    names = [only] if only else list(sets[0])
    ranges = {name: _range(name, [fields[name] for fields in sets], options) for name in names}
    folders = [f"stage_{number + 1:04d}" for number in range(len(ones))]
    files = {folder: one.stages[0] for folder, one in zip(folders, ones, strict=True)}
    about = {**sequence.about, "fields": names, "size": options.size, "files": files}
    out = io.BytesIO()
    # pictures are packed already
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(zipfile.ZipInfo("stages.json", _EPOCH), json.dumps(about, indent=1))
        for folder, one, fields in zip(folders, ones, sets, strict=True):
            for name in names:
                data = _png(one, name, fields[name], ranges[name], options.size)
                archive.writestr(zipfile.ZipInfo(f"{folder}/{name}.png", _EPOCH), data)
    return out.getvalue()


def _named(fields: dict[str, np.ndarray], options: Options) -> str | None:
    """Return the field that was asked for; none if none was."""
    name = options.map
    if name is not None and name not in fields:
        raise InvalidQuery.of([Wrong("map", f"there is no field {name[:40]!r}", f"Fields: {', '.join(fields)}.")])
    return name


def _range(name: str, values: list[np.ndarray], options: Options) -> tuple[float, float]:
    """Return the values that are black and white."""
    known = QUANTITIES.get(name)
    low, high = float(min(v.min() for v in values)), float(max(v.max() for v in values))
    if known and known.share:
        # what is beyond would be cut off without a word; a last digit is not
        low, high = (low if low < -_ROUND_OFF else 0.0), (high if high > 1 + _ROUND_OFF else 1.0)
    low, high = (low if options.low is None else options.low), (high if options.high is None else options.high)
    if high == low and options.low is None and options.high is None:
        high = low + 1  # a field that is the same everywhere is all black
    if not low < high:
        raise InvalidQuery.of([Wrong("high", f"{high:g} is not above low = {low:g}", "Give low below high.")])
    return low, high


def _png(sequence: Sequence, name: str, field: np.ndarray, between: tuple[float, float], size: int) -> bytes:
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    low, high = between
    values = sequence.baked(field, size)
    levels = np.clip((values.astype(float) - low) / (high - low), 0, 1) * 65535
    said = PngInfo()
    about = {"field": name, "low": low, "high": high, "stage": sequence.stages[0], "solver": sequence.about["solver"]}
    said.add_text("wizen", json.dumps(about))
    out = io.BytesIO()
    Image.fromarray((levels + 0.5).astype(np.uint16)).save(out, "PNG", pnginfo=said)
    return out.getvalue()


def exr(sequence: Sequence, options: Options) -> bytes:
    """Return the fields of one stage as an OpenEXR picture, one channel each; `map` asks for one of them.

    Raises:
        UnfitFormat: no field, or triangles that change.
        InvalidQuery: there is no such field.
        Unavailable: OpenEXR is not installed.

    """
    sequence = sequence.unwrapped(_INSTEAD)
    fields = _fields(sequence)
    only = _named(fields, options)
    if only is not None:
        fields = {only: fields[only]}
    try:
        import OpenEXR
    except ImportError:
        raise Unavailable("EXR needs the package OpenEXR.", advice=installing("formats")) from None
    channels = {name: sequence.baked(field, options.size) for name, field in fields.items()}
    head = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    head["wizen"] = json.dumps({"stage": sequence.stages[0], "solver": sequence.about["solver"]})
    with tempfile.TemporaryDirectory(prefix="wizen-") as folder:
        path = Path(folder) / "map.exr"
        with OpenEXR.File(head, channels) as file:
            file.write(str(path))
        return path.read_bytes()
