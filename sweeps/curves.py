"""Numbers of a run by stage, as a table (.csv) and drawn (.svg): a test bench's curves.

What has the dimension `stage` and at most two short ones besides is a column each: `body_force 0 z [N]`. Of fields
called `X_force` and `X_shift`, force is drawn over way, and moment over turn of `X_torque` and `X_turn`; below, force
and moment of all that bears any over the stage. Of a run without such, all plain numbers over the stage.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.arrays import Array

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["as_csv", "as_svg", "columns"]

#: More values by stage than these are no list, but a field.
_MOST = 256


class _Axes(NamedTuple):
    scale: float
    across: str
    up: str


#: What is drawn over what, by the ends of their names.
_OVER = {
    ("_force", "_shift"): _Axes(1e3, "way [mm]", "force [N]"),
    ("_torque", "_turn"): _Axes(180 / np.pi, "turn [degree]", "moment [N m]"),
}


def _label(run: xr.Dataset, dim: str, n: int) -> str:
    return str(run[dim].values[n]) if dim in run.coords else str(n)


def columns(run: xr.Dataset) -> Iterator[tuple[str, str, Array]]:
    """Yield name, unit and values (stages,) of every number by stage, the stage first."""
    yield "stage", str(run["stage"].attrs.get("units", "1")), run["stage"].values
    for name, variable in run.data_vars.items():
        dims = variable.dims[1:]
        if not variable.dims or variable.dims[0] != "stage" or int(np.prod(variable.shape[1:])) > _MOST:
            continue
        for index in np.ndindex(*variable.shape[1:]):
            parts = [_label(run, str(d), n) for d, n in zip(dims, index, strict=True)]
            yield " ".join([str(name), *parts]), str(variable.attrs.get("units", "1")), variable.values[:, *index]


def as_csv(run: xr.Dataset) -> bytes:
    """Return a line for every stage; the head has names and units."""
    found, out = list(columns(run)), io.StringIO()
    writer = csv.writer(out)
    writer.writerow([f"{name} [{unit}]" for name, unit, _ in found])
    writer.writerows([f"{values[n]:.9g}" for _, _, values in found] for n in range(run.sizes["stage"]))
    return out.getvalue().encode()


def _paired(run: xr.Dataset, load: str, way: str) -> Iterator[tuple[str, Array, Array]]:
    """Yield label, way and load (stages,) of all that went somewhere: sizes of vectors."""
    for name in map(str, run.data_vars):
        other = name.removesuffix(load) + way
        if not name.endswith(load) or other not in run or not run[name].size:
            continue
        for n in range(run.sizes[str(run[name].dims[1])]):
            gone, felt = (np.linalg.norm(run[one].values[:, n], axis=-1) for one in (other, name))
            if np.ptp(gone) > 0:
                yield f"{name.removesuffix(load)} {n}", gone, felt


def _felt(run: xr.Dataset, load: str) -> Iterator[tuple[str, Array, Array]]:
    """Yield label, stage and load (stages,) of all that bears any: sizes of vectors."""
    for name in (str(n) for n in run.data_vars if str(n).endswith(load)):
        for n in range(run.sizes[str(run[name].dims[1])]):
            felt = np.linalg.norm(run[name].values[:, n], axis=-1)
            if felt.any():
                yield f"{name.removesuffix(load)} {n}", run["stage"].values, felt


def _panels(run: xr.Dataset) -> list[tuple[_Axes, list[tuple[str, Array, Array]]]]:
    """Return axes and labelled curves: loads over ways and turns, then over the stage."""
    unit = str(run["stage"].attrs.get("units", "1"))
    found = [(over, list(_paired(run, *kind))) for kind, over in _OVER.items()]
    for (load, _), over in _OVER.items():
        found.append((_Axes(1.0, f"stage [{unit}]", over.up), list(_felt(run, load))))
    return [(axes, curves) for axes, curves in found if curves]


def as_svg(run: xr.Dataset) -> bytes:
    """Return the curves as a drawing: loads over ways, turns and stages if the run knows loads, else its numbers."""
    from matplotlib.figure import Figure

    drawn = _panels(run)
    figure = Figure(figsize=(6.4, 3.2 * max(len(drawn), 1)), layout="constrained")
    if drawn:
        for axes, (over, found) in zip(figure.subplots(len(drawn), 1, squeeze=False)[:, 0], drawn, strict=True):
            for label, way, load in found:
                axes.plot(over.scale * way, load, lw=1.2, label=label)
            axes.set(xlabel=over.across, ylabel=over.up)
            axes.legend()
    else:
        plain = [c for c in columns(run) if " " not in c[0]][1:]
        for axes, (name, unit, values) in zip(
            figure.subplots(len(plain), 1, sharex=True, squeeze=False)[:, 0], plain, strict=True
        ):
            axes.plot(run["stage"].values, values, lw=1.2)
            axes.set_ylabel(f"{name} [{unit}]", rotation=0, ha="right")
        figure.set_size_inches(6.4, 1.2 * len(plain))
    out = io.BytesIO()
    # no date: the same run is the same file
    figure.savefig(out, format="svg", metadata={"Date": None})
    return out.getvalue()
