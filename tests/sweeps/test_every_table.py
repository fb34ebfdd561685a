"""Every solver's sweep ends in something to open: a tiny real one of each, built without a word on whose it is."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from _command import document, wizen

from solver import registry
from solver.quantities import unit_attrs
from store import scalars, seal
from store.errors import CorruptTable, UnknownTable
from store.store import Store

#: Per solver: what varies, what does not, and the stages.
TINY: dict[str, tuple[str, str, str]] = {
    "decay": ("temperature = [10, 24]\nhumidity = [50, 90]", "", "[0.3, 0.6]"),
    "growth": ("thickness = [0.1, 0.15]", "step = 0.2", "[0.1, 0.2]"),
    "dehydration": ("gamma = [3, 5]", "te = 0.1", "[0.01, 0.02]"),
    "wood": ("length = [0.15, 0.2]\nrods = [6, 8]", "vertices = 16\nbend = 0.01", "[2e-4, 4e-4]"),
}


def swept(folder: Path, solver: str, store: Path) -> None:
    axes, fixed, stages = TINY[solver]
    plan = folder / f"{solver}.toml"
    plan.write_text(
        f'solver = "{solver}"\n[set]\n{fixed}\n[axes]\n{axes}\n'
        f'[need]\nstages = {stages}\nquality = "preview"\nresolution = 16\n'
    )
    ended = wizen("sweep", plan, "--store", store, "--workers", "1")
    assert ended.exit_code == 0, ended.output
    assert f"wizen table build --store {store}" in ended.output


@pytest.mark.timeout(900)  # kernels are compiled where this is the first test to need them
@pytest.mark.parametrize("solver", sorted(TINY))
def test_a_tiny_sweep_ends_in_a_table(solver: str, tmp_path: Path) -> None:
    store = tmp_path / "store"
    swept(tmp_path, solver, store)
    built = document(wizen("table", "build", "--store", store, "--json"))
    opened = Store.open(store)
    # shapes where the fresh surface is known and the runs kept displacements
    assert opened.table_names() == (["default"] if solver == "dehydration" else [])
    path = Path(built["scalars"]["path"])
    assert path.read_bytes()[:4] == b"\x89HDF"
    assert seal.is_whole(path)
    axes = {line.split(" = ")[0]: json.loads(line.split(" = ")[1]) for line in TINY[solver][0].splitlines()}
    with xr.open_dataset(path, engine="h5netcdf") as table:
        assert {axis: table[axis].values.tolist() for axis in axes} == axes
        assert [table.sizes[axis] for axis in axes] == [2] * len(axes)
        assert table["stage"].values.tolist() == json.loads(TINY[solver][2])
        assert "seconds" not in table
        units = registry.get(solver).axis_units()
        assert all(unit_attrs(units[axis]).items() <= table[axis].attrs.items() for axis in axes if axis in units)
        jobs = opened.ledger.jobs("done")
        assert len(jobs) == table["key"].size == np.prod([2] * len(axes))
        for job in jobs:
            point = {axis: value for axis in axes if (value := _value(solver, job.params, axis)) is not None}
            run, row = opened.get(job.key), table.sel(point)
            assert str(row["key"].values) == job.key
            for name in table.data_vars:
                np.testing.assert_array_equal(row[name].transpose(*run[name].dims).values, run[name].values)


def _value(solver: str, params: object, axis: str) -> float:
    field, index = registry.get(solver).params.axes.get(axis, (axis, None))
    found = dict(params)[field]  # type: ignore[call-overload]
    return float(found if index is None else found[index])


def test_of_several_solvers_one_must_be_named(tmp_path: Path) -> None:
    store = tmp_path / "store"
    for solver in ("decay", "growth"):
        swept(tmp_path, solver, store)
    refused = wizen("table", "build", "--store", store)
    assert refused.exit_code == 2
    assert "decay, growth" in refused.output
    assert "--solver" in refused.output
    assert wizen("table", "build", "--store", store, "--solver", "growth").exit_code == 0
    assert document(wizen("table", "info", "--store", store, "--json"))["scalars"]["solver"] == "growth"
    assert document(wizen("status", "--store", store, "--json"))["scalars"] == ["default"]
    path = scalars.path_of(Store.open(store))
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(CorruptTable, match="damaged"):
        scalars.read(Store.open(store))
    with pytest.raises(UnknownTable, match="default"):
        scalars.read(Store.open(store), "other")


def test_an_empty_store_says_what_to_do(tmp_path: Path) -> None:
    Store.open(tmp_path / "store", create=True)
    refused = wizen("table", "build", "--store", tmp_path / "store")
    assert refused.exit_code == 1
    assert "no finished run" in refused.output
    assert "wizen sweep" in refused.output
