"""How a batch of shapes is written: piece by piece, so that its length costs no memory.

`npz` is one archive: `position` and `displacement` (shape, colatitude, azimuth, component) in float32, or float64 where
the table has it, `poles` (shape, pole, component) of whole surfaces, one column per axis, `stage`, descriptors of the
runs, crossings and volume of the mesh, what is known of the error, and `about`, a JSON text, which says under `lattice`
which points make a triangle; where distinct shapes are sent once, `row` (point) as well. `json` is one line per shape.
Other formats are the parts of a multipart/mixed body.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from solver.arrays import Array
from store.lookup import ShapeTable
from store.shape import Shape
from store.surfaces.window import Window

from ..formats import FORMATS, About, Format, best
from ..formats.about import GENERATOR, LENGTH_UNIT, lattice
from .batch_detail import Asked

__all__ = ["MEDIA_TYPES", "Batch", "encode", "media_type", "negotiate"]

_LINES, _MIXED = "application/x-ndjson", "multipart/mixed"
#: Media type -> format, in order of growing preference; multipart/mixed stands for its most useful parts.
_BY_TYPE = {_LINES: "json", _MIXED: "glb", FORMATS["npz"].media_type: "npz"}
MEDIA_TYPES = tuple(_BY_TYPE)


class Batch(NamedTuple):
    """Shapes yet to be looked up, in the order of `asked`, each time that `look_up` is called.

    `rows` says, where each distinct shape is sent once, which of them a point has.
    """

    table: ShapeTable
    about: About
    asked: list[Asked]
    rows: list[int] | None
    window: Window
    fields: tuple[str, ...]
    look_up: Callable[[], Iterator[tuple[Shape, About]]]

    def points(self) -> list[list[int]] | None:
        """Return for each shape that is sent the points that it is for; None where each point has its own."""
        if self.rows is None:
            return None
        found: list[list[int]] = [[] for _ in self.asked]
        for point, row in enumerate(self.rows):
            found[row].append(point)
        return found


def negotiate(accept: str | None, explicit: str | None) -> Format:
    """Return the format named by `explicit`, else the best for an Accept header; npz for those who take anything.

    Raises:
        NotAcceptable: nothing in `accept` can be had.

    """
    return FORMATS[explicit or _BY_TYPE[best(accept, {name: FORMATS[f] for name, f in _BY_TYPE.items()})]]


def media_type(chosen: Format, batch: Batch) -> str:
    """Return the media type of a batch in a format."""
    if chosen.name == "npz":
        return chosen.media_type
    return _LINES if chosen.name == "json" else f'{_MIXED}; boundary="{_boundary(batch)}"'


def encode(chosen: Format, batch: Batch) -> Iterator[bytes]:
    """Yield the bytes of a batch in a format; equal batches give equal bytes."""
    if chosen.name == "npz":
        return _npz(batch)
    return _lines(chosen, batch) if chosen.name == "json" else _mixed(chosen, batch)


def _lines(chosen: Format, batch: Batch) -> Iterator[bytes]:
    points = batch.points()
    for i, (shape, about) in enumerate(batch.look_up()):
        line = chosen.encode(shape, about)
        if points is not None:
            line = line[:-1] + f',"points":{json.dumps(points[i])}}}'.encode()
        yield line + b"\n"


def _mixed(chosen: Format, batch: Batch) -> Iterator[bytes]:
    boundary = _boundary(batch)
    points = batch.points()
    for i, (shape, about) in enumerate(batch.look_up()):
        body = chosen.encode(shape, about)
        head = (
            f"--{boundary}\r\nContent-Type: {chosen.media_type}\r\nContent-Length: {len(body)}\r\n"
            f'Content-Disposition: attachment; filename="{i}{chosen.suffix}"\r\n'
        )
        if points is not None:
            head += f"Wizen-Points: {','.join(map(str, points[i]))}\r\n"
        yield head.encode() + b"\r\n" + body + b"\r\n"
    yield f"--{boundary}--\r\n".encode()


def _boundary(batch: Batch) -> str:
    return hashlib.sha256(f"{batch.table.digest} {batch.asked} {batch.rows}".encode()).hexdigest()


class _Pipe:
    """The end of a file that is written once and never read: what was written since the last look."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []

    def write(self, data: bytes) -> int:
        self._parts.append(bytes(data))
        return len(data)

    def flush(self) -> None:
        pass

    def take(self) -> bytes:
        taken, self._parts = b"".join(self._parts), []
        return taken


def _npz(batch: Batch) -> Iterator[bytes]:
    """Yield an archive: the fields first, shape by shape; what is small is gathered meanwhile."""
    patch = batch.window.on(batch.asked[0].resolution)
    size = (len(batch.asked), patch.height, patch.width, len(patch.components))
    # what is packed in whole numbers is looked up in single precision
    dtype = np.dtype("<f8" if batch.table.info.dtype == "float64" else "<f4")
    pipe = _Pipe()
    rows = _Rows()
    with zipfile.ZipFile(pipe, "w", zipfile.ZIP_STORED) as archive:  # type: ignore[call-overload]
        # the second field waits in memory while the first one is written; a batch's limit bounds it
        first, *others = batch.fields or ("",)
        waiting: dict[str, list[bytes]] = {name: [] for name in others}
        with archive.open(zipfile.ZipInfo(f"{first}.npy"), "w", force_zip64=True) as member:
            member.write(_head(size, dtype))
            for shape, _ in batch.look_up():
                rows.add(shape)
                for name, held in waiting.items():
                    held.append(_bytes(getattr(shape, name), dtype))
                member.write(_bytes(getattr(shape, first), dtype))
                yield pipe.take()
        for name, held in waiting.items():
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as member:
                member.write(_head(size, dtype))
                while held:
                    member.write(held.pop(0))
                    yield pipe.take()
        places = {} if batch.rows is None else {"row": np.array(batch.rows)}
        for name, array in {**rows.arrays(), **places, "about": np.array(_about(batch, rows))}.items():
            file = io.BytesIO()
            np.lib.format.write_array(file, array, allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), file.getvalue())
    yield pipe.take()


def _head(shape: tuple[int, ...], dtype: np.dtype[Any]) -> bytes:
    file = io.BytesIO()
    said = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, said)
    return file.getvalue()


def _bytes(array: Array, dtype: np.dtype[Any]) -> bytes:
    return array.astype(dtype, copy=False).tobytes()


class _Rows:
    """What is small about every shape, to become columns."""

    def __init__(self) -> None:
        self._rows: list[dict[str, Any]] = []
        self._poles: list[Array] = []
        self._last: Shape | None = None

    def add(self, shape: Shape) -> None:
        """Keep what is small."""
        self._last = shape
        if shape.poles is not None:
            self._poles.append(shape.poles)
        self._rows.append(
            {
                **shape.parameters,
                "stage": shape.stage,
                **{f"descriptor_{name}": value for name, value in shape.descriptors.items()},
                **{f"expected_{name}": value for name, value in (shape.expected_error or {}).items()},
                "nearest": shape.nearest,
                "inside": shape.inside,
                "held": np.nan if shape.held is None else shape.held,
                "exact": shape.exact,
                "converged": shape.converged,
                "crossings": np.nan if shape.crossings is None else shape.crossings,
                "volume": np.nan if shape.volume is None else shape.volume,
                "tier": shape.tier,
            }
        )

    def arrays(self) -> dict[str, Array]:
        """Return the columns; what a shape does not know (descriptors next to the fresh one) is NaN."""
        assert self._last is not None
        names = dict.fromkeys(name for row in self._rows for name in row)
        found: dict[str, Array] = {"colatitude": self._last.colatitude, "azimuth": self._last.azimuth}
        if self._poles:
            found["poles"] = np.stack(self._poles)
        return found | {name: np.array([row.get(name, np.nan) for row in self._rows]) for name in names}

    @property
    def method(self) -> str:
        """How they were looked up."""
        return self._last.method if self._last else ""


def _about(batch: Batch, rows: _Rows) -> str:
    about, patch = batch.about, batch.window.on(batch.asked[0].resolution)
    said: Mapping[str, Any] = {
        "generator": GENERATOR,
        "solver": about.solver,
        "table": about.table,
        "digest": batch.table.digest,
        "params": dict(about.fixed),
        "made": dict(about.made),
        "axes": list(batch.table.axes),
        "stage": about.stage_symbol,
        "method": rows.method,
        "units": {"length": LENGTH_UNIT, **about.units},
        "detail": dict(about.detail),
        "lattice": lattice(patch.height, patch.width, about),
    }
    return json.dumps(said, sort_keys=True)
