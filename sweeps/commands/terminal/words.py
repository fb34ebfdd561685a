"""What runs and sweeps say: as plain documents for `--json`, and as tables for people."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...planning.plan import Plan
from ...running.report import Report
from .console import grid

__all__ = ["failed", "per_stage", "readers", "report_document", "short", "show_report", "show_run"]


def short(value: Any) -> str:
    """Return a number, a word, a list or a group of them in a few characters."""
    if isinstance(value, Mapping):
        return f"{{{len(value)} values}}"
    if isinstance(value, list | tuple):
        return f"[{','.join(map(short, value))}]"
    return f"{value:g}" if isinstance(value, int | float) and not isinstance(value, bool) else str(value)


def per_stage(result: Any) -> dict[str, Any]:
    """Return the numbers of each stage with their units and names in words."""
    return {
        str(name): {
            "units": variable.attrs.get("units", ""),
            "long_name": variable.attrs.get("long_name", ""),
            "values": variable.values.tolist(),
        }
        for name, variable in result.data_vars.items()
        if variable.dims == ("stage",)
    }


def show_run(console: Any, document: Mapping[str, Any], symbol: str) -> None:
    """Print a run's numbers, one column per stage."""
    head = ["", *(f"{symbol} = {stage:g}" for stage in document["stages"])]
    rows = [
        [f"{name} [{d['units']}]" if d["units"] not in ("", "1") else name, *(_cell(v) for v in d["values"])]
        for name, d in document["descriptors"].items()
    ]
    grid(console, head, rows)
    if document.get("note"):
        console.print(document["note"], markup=False)
    console.print(f"{document['seconds']:.1f} s, key {document['key'][:12]}, digest {document['digest'][:12]}")
    if document["path"]:
        console.print(f"written to {document['path']}", markup=False)


def _cell(value: Any) -> str:
    return str(value) if isinstance(value, bool | int) else f"{value:.4g}"


def readers(plan: Plan) -> dict[str, Callable[[Mapping[str, Any]], str]]:
    """Return, per swept name, how to read it from a job's parameters."""

    def reader(name: str) -> Callable[[Mapping[str, Any]], str]:
        field, index = plan.solver.params.axes.get(name, (name, None))
        return lambda params: f"{params[field] if index is None else params[field][index]:g}"

    numeric = [n for n in plan.axes if n in plan.solver.params.axes or n == "seed"]
    return {name: reader(name) for name in numeric}


def report_document(report: Report) -> dict[str, Any]:
    """Return what a sweep achieved, as plain values."""
    return asdict(report) | {"complete": report.complete}


def failed(key: str, which: str, error: Mapping[str, Any], store: Path) -> str:
    """Return what became of a job that was given up, and where the stages are that it settled before."""
    kept = f"Stages settled before: {store / error['partial']}" if error.get("partial") else ""
    said = " ".join(filter(None, (error.get("message"), error.get("advice"), kept)))
    return f"{key[:12]}{f' ({which})' if which else ''}: {said}"


def show_report(console: Any, report: Report, store: Path, plan: Plan, source: str = "") -> None:
    """Print what a sweep achieved, and what to do next: a table of its shapes, where they are ones to interpolate.

    source: what `--plan` is told where the store holds more than the plan's results.
    """
    for failure in report.failed:
        which = " ".join(f"{name}={read(failure.params)}" for name, read in readers(plan).items())
        console.print(f"failed {failed(failure.key, which, failure.error, store)}", markup=False)
    parts = [f"{report.solved} solved", f"{report.reused} stored before"]
    parts += [
        f"{count} {word}"
        for word, count in (
            ("failed", len(report.failed)),
            ("waiting", report.waiting),
            ("cancelled", report.cancelled),
        )
        if count
    ]
    console.print(f"{report.plan}: {', '.join(parts)} of {report.total}, in {report.seconds:.1f} s")
    if report.complete:
        only = f" --plan {shlex.quote(source)}" if source else ""
        console.print(f"next: wizen table build --store {shlex.quote(str(store))}{only}", markup=False)
    elif report.solved or report.reused:
        console.print(
            f"next: wizen results --store {shlex.quote(str(store))} --solver {plan.solver.name}", markup=False
        )
