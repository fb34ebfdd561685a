"""Numbers of a run by stage, as a table (.csv) and drawn (.svg): a test bench's curves.

What has the dimension `stage` and at most two short ones besides is a column each: `body_force 0 z [N]`. Of fields
called `X_force` and `X_shift`, force is drawn over way; of a run without such, all plain numbers over the stage.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from solver.arrays import Array

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["as_csv", "as_svg", "columns"]

#: More values by stage than these are no list, but a field.
_MOST = 256


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


def as_svg(run: xr.Dataset) -> bytes:
    """Return the curves as a drawing: force over way where the run knows both, else numbers over the stage."""
    from matplotlib.figure import Figure

    pairs = [(str(n), f"{str(n)[:-6]}_shift") for n in run.data_vars if str(n).endswith("_force")]
    pairs = [(f, s) for f, s in pairs if s in run and run[f].size]
    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    if pairs:
        axes = figure.subplots()
        for force, shift in pairs:
            for n in range(run.sizes[str(run[force].dims[1])]):
                way, load = (np.linalg.norm(run[name].values[:, n], axis=-1) for name in (shift, force))
                if np.ptp(way) > 0:
                    axes.plot(1e3 * way, load, lw=1.2, label=f"{force[:-6]} {n}")
        axes.set(xlabel="way [mm]", ylabel="force [N]")
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
