"""Sentences that say what a table, a record, the command line or a law says: they say the same."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
from collections import defaultdict
from typing import Any

import numpy as np
import pytest
import typer.main

from benchmarks import figures
from benchmarks.dehydration import balance
from service.cli import app
from solver.decay import SOLVER as DECAY
from solver.decay import DecayParams
from solver.decay.environment import water_lost
from solver.decay.surfaces.surface import extent
from solver.dehydration import SOLVER as DEHYDRATION
from solver.dehydration.settings import choose
from store import starter
from store.blending import methods
from store.store import Store

from ._blocks import ROOT


def _page(name: str) -> str:
    """Return a page with its lines joined."""
    return " ".join((ROOT / name).read_text(encoding="utf-8").split())


@pytest.mark.skipif(shutil.which("make") is None, reason="no make here")
def test_make_help_names_all_that_there_is_to_make() -> None:
    phony = re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert phony
    said = subprocess.run(["make", "help"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert set(phony[1].split()) == set(re.findall(r"^([a-z-]+): ", said, re.MULTILINE))


def _commands(group: Any, before: str = "") -> dict[str, Any]:
    """Return all commands by name, those of groups behind the group's."""
    found: dict[str, Any] = {}
    for name, command in group.commands.items():
        found |= _commands(command, f"{name} ") if hasattr(command, "commands") else {before + name: command}
    return found


def test_the_readme_says_which_commands_print_no_json() -> None:
    every = _commands(typer.main.get_command(app))
    without = [name for name, command in every.items() if not any("--json" in one.opts for one in command.params)]
    said = re.search(r"with `--json`, which all but ([^,]*(?:, [^,]*)* and `[^`]*`) take", _page("README.md"))
    assert said
    assert sorted(re.findall(r"`([^`]*)`", said[1])) == sorted(without)


def test_the_readme_says_what_notebooks_import() -> None:
    said = re.search(r"one file \(`pip install -e '\.\[([\w,]+)\]'`\)", _page("README.md"))
    assert said
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = [
        *project["dependencies"],
        *(one for e in said[1].split(",") for one in project["optional-dependencies"][e]),
    ]
    brought = {re.split(r"[^\w]", name)[0] for name in needed} | {"IPython"}  # ipykernel brings that
    ours = set(sys.stdlib_module_names) | {"solver", "store", "sweeps", "service"}
    for path in sorted((ROOT / "examples" / "notebooks").glob("*.ipynb")):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
        assert set(re.findall(r"^(?:from|import) (\w+)", code, re.MULTILINE)) <= ours | brought, path.name


def test_elements_of_each_quality_are_those_that_are_taken() -> None:
    said = re.search(
        r"at gamma 10 preview has (\d+) elements an edge, default (\d+), fine (\d+)", _page("docs/dehydration.md")
    )
    assert said
    fruit = DEHYDRATION.parse({"te": 0.04, "gamma": 10})
    assert [int(n) for n in said.groups()] == [choose(fruit, q).n for q in ("preview", "default", "fine")]


def test_runs_whose_buckles_merge_are_counted_as_they_are() -> None:
    record = figures.load("dehydration-buckled")
    runs = [run for run in record["runs"] if run["version"] == record["version"]]
    page = _page("docs/dehydration.md")
    soft = [run["buckle_count"][-1] < run["buckle_count"][0] for run in runs if run["gamma"] == 10]
    stiff = [run["buckle_count"][-1] < run["buckle_count"][0] for run in runs if run["gamma"] > 10]
    assert all(soft)
    assert f"in all {len(soft)} runs" in page
    assert f"in {sum(stiff)} of {len(stiff)}, and there seeds" in page


def test_seeds_differ_from_their_mean_by_what_is_said() -> None:
    record = figures.load("dehydration-meshes")
    meshes = defaultdict(list)
    for run in record["runs"]:
        if run["version"] == record["version"]:
            meshes[run["gamma"], run["n"]].append(run["roughness"])
    worst = defaultdict(float)
    for (gamma, _), seeds in meshes.items():
        worst[gamma] = max(worst[gamma], float(np.abs(np.array(seeds) / np.mean(seeds, axis=0) - 1).max()))
    percent = {gamma: f"{100 * off:.0f}" for gamma, off in worst.items()}
    said = f"by up to {percent[10]} % at gamma 10, {percent[30]} % at 30 and {percent[50]} % at 50"
    assert said in _page("docs/dehydration.md")


def test_families_that_miss_goals_are_counted_as_they_are() -> None:
    record = figures.load("dehydration-score")
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in balance.table(record).splitlines()]
    family, missed = rows[0].index("family"), rows[0].index("missed")
    every = {row[family] for row in rows[2:]}
    misses = {(row[family], row[missed]) for row in rows[2:] if row[missed] != "-"}
    page = _page("docs/maps.md")
    assert f"Of {len(every)} families {len(every) - len({name for name, _ in misses})} miss nothing" in page
    wolfberry = {("wolfberry", "moved, roughness"), ("wolfberry", "moved")}
    assert misses == {("stone-radius-01", "moved"), ("jujube2", "moved"), *wolfberry}
    each = {run["family"]: run["each"] for run in record["runs"]}

    def own(name: str, s: float, what: str, method: str = methods.DEFAULT) -> list[float]:
        return [row[what] for row in each[name] if (row["method"], row["stage"]) == (method, s)]

    def points(name: str, s: float) -> str:
        first, second, third = (f"{moved:.2f}"[1:] for moved in sorted(own(name, s, "moved"), reverse=True))
        return f"by {first} and the others by {second} and {third}"

    assert f"where one of its three points moves {points('stone-radius-01', 0.2)}" in page
    assert f"where one moves {points('jujube2', 0.3)}" in page
    moved = [f"{np.mean(own('wolfberry', s, 'moved')):.2f}"[1:] for s in (0.2, 0.3)]
    assert f"are moved by {moved[0]} at s = .2 and {moved[1]} at .3" in page
    rough, nearest = (1 - np.mean(own("wolfberry", 0.2, "rgh", method)) for method in (methods.DEFAULT, "nearest"))
    said = f"{100 * rough:.1f} % too smooth at .2 (2 are wanted), where the nearest sample is {100 * nearest:.1f} % off"
    assert said.replace(" 0.", " .") in page


def test_what_does_not_come_into_balance_is_counted() -> None:
    runs = {run["family"]: run["each"] for run in figures.load("dehydration-score")["runs"]}
    late = {name: [row["residual"] for row in rows if row["residual"] > 5e-3] for name, rows in runs.items()}
    wolfberry = late.pop("wolfberry")
    of = sum(row["stage"] == 0.3 for row in runs["wolfberry"])
    said = f"{len(wolfberry)} of {of} have a residual above 5e-3 then, up to {max(wolfberry):.3f}".replace("0.", ".")
    assert f"{said}; in all other families {sum(map(len, late.values()))} has" in _page("docs/maps.md")


def test_relaxing_takes_as_long_as_is_said() -> None:
    rows = figures.load("dehydration-relaxed")["runs"]
    page = _page("docs/maps.md")
    assert "Wanted were 1.5 s at preview and 5 s of quarters of te 0.01: met." in page
    assert max(row["clock"] for row in rows if row["family"] == "preview") <= 1.5
    assert max(row["clock"] for row in rows if row["family"] == "sphere-01") <= 5
    assert max(row["residual"] for row in rows) <= 5e-3


def test_runs_of_tables_keep_their_roughness_as_is_said() -> None:
    off = defaultdict(list)
    for run in figures.load("dehydration-score")["runs"]:
        for s in run["stages"]:
            own = [row["rgh"] for row in run["each"] if row["method"] == "sample" and row["stage"] == s]
            off[run["family"]].append(abs(float(np.mean(own)) - 1))
    worst = max(max(each) for family, each in off.items() if family != "wolfberry")
    pattern = r"keep their roughness to (\.\d) %, but the wolfberry's to (\d\.\d) %\."
    said = re.search(pattern, _page("docs/maps.md"))
    assert said
    assert 100 * worst < float(said[1]) + 0.05
    assert 100 * max(off["wolfberry"]) < float(said[2]) + 0.05


def test_errors_of_runs_held_out_are_covered_as_is_said() -> None:
    held = [run for run in figures.load("dehydration-calibration")["runs"] if run["of"] == "runs held out"]
    ratios = {run["family"]: np.array(run["ratios"]) for run in held}
    share = {name: np.rint(100 * (each <= 1).mean(axis=0)).astype(int) for name, each in ratios.items()}
    both = np.rint(100 * (np.concatenate(list(ratios.values())) <= 1).mean(axis=0)).astype(int)
    own, measures = share["plum2"], figures.load("dehydration-calibration")["measures"]
    of = dict(zip(measures, own.tolist(), strict=True))
    rest = [of[name] for name in measures if name not in ("rgh", "L2nr", "ang")]
    page = " ".join(_page("docs/maps.md").split())
    assert f"It covers {share['default'].min()} to {share['default'].max()} % of the default family's" in page
    assert of["rgh"] == of["L2nr"]
    assert f"it covers {of['rgh']} % in roughness and in the surfaces' distance, {of['ang']} % in normals" in page
    assert f"and {min(rest)} to {max(rest)} % in the rest" in page
    others = both[[name != "rgh" for name in measures]]
    rough = both[measures.index("rgh")]
    assert f"Of all 72 it covers {rough} % in roughness and {others.min()} to {others.max()} % in the rest" in page


def test_controls_come_to_the_stored_samples_as_is_said() -> None:
    runs = figures.load("dehydration-controls")["runs"]
    anew = [run for run in runs if "anew" in run]
    assert len(anew) == 16
    assert {run["family"] for run in runs} == set(Store.open(starter.ROOT).table_names())
    for run in anew:
        assert min(run["anew"]["correlation"]) > 0.9995
        assert all(run["anew"][name] == values for name, values in run["stored"].items())
    off = max(abs(run["cold"]["roughness"][-1] / run["stored"]["roughness"][-1] - 1) for run in runs)
    page = " ".join(_page("docs/maps.md").split())
    assert "every one of the sixteen is the stored sample: correlations of 1.00 and the very same numbers" in page
    assert f"whose roughness at s = 0.3 is within {np.ceil(100 * off):.0f} % of theirs" in page


def test_slow_frames_of_painting_are_as_slow_as_is_said() -> None:
    rows = figures.load("growth-painting")["table"]["rows"]
    page = _page("docs/growth.md")
    ratios = {(row[0], row[1]): float(row[3]) / float(row[2]) for row in rows}
    small = {way: ratio for (what, way), ratio in ratios.items() if what == "leaf, 5000"}
    assert max(ratio for (what, way), ratio in ratios.items() if what.endswith("5000") and way == "whole") <= 3
    assert f"({small['whole']:.1f} times on the leaf; {small['active']:.1f} where parts are)" in page


def test_what_fruits_lose_in_a_day_is_what_they_lose() -> None:
    table = (ROOT / "docs" / "decay.md").read_text(encoding="utf-8").split("| fruit | Table 1's K |", 1)[1]
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in table.split("\n\n", 1)[0].splitlines()[2:]
    ]
    assert {row[0] for row in rows} == {"apple", "pear", "tomato", "orange", "peach"}
    for fruit, printed, lost, here, then in rows:
        own = DECAY.parse({}, fruit).transpiration
        assert own == (float(printed) if here == "as printed" else float(here))
        for coefficient, said in ((float(printed), lost), (own, then or lost)):
            params = DECAY.parse({"transpiration": coefficient}, fruit)
            assert isinstance(params, DecayParams)
            share = water_lost(params, extent(params), 1.0)
            digits = len(said.removesuffix(" %").partition(".")[2])
            assert f"{100 * share:.{digits}f} %" == said
