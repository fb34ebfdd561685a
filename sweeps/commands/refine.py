"""The command `wizen refine`: next samples where a table predicts worst."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .terminal.console import emit, grid, note
from .terminal.grouped import grouped
from .terminal.options import As_json, StorePath, TableName

if TYPE_CHECKING:
    from ..refining.rounds import Round

__all__ = ["add_to"]


def add_to(app: typer.Typer) -> None:
    """Add the command of this module to the root command."""
    app.command()(refine)


@dataclass(frozen=True)
class _Asked:
    """What `wizen refine` is told."""

    plan: Annotated[Path, typer.Argument(metavar="PLAN", help="The plan that the table was built from.")]
    store: StorePath
    name: TableName = "default"
    count: Annotated[int, typer.Option("--count", min=1, help="Runs to add in all, earlier ones counted.")] = 8
    measure: Annotated[
        str, typer.Option("--measure", help="The error to bring down: rgh, dB, W1, patch, L2nr, ang or corr.")
    ] = "W1"
    held_out: Annotated[
        Path | None, typer.Option("--held-out", metavar="PLAN|STORE", help="Runs to measure the error by, as well.")
    ] = None
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be run, and stop.")] = False
    workers: Annotated[int | None, typer.Option("--workers", help="Local processes; each round fills them.")] = None
    dask: Annotated[bool, typer.Option("--dask", help="Let Dask run the local processes.")] = False
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", metavar="ADDRESS", help="A running Dask scheduler.")
    ] = None
    as_json: As_json = False


@grouped(_Asked)
def refine(asked: _Asked) -> None:
    """Add samples to a table where it predicts worst: run them, rebuild it, and say how the error falls.

    Each sample is predicted from the others; the next one goes where that error times the distance to the samples is
    largest, and where the solver accepts the shape. A grid gets whole lines, so that it stays one. Stop it at any
    time: the same command goes on where it stopped, and is done when --count runs were added.

    [bold]Examples[/bold]

    wizen refine examples/fig7-right.toml --store demo --dry-run

    wizen refine big.toml --store demo --count 20 --workers 4 --held-out other-store
    """
    from store import tables
    from store.store import Store

    from ..planning.plan import Plan
    from ..refining import refine as refining
    from ..refining.rounds import held_out_error, rounds
    from ..running import executors
    from .terminal import progress
    from .terminal.words import readers

    read, opened, measure = Plan.load(asked.plan), Store.open(asked.store), asked.measure
    if asked.dry_run:
        refining.check(read, tables.info(opened, asked.name))
        tables.check_grows(opened, tables.info(opened, asked.name))
        state = refining.read(opened, asked.name, measure)
        error = None if asked.held_out is None else held_out_error(opened, asked.name, asked.held_out, measure)
        proposals = list(itertools.islice(refining.propose(read, state), max(asked.count, _LOOKED_AT)))
        _show_proposals(proposals, state, error, asked)
        return
    done: list[Round] = []
    with executors.choose(asked.workers, asked.dask, asked.scheduler) as pool:
        note(f"{read.name}: up to {asked.count} runs more on {pool.title}, where {measure} is worst")
        with (
            progress.stopping(progress.GIVEN_BACK) as stop,
            progress.sweep(refining.name_of(read), readers(read)) as observe,
        ):
            for found in rounds(read, opened, asked.name, pool, asked.count, measure, asked.held_out, observe, stop):
                done.append(found)
                held = "" if found.held_out is None else f", held out {found.held_out:.4g} ({found.held_runs} runs)"
                note(f"{found.added} added: {measure} left out {found.left_out:.4g}{held}")
    failed = sum(one.failed for one in done)
    document = {
        "table": asked.name,
        "measure": measure,
        "added": done[-1].added if done else 0,
        "failed": failed,
        "rounds": [one._asdict() for one in done],
    }
    emit(document, asked.as_json, lambda console: _show_rounds(console, done, asked, failed, stop.is_set()))
    if stop.is_set():
        raise typer.Exit(130)
    if failed:
        raise typer.Exit(1)


#: Proposals that a dry run looks at, at least: the first lines of a grid may be too long for what was asked for.
_LOOKED_AT = 16


def _show_rounds(console: Any, done: list[Round], asked: _Asked, failed: int, stopped: bool) -> None:
    head = ["added", "at", f"{asked.measure} left out"] + ["held out", "runs"] * (asked.held_out is not None)
    rows = []
    for one in done:
        at = "; ".join(_place(point) for point in one.points) or "-"
        held = [] if one.held_out is None else [f"{one.held_out:.4g}", str(one.held_runs)]
        rows.append([str(one.added), at, f"{one.left_out:.4g}", *held])
    grid(console, head, rows)
    if stopped:
        console.print("stopped: the same command goes on from here", markup=False)
    elif failed:
        console.print(f"{failed} runs failed: `wizen status` says why", markup=False)
    elif (done[-1].added if done else 0) < asked.count:
        console.print("nothing more fits into --count (a grid grows by whole lines)", markup=False)


def _show_proposals(found: list[Any], state: Any, held: tuple[float, int] | None, asked: _Asked) -> None:
    measure, left, kept = asked.measure, asked.count, []
    for proposal in found:
        if len(proposal.points) <= left:
            kept.append(proposal)
            left -= len(proposal.points)
    document = {
        "table": state.table.name,
        "measure": measure,
        "left_out": state.mean,
        **({} if held is None else {"held_out": held[0], "held_runs": held[1]}),
        "proposals": [{"points": list(p.points), "error": p.expected} for p in kept],
    }

    def show(console: Any) -> None:
        also = "" if held is None else f", held out {held[0]:.4g} ({held[1]} runs)"
        console.print(f"table {state.table.name}: {measure} left out {state.mean:.4g}{also}", markup=False)
        if not kept:
            fewest = min((len(p.points) for p in found), default=0)
            advice = f"a grid grows by whole lines: give at least --count {fewest}" if fewest else "no fruit is missing"
            console.print(f"nothing fits into --count {asked.count} ({advice})", markup=False)
            return
        grid(
            console,
            ["runs", "at", f"{measure} around"],
            [[str(len(p.points)), "; ".join(_place(q) for q in p.points), f"{p.expected:.4g}"] for p in kept],
        )

    emit(document, asked.as_json, show)


def _place(point: dict[str, float]) -> str:
    return ", ".join(f"{axis} = {value:g}" for axis, value in point.items())
