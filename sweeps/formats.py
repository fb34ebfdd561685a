"""The registry of file formats by suffix. Light, so that higher floors can add theirs before anything is imported."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from solver.contract import Shade
    from store.shape import Shape

__all__ = ["Encoder", "Made", "added", "extend"]


@dataclass(frozen=True)
class Made:
    """What a command has to write: shapes by stage, what it says about them, and the whole run if there was one.

    `table` and `fixed` are the look-up table's name and the parameters that are the same in all of it; `units` are
    those of the parameters and of the stage, whose symbol is `stage_symbol`. `shade` is the skin of shapes of a table
    whose stages `reach` so far. `cut` is the plane in which a picture shows the run cut open.
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


@dataclass(frozen=True)
class Encoder:
    """A format: the fields of a shape that it needs, and how to write. `single` formats hold one stage only.

    whole: how a run is written with all its stages, and on meshes of its own; runs: nothing but runs is written.
    """

    fields: tuple[str, ...]
    encode: Callable[[Made], bytes]
    single: bool = False
    whole: Callable[[xr.Dataset], bytes] | None = None
    runs: bool = False


_more: list[Callable[[], Mapping[str, Encoder]]] = []


def extend(formats: Callable[[], Mapping[str, Encoder]]) -> None:
    """Add formats by suffix; `formats` is called when a file is to be written, so it may import what it likes."""
    _more.append(formats)


def added() -> dict[str, Encoder]:
    """Return the formats that were added; of two for one suffix, the first."""
    known: dict[str, Encoder] = {}
    for formats in _more:
        known = {**formats(), **known}
    return known
