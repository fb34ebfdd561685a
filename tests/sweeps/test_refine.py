from __future__ import annotations

import itertools
import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks.dehydration import refining
from service.cli import app
from solver import registry
from store import tables
from store.errors import MixedSamples, UnknownJob
from store.store import Store
from sweeps.errors import InvalidOption, PlanError
from sweeps.planning.plan import Plan
from sweeps.refining import refine
from sweeps.refining.refine import Proposal, State
from sweeps.refining.rounds import Propose, Round, held_out_error, rounds
from sweeps.running import executors
from sweeps.running.runner import run_plan

NEED = {"stages": [0.2], "quality": "fine", "fields": ["displacement", "mean_radius"]}
BOX = {"te": {"from": 0.02, "to": 0.06}, "gamma": {"from": 10, "to": 200, "scale": "log"}}
SCATTERED = {"solver": "ridged", "axes": BOX, "sampling": {"kind": "sobol", "count": 10}, "need": NEED}
GRID = {"solver": "ridged", "axes": {"te": [0.02, 0.06], "gamma": [10, 25, 70, 200]}, "need": NEED}


def made(root: Path, tables_: Mapping[str, object]) -> tuple[Store, Plan]:
    """Return a store with the runs of a plan and their table."""
    store, plan = Store.open(root, create=True), Plan.parse(tables_)
    sweep(store, plan)
    solver = plan.solver
    tables.build(store, solver)
    return store, plan


def sweep(store: Store, plan: Plan) -> None:
    with executors.serial() as pool:
        assert run_plan(plan, store, pool).complete


def held_out(root: Path) -> Path:
    box = {"te": {"from": 0.026, "to": 0.055}, "gamma": {"from": 15, "to": 150, "scale": "log"}}
    many = {**SCATTERED, "axes": box, "sampling": {"kind": "sobol", "count": 16, "seed": 5}, "name": "held"}
    sweep(Store.open(root, create=True), Plan.parse(many))
    return root


def refined(
    store: Store, plan: Plan, count: int, held: Path | None = None, propose: Propose = refine.propose
) -> list[Round]:
    with executors.serial() as pool:
        return list(rounds(plan, store, "default", pool, count, "L2nr", held, propose=propose))


def blindly(plan: Plan, state: State, avoid: Sequence[Mapping[str, float]]) -> Iterator[Proposal]:
    """Propose points that fill the table's box, without looking at errors."""
    return refine.propose(plan, replace(state, errors=np.ones_like(state.errors)), avoid)


@pytest.mark.slow
def test_the_error_falls_and_faster_than_without_looking_at_it(site: None, tmp_path: Path) -> None:
    """Over three tables: one alone goes up and down by half while the ridges' turn is not yet enclosed."""
    held = held_out(tmp_path / "held")
    looking, blind = [], []
    for seed in range(3):
        written = {**SCATTERED, "sampling": {"kind": "sobol", "count": 10, "seed": seed}}
        store, plan = made(tmp_path / f"refined{seed}", written)
        other = Store.open(shutil.copytree(store.root, tmp_path / f"blind{seed}"))
        found = refined(store, plan, 12, held)
        assert [one.added for one in found] == list(range(13))
        looking.append([one.held_out or 0.0 for one in found])
        blind.append(refined(other, plan, 12, held, blindly)[-1].held_out or 0.0)
    first, last = np.mean([errors[0] for errors in looking]), np.mean([errors[-1] for errors in looking])
    print(f"refined {first:.3f} to {last:.3f}, without looking at errors to {np.mean(blind):.3f}")
    assert last < 0.75 * first
    assert last < np.mean(blind)


def test_the_same_command_goes_on_and_then_has_nothing_to_do(site: None, tmp_path: Path) -> None:
    store, plan = made(tmp_path / "store", {**SCATTERED, "sampling": {"kind": "sobol", "count": 4}})
    first = refined(store, plan, 2)
    # killed after the runs were asked for, before the table was rebuilt
    state = refine.read(store, "default", "L2nr")
    third = next(refine.propose(plan, state))
    store.ledger.want(refine.with_samples(plan, third.samples).jobs(), refine.name_of(plan))
    # runs to measure by are looked for before anything is run
    with pytest.raises(InvalidOption):
        refined(store, plan, 3, Store.open(tmp_path / "empty", create=True).root)
    assert len(store.ledger.jobs("wanted", refine.name_of(plan))) == 1
    again = refined(store, plan, 3)
    assert [one.added for one in [*first, *again]] == [0, 1, 2, 3]
    assert [one.added for one in refined(store, plan, 3)] == [3]
    assert tables.info(store).samples == 7


def test_a_grid_stays_one(site: None, tmp_path: Path) -> None:
    store, plan = made(tmp_path / "store", GRID)
    (line,) = itertools.islice(refine.propose(plan, refine.read(store, "default", "L2nr")), 1)
    assert len(line.points) in (2, 4)
    found = refined(store, plan, 3)
    assert found[-1].added == 2
    state = refine.read(store, "default", "L2nr")
    assert state.samples.is_grid
    assert len(state.errors) == 10


def test_no_run_is_wasted_on_fruits_that_cannot_exist(site: None, tmp_path: Path) -> None:
    axes = {f"r{i}": {"from": 0.6, "to": 1.2} for i in (3, 4, 5)}
    sampling = {"kind": "sobol", "count": 6, "skip_invalid": True}
    store, plan = made(tmp_path / "store", {**SCATTERED, "axes": axes, "sampling": sampling})
    state = refine.read(store, "default", "rgh")
    found = list(itertools.islice(refine.propose(plan, state), 6))
    assert len({tuple(p.points[0].values()) for p in found}) == 6
    for proposal in found:
        assert plan.solver.parse(proposal.samples[0].model_dump()) == proposal.samples[0]
        for axis, value in proposal.points[0].items():
            low, high = state.table.axes[axis]
            assert low - 1e-9 <= value <= high + 1e-9


def test_a_line_of_a_grid_with_an_impossible_fruit_is_left_out(
    site: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, plan = made(tmp_path / "store", GRID)
    state = refine.read(store, "default", "rgh")
    lines = list(refine.propose(plan, state))
    assert [len(line.samples) for line in lines] == [len(line.points) for line in lines]
    hole = lines[0].points[0]
    parse = refine._parse
    monkeypatch.setattr(refine, "_parse", lambda p, s, node: None if node == hole else parse(p, s, node))
    rest = list(refine.propose(plan, state))
    assert rest == [line for line in lines if hole not in line.points]
    assert len(rest) < len(lines)


def test_a_table_without_its_runs_is_refused_before_any_is_made(site: None, tmp_path: Path) -> None:
    full, plan = made(tmp_path / "full", GRID)
    bare = Store.open(tmp_path / "bare", create=True)
    shutil.copytree(full.tables_dir, bare.tables_dir, dirs_exist_ok=True)
    with pytest.raises(UnknownJob, match="no more samples than it holds"):
        refined(bare, plan, 4)
    assert not list(bare.keys())


def test_plan_and_table_must_fit(site: None, tmp_path: Path) -> None:
    store, plan = made(tmp_path / "store", GRID)
    other = Plan.parse({**GRID, "set": {"rs1": 0.3, "rs2": 0.3}})
    with pytest.raises(MixedSamples, match="no run of the plan"):
        refined(store, other, 2)
    with pytest.raises(PlanError, match="no measure"):
        refine.read(store, "default", "beauty")
    text = 'solver = "ridged"\n[axes]\nte = [0.02, 0.06]\ngamma = [10, 25, 70, 200]\n[need]\nstages = [0.2]\n'
    text += 'quality = "fine"\nfields = ["displacement", "mean_radius"]\n'
    (tmp_path / "grid.toml").write_text(text)
    words = ["refine", str(tmp_path / "grid.toml"), "--store", str(store.root), "--measure", "L2nr", "--json"]
    done = CliRunner().invoke(app, [*words, "--dry-run"])
    assert done.exit_code == 0, done.output
    assert sum(len(proposal["points"]) for proposal in json.loads(done.stdout)["proposals"]) <= 8
    assert tables.info(store).samples == 8
    done = CliRunner().invoke(app, [*words[:-1], "--dry-run", "--count", "1"])
    assert "nothing fits into --count 1 (a grid grows by whole lines: give at least --count 2)" in done.output
    Store.open(tmp_path / "empty", create=True)
    for held in ("empty", "nowhere"):
        wrong = CliRunner().invoke(app, [*words, "--dry-run", "--held-out", str(tmp_path / held)])
        assert wrong.exit_code == 2, held
    between = Store.open(tmp_path / "between", create=True)
    sweep(between, Plan.parse({**GRID, "axes": {"te": [0.03], "gamma": [15, 100]}}))
    done = CliRunner().invoke(app, [*words, "--dry-run", "--held-out", str(between.root)])
    assert done.exit_code == 0, done.output
    said = json.loads(done.stdout)
    assert (said["held_out"], said["held_runs"]) == held_out_error(store, "default", between.root, "L2nr")
    assert said["held_runs"] == 2
    done = CliRunner().invoke(app, [*words, "--count", "2"])
    assert json.loads(done.stdout)["added"] == 2
    assert len(store.ledger.jobs("done", refine.name_of(plan).replace("plan", "grid"))) == 2


@pytest.mark.slow
def test_the_benchmark_on_dried_fruits_works(site: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its command, on a solver with a closed form: every row that the document shows comes out of it."""
    kept: dict[str, Any] = {}

    def plan(name: str, count: int | None = None) -> Plan:
        inside = {"te": {"from": 0.03, "to": 0.05}, "gamma": {"from": 20, "to": 100, "scale": "log"}}
        box = {"axes": inside, "sampling": {"kind": "sobol", "count": count, "seed": 5}} if "held" in name else {}
        return Plan.parse({**SCATTERED, "sampling": {"kind": "sobol", "count": count}, **box}, name)

    def keep(name: str, runs: list[Any], solver: str, **more: Any) -> None:
        kept.update(more, name=name, runs=runs)

    for what, value in (("_plan", plan), ("keep", keep), ("SOLVER", registry.get("ridged"))):
        monkeypatch.setattr(refining, what, value)
    monkeypatch.setattr("sys.argv", ["refining", "--store", str(tmp_path), "--begun=6", "--more=2", "--held=2"])
    refining.main()
    assert kept["name"] == "dehydration-refine"
    assert [(run["way"], run["runs"]) for run in kept["runs"]] == [
        *(("refined", runs) for runs in (6, 7, 8)), *(("Sobol alone", runs) for runs in (6, 7, 8)),
    ]  # fmt: skip
    assert kept["runs"][0]["held_out"] == kept["runs"][3]["held_out"] > 0
    assert all(kept["table"]["rows"][0][1:])
