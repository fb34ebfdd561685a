"""One stage's fields as pictures on the fruit's texture coordinates: 16-bit PNG of one, OpenEXR of all of them.

PNG holds round(65535 (value - low) / (high - low)); low and high stand in the file's text `wizen`. Shares go from 0 to
1 unless told otherwise, other fields over what they take on. EXR holds the values themselves, 32-bit float, a channel
each, so it needs no range.
"""

from __future__ import annotations

import io
import json
import tempfile
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

__all__ = ["exr", "png"]


def _fields(sequence: Sequence) -> dict[str, np.ndarray]:
    """Return the fields (v) of the sequence's one stage.

    Raises:
        UnfitFormat: there are none.

    """
    # on the lattice a map needs no shape
    on_lattice = lattice_fields(sequence.run, sequence.indices[0]) if sequence.lattice else {}
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
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    sequence = sequence.unwrapped()
    fields = _fields(sequence)
    name = options.map or next(iter(fields))
    if name not in fields:
        raise InvalidQuery.of([Wrong("map", f"there is no field {name[:40]!r}", f"Fields: {', '.join(fields)}.")])
    values = sequence.baked(fields[name], options.size)
    known = QUANTITIES.get(name)
    low, high = (0.0, 1.0) if known and known.share else (float(fields[name].min()), float(fields[name].max()))
    low, high = (low if options.low is None else options.low), (high if options.high is None else options.high)
    if high == low and options.low is None and options.high is None:
        high = low + 1  # a field that is the same everywhere is all black
    if not low < high:
        raise InvalidQuery.of([Wrong("high", f"{high:g} is not above low = {low:g}", "Give low below high.")])
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
    sequence = sequence.unwrapped()
    fields = _fields(sequence)
    if options.map is not None:
        if options.map not in fields:
            advice = f"Fields: {', '.join(fields)}."
            raise InvalidQuery.of([Wrong("map", f"there is no field {options.map[:40]!r}", advice)])
        fields = {options.map: fields[options.map]}
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
