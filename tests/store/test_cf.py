"""Files as the CF conventions have them: readers that know nothing of wizen understand units, title and history."""

from __future__ import annotations

import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import xarray as xr

from solver import registry
from solver.dehydration import SOLVER
from solver.quantities import QUANTITIES, in_words, unit_attrs
from store import scalars, tables
from store.store import Store
from store.surfaces.measures import UNITS

#: What this project writes of UDUNITS' words; the slow test below asks UDUNITS itself.
KNOWN = {
    "1",
    "s",
    "day",
    "m",
    "m s-1",
    "m s-2",
    "radian",
    "radian s-1",
    "degree",
    "degC",
    "percent",
    "N",
    "N m",
    "kg",
    "J",
    "J m-2",
    "J m-3",
    "N m s",
    "N s",
    "m2",
    "Pa",
    "0.1 lg(re 1)",
}


def test_every_unit_that_leaves_is_one_that_others_read() -> None:
    said = {quantity.units for quantity in QUANTITIES.values()} | set(UNITS.values())
    for name in registry.names():
        solver = registry.get(name)
        said |= {*solver.axis_units().values(), solver.stages.units}
    assert {unit_attrs(unit)["units"] for unit in said} <= KNOWN
    assert unit_attrs("1/r1") == {"units": "1", "normalised_by": "1/r1"}
    assert {in_words(unit_attrs(unit)) for unit in said} == said


def test_the_stages_of_a_table_have_their_solver_s_unit(filled: Store) -> None:
    """Days, of what rots."""
    tables.build(filled, replace(SOLVER, stages=SOLVER.stages._replace(units="day")))
    with tables.open(filled) as opened:
        assert opened["stage"].attrs["units"] == "day"


def files(store: Store) -> list[Path]:
    table, packed = tables.build(store, SOLVER), tables.build(store, SOLVER, "packed", dtype="int16")
    built = [tables.path_of(store, table), tables.path_of(store, packed), scalars.build(store, SOLVER, "numbers")]
    return [store.shard_path(table.keys[0]), *built]


def test_every_file_says_what_it_is_and_how_it_came_about(filled: Store) -> None:
    for path in files(filled):
        with xr.open_dataset(path, engine="h5netcdf") as opened:
            assert opened.attrs["Conventions"] == "CF-1.11"
            assert opened.attrs["title"]
            assert "wizen" in opened.attrs["history"]
            for name, variable in opened.variables.items():
                if variable.dtype.kind in "fiu":
                    assert variable.attrs["units"] in KNOWN, name


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_compliance_checker_finds_nothing(filled: Store, tmp_path: Path) -> None:
    """In an environment of its own: it brings netCDF4, which xarray would then prefer in every other test."""
    python = tmp_path / "env" / "bin" / "python"
    subprocess.run([sys.executable, "-m", "venv", python.parents[1]], check=True)
    subprocess.run([python, "-m", "pip", "install", "--quiet", "compliance-checker>=6"], check=True)
    for number, path in enumerate(files(filled)):
        named = shutil.copy(path, tmp_path / f"{number}.nc")
        assert _findings(python, named, "1.11") == []
        # a file says one version; that of before knows all of what is in it, and the oldest no numbers of 64 bits
        assert all("Conventions" in line for line in _findings(python, named, "1.10"))
        assert all("Conventions" in line or "int64" in line for line in _findings(python, named, "1.8"))


def _findings(python: Path, file: Path, version: str) -> list[str]:
    words = [python.with_name("compliance-checker"), f"--test=cf:{version}", "--criteria=strict", file]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    found = [line for line in done.stdout.splitlines() if line.startswith("* ")]
    assert ("All tests passed!" in done.stdout) == (not found), done.stdout + done.stderr
    return found
