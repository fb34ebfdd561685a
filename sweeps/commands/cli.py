"""The `wizen` command below HTTP: presets, solve, sweep, status, and the commands about tables.

Nothing heavy is imported before a command runs: `wizen --help` must answer at once.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from solver import __version__

from . import copies as cli_copies
from . import onset as cli_onset
from . import presets as cli_presets
from . import queue as cli_queue
from . import refine as cli_refine
from . import results as cli_results
from . import session as cli_session
from . import shapes as cli_shapes
from . import solve as cli_solve
from . import tables as cli_tables
from .terminal.console import Root, emit, grid, note
from .terminal.options import (
    As_json,
    Most_seconds,
    StorePath,
)
from .terminal.tables import begin_store

__all__ = ["app"]

app = typer.Typer(
    name="wizen",
    cls=Root,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"wizen {__version__}")
        raise typer.Exit


@app.callback(
    epilog="First steps: wizen sweep examples/fig7-right.toml --store demo; wizen table build --store demo; "
    "wizen map --store demo --out map.png; wizen serve --store demo"
)
def root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Physically based wrinkling as shapes that can be asked for: solve, sweep, look up, serve."""


cli_presets.add_to(app)
cli_solve.add_to(app)
cli_session.add_to(app)


@app.command()
def sweep(
    plan: Annotated[Path, typer.Argument(metavar="PLAN", help="A plan file (TOML); examples/ holds some.")],
    store: StorePath,
    workers: Annotated[int | None, typer.Option("--workers", help="Local processes; they share the cores.")] = None,
    dask: Annotated[bool, typer.Option("--dask", help="Let Dask run the local processes, with its dashboard.")] = False,
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", metavar="ADDRESS", help="A running Dask scheduler.")
    ] = None,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Try again what was given up.")] = False,
    max_seconds: Most_seconds = None,
    as_json: As_json = False,
) -> None:
    """Run all jobs of a plan. Stop it at any time: the same command goes on where it stopped.

    [bold]Examples[/bold]

    wizen sweep examples/fig7-right.toml --store demo

    wizen sweep examples/fig7-right.toml --store demo --workers 4

    wizen sweep big.toml --store /shared/fruits --scheduler tcp://10.0.0.1:8786
    """
    from ..planning.afford import afford
    from ..planning.plan import Plan
    from ..running import executors
    from ..running.runner import run_parts
    from .terminal import progress
    from .terminal.words import readers, report_document, show_report

    read, text = Plan.read(plan)
    if max_seconds is not None:
        afford(read, store, max_seconds, scheduler, workers or 1)
    with executors.choose(workers, dask, scheduler) as pool:
        opened = begin_store(store)
        opened.keep_plan(read.name, text)
        left_out = f", {read.skipped} impossible ones left out" if read.skipped else ""
        note(f"{read.name}: {len(read.samples)} jobs on {pool.title}{left_out}")
        with progress.stopping(progress.GIVEN_BACK) as stop:
            reports = run_parts(
                read, opened, pool, lambda part: progress.sweep(part.name, readers(part)), stop=stop, again=retry_failed
            )
    report = next((r for r in reports if r.plan == read.name), reports[-1])
    document = report_document(report) | {"store": str(store), "skipped": read.skipped, "repeated": read.repeated}
    document["parts"] = [report_document(r) for r in reports]

    own = {job.key for part in (read.first, read) if part is not None for job in part.jobs()}
    # a name stands for all that was ever swept under it
    source = str(plan) if plan.suffix == ".toml" else read.name
    alone = all(key in own for key in iter(opened.keys()))
    emit(document, as_json, lambda console: show_report(console, report, store, read, "" if alone else source))
    if any(r.stopped for r in reports):
        raise typer.Exit(130)
    if not all(r.complete for r in reports):
        raise typer.Exit(1)


@app.command()
def status(store: StorePath, as_json: As_json = False) -> None:
    """Say how far the jobs of a store are, what failed and why, and which tables there are.

    [bold]Examples[/bold]

    wizen status --store demo

    wizen status --store demo --json | jq '.failed[].error'
    """
    from store import scalars
    from store.store import Store

    from ..running.place import is_lost
    from .terminal.words import failed as told

    opened = Store.open(store)
    running, failed = opened.ledger.jobs("running"), opened.ledger.jobs("failed")
    counts = opened.ledger.counts()
    document = {
        "store": str(store),
        "jobs": counts,
        "results": len(list(opened.keys())),
        "running": [
            {"key": j.key, "plan": j.plan, "worker": j.worker, "progress": j.progress, "lost": is_lost(j)}
            for j in running
        ],
        "failed": [{"key": j.key, "plan": j.plan, "params": dict(j.params), "error": j.error} for j in failed],
        "tables": (shapes := opened.table_names()),
        "scalars": (tabulated := scalars.names(opened)),
    }

    def show(console: Any) -> None:
        grid(console, list(counts), [[str(count) for count in counts.values()]], f"jobs in {store}")
        for j in running:
            gone = ": its runner is gone, the next one goes on with it" if is_lost(j) else ""
            console.print(f"running {j.key[:12]} {j.progress:4.0%} {j.plan}{gone}", markup=False)
        for j in failed:
            console.print(f"failed  {told(j.key, j.plan, j.error or {}, store)}", markup=False)
        console.print(
            f"{document['results']} results, tables of shapes: {', '.join(shapes) or 'none'}, "
            f"of numbers: {', '.join(tabulated) or 'none'}",
            markup=False,
        )

    emit(document, as_json, show)


cli_refine.add_to(app)
cli_onset.add_to(app)
cli_queue.add_to(app)
cli_copies.add_to(app)
cli_results.add_to(app)
cli_tables.add_to(app)
cli_shapes.add_to(app)
