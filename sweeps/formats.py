"""The registry of file formats by suffix. Light, so that higher floors can add theirs before anything is imported."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from solver.contract import Shade
    from store.shape import Shape

__all__ = ["Encoder", "Made", "added", "extend", "tell_by", "told"]


@dataclass(frozen=True)
class Made:
    """What a command has to write: shapes by stage, what it says about them, and the whole run if there was one.

    `table` and `fixed` are the look-up table's name and the numbers that are the same in all of it, `made` how its runs
    were done where that is not the usual; `units` are those of the parameters and of the stage, whose symbol is
    `stage_symbol`; `detail` says which part there is. `shade` is the skin of shapes whose stages `reach` so far and
    `metres` the length of r1, if anybody knows them. `cut` is the plane in which a picture shows the run cut open.
    """

    shapes: Sequence[Shape]
    document: Mapping[str, Any]
    title: str
    solver: str = ""
    table: str = ""
    fixed: Mapping[str, Any] = field(default_factory=dict)
    stage_symbol: str = "s"
    units: Mapping[str, str] = field(default_factory=dict)
    run: xr.Dataset | None = None
    key: str = ""
    cut: str | None = None
    shade: Shade | None = None
    reach: tuple[float, float] = (0.0, 1.0)
    made: Mapping[str, Any] = field(default_factory=dict)
    detail: Mapping[str, Any] = field(default_factory=dict)
    metres: float | None = None


@dataclass(frozen=True)
class Encoder:
    """A format: the fields of a shape that it needs, and how to write. `single` formats hold one stage only.

    whole: how a run is written with all its stages, and on meshes of its own; runs: nothing but runs is written.
    later: the suffix that a run on a mesh of its own is exported with where the format does not take it at once.
    """

    fields: tuple[str, ...]
    encode: Callable[[Made], bytes]
    single: bool = False
    whole: Callable[[xr.Dataset], bytes] | None = None
    runs: bool = False
    later: str = ".glb"


_more: list[Callable[[], Mapping[str, Encoder]]] = []
_tellers: list[Callable[[Shape, Made], Mapping[str, Any]]] = []


def extend(formats: Callable[[], Mapping[str, Encoder]]) -> None:
    """Add formats by suffix; `formats` is called when a file is to be written, so it may import what it likes."""
    _more.append(formats)


def added() -> dict[str, Encoder]:
    """Return the formats that were added; of two for one suffix, the first."""
    known: dict[str, Encoder] = {}
    for formats in _more:
        known = {**formats(), **known}
    return known


def tell_by(teller: Callable[[Shape, Made], Mapping[str, Any]]) -> None:
    """Have `teller` say of a shape, as plain JSON values, what every file says besides the numbers: as over HTTP."""
    _tellers.append(teller)


def told(shape: Shape, made: Made) -> Mapping[str, Any]:
    """Return what a file says of a shape besides its numbers; nothing where nobody from above says it."""
    return _tellers[-1](shape, made) if _tellers else {}
