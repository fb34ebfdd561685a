"""The command that says where a shape starts to buckle."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InvalidOption
from .terminal.console import emit, grid
from .terminal.options import As_json, Preset, Quality, Set, assignments, check_place

if TYPE_CHECKING:
    from solver.contract import Fresh, Solver

__all__ = ["add_to"]

_METHODS = ("exact", "linear", "both")
#: Height of the buckles in a picture of a mode [r1], in wavelengths, so that they can be seen.
_PICTURED = 0.15
_FINEST = 256


def add_to(app: typer.Typer) -> None:
    """Add the command of this module to the root command."""
    app.command()(onset)


def onset(
    preset: Preset = None,
    set_: Set = None,
    method: Annotated[
        str, typer.Option("--method", help="exact (on the shrunk shape), linear (the paper's Eq. 11) or both.")
    ] = "exact",
    kappa_ratio: Annotated[
        float | None, typer.Option("--kappa-ratio", help="Bulk over shear modulus; incompressible if left out.")
    ] = None,
    quality: Quality = None,
    solver: Annotated[str | None, typer.Option("--solver", help="Which solver, if several know onsets.")] = None,
    mode_out: Annotated[
        Path | None, typer.Option("--mode-out", metavar="FILE", help="The first mode, as .npz or as a picture, .png.")
    ] = None,
    as_json: As_json = False,
) -> None:
    """Say at which shrinkage a dehydrating fruit starts to buckle, and into what.

    Spheres take milliseconds, fruits with a circular equator seconds, others up to minutes. It is the whole fruit's
    onset: mirrors, which leave a run fewer modes, are left aside. With --method both, the JSON document is the exact
    answer and holds the linear one under "linear".

    [bold]Examples[/bold]

    wizen onset --preset sphere

    wizen onset --set stone=[0.3,0.3] --set te=0.02 --set gamma=30 --kappa-ratio 1000 --json

    wizen onset --preset raisin --method both --mode-out raisin.png
    """
    if method not in _METHODS:
        raise InvalidOption(f"--method {method}: unknown.", f"Known: {', '.join(_METHODS)}.")
    _check(mode_out)
    from solver.contract import Context

    from .terminal import progress

    chosen = _solver(solver)
    assert chosen.onset is not None
    params = chosen.parse(assignments(set_), preset)
    asked = ("exact", "linear") if method == "both" else (method,)
    found = {}
    with progress.one_run("onset") as observe, progress.stopping() as stop:
        for each in asked:
            found[each] = chosen.onset(
                params,
                method=each,
                kappa_ratio=kappa_ratio,
                quality=quality or "default",
                context=Context(observe, stop.is_set),
            )
    first = found[asked[0]]
    document = {**first.summary(), "mode": None if mode_out is None or first.mode is None else str(mode_out)}
    if method == "both":
        document["linear"] = found["linear"].summary()
    if mode_out is not None and first.mode is not None:
        fresh = chosen.fresh(params.model_dump(mode="json"))
        assert fresh is not None
        _write(mode_out, fresh, first, document, preset)
    emit(document, as_json, lambda console: _show(console, list(found.values()), document))


def _check(path: Path | None) -> None:
    if path is None:
        return
    if path.suffix.lower() not in (".npz", ".png"):
        raise InvalidOption(f"--mode-out {path}: cannot write {path.suffix or 'no suffix'!r}.", "Known: .npz, .png.")
    check_place("--mode-out", path)


def _solver(name: str | None) -> Solver:
    """Return the solver that is asked: the one named, or the only one that knows onsets.

    Raises:
        InvalidOption: it knows none, or several do and none is named.

    """
    from solver import registry

    able = {each: registry.get(each) for each in registry.names() if registry.get(each).onset is not None}
    if name is None and len(able) == 1:
        return next(iter(able.values()))
    if name not in able:
        what = "several solvers know onsets" if name is None else f"--solver {name}: it knows no onset"
        raise InvalidOption(f"{what}.", f"Name one of {', '.join(able)}.")
    return able[name]


def _write(path: Path, start: Fresh, found: Any, document: dict[str, Any], preset: str | None) -> None:
    """Write the mode on the lattice: as numbers, or the fresh shape with the mode on it as a picture."""
    import numpy as np

    from solver.lattice import azimuths, colatitudes, lattice
    from store import seal

    resolution = min(max(96, 4 * found.degree), _FINEST)
    fresh = start.points(*lattice(resolution))
    heights = found.mode.on(*lattice(resolution))
    if path.suffix.lower() == ".npz":
        out = io.BytesIO()
        np.savez_compressed(
            out,
            colatitude=colatitudes(resolution),
            azimuth=azimuths(resolution),
            height=heights,
            position=fresh,
            onset=np.array(json.dumps(document)),
        )
        seal.publish(path, out.getvalue())
        return
    from ..pictures.sheet import Panel, sheet

    height = _PICTURED * 2 * np.pi / found.degree * heights[..., None]
    shape = fresh + height * fresh / np.linalg.norm(fresh, axis=-1, keepdims=True)
    label = f"{preset or 'fruit'}: {found.method} onset at s = {found.s_cr:.4f}"
    seal.publish(path, sheet([[Panel(shape)]], title=label, pixels=480))


def _show(console: Any, found: list[Any], document: dict[str, Any]) -> None:
    head = ["", *(f"{each.method}" for each in found)]
    rows = [
        ["shrinkage at onset s_cr [1]", *(_cell(each.s_cr, ".5f") for each in found)],
        ["degree [1]", *(_cell(each.degree, "d") for each in found)],
        ["azimuthal wavenumber m [1]", *(_cell(each.wavenumber, "d") for each in found)],
        ["bulk / shear modulus [1]", *(_cell(each.kappa_ratio, "g", "incompressible") for each in found)],
        ["path", *(each.path for each in found)],
        ["time [s]", *(f"{each.seconds:.3g}" for each in found)],
    ]
    grid(console, head, rows)
    first = found[0]
    if first.s_cr is None:
        console.print(f"This fruit {first.reason}.", markup=False)
    else:
        near = ", ".join(f"degree {t.degree} m {t.wavenumber} at {t.s_cr:.5f}" for t in first.ties[:3])
        also = f" Close behind: {near}." if near else ""
        console.print(f"It stays smooth until it has shrunk by {first.s_cr:.2%}.{also}", markup=False)
        if first.reason:
            console.print(f"Note: {first.reason}.", markup=False)
    if len(found) == 2 and None not in (found[0].s_cr, found[1].s_cr):
        miss = found[1].s_cr / found[0].s_cr - 1
        console.print(f"Linearising at the fresh shape misses that by {miss:+.1%}.", markup=False)
    if document["mode"]:
        console.print(f"mode written to {document['mode']}", markup=False)


def _cell(value: Any, form: str, none: str = "none") -> str:
    return none if value is None else format(value, form)
