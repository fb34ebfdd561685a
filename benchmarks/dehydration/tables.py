"""The tables of docs/dehydration.md, made of the records of `benchmarks.dehydration`."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from benchmarks.figures import Row, markdown

from . import balance
from .claims import controls, jumps
from .precision import order
from .precision.buckled import STAGES, kind, summary
from .precision.spheres import SHIPPED, ratios
from .stress import onward

__all__ = ["table"]

#: Skins from which a fruit counts as thick.
_THICK = 0.1
#: Seconds of the paper's own run.
_PAPER = 7200.0
_CODES = {
    "meridional": "ours, meridional",
    "implicit": "ours, implicit",
    "explicit": "ours, explicit, whole sphere",
    "felupe": "FElupe {} Q1/P0",
    "calculix": "CalculiX {} C3D8",
    "ngsolve": "NGSolve {} Q2/P1d",
    "dolfinx": "dolfinx {} Q2/P1d",
}


def table(record: Row, part: str = "") -> str:
    """Return the table of that record and part."""
    makers: dict[str, Callable[[Row], str]] = {
        "dehydration-spheres": lambda r: _spheres(r, 0.95),
        "dehydration-spheres past": _best,
        "dehydration-claims": _claims,
        "dehydration-onset roads": _roads,
        "dehydration-onset fruits": _fruits,
        "dehydration-onset-full": _full,
        "dehydration-buckled whole": _whole,
        "dehydration-buckled eighths": _eighths,
        "dehydration-buckled merging": _merging,
        "dehydration-scaling": _scaling,
        "dehydration-speed": _speed,
        "dehydration-skips": _skips,
        "dehydration-settling changed": _changed,
        "dehydration-settling thick": _thick,
        "dehydration-onward fruits": onward.table,
        "dehydration-meshes": order.table,
        "dehydration-controls": controls.table,
        "dehydration-jumps": jumps.table,
        "dehydration-score": balance.table,
    }
    return makers[f"{record['name']} {part}".strip()](record)


def _four(values: Sequence[float], form: str = "{:.4f}") -> str:
    return " ".join(form.format(value).removeprefix("0") for value in values)


def _part(seconds: float) -> str:
    times = _PAPER / seconds
    return f"1/{round(times, 1 - int(math.log10(times))):.0f}"


def _depth(values: Sequence[float]) -> str:
    return f"{max(values):.1g}" if max(values) > 0 else "0"


def _share(values: Sequence[float]) -> str:
    return " ".join(f"{100 * value:+.0f}" for value in values) + " %"


def _claims(record: Row) -> str:
    """The clauses, and what runs they are judged by."""
    every = {run["key"]: run for run in record["runs"]}  # plans share some
    runs = [run for run in every.values() if "missing" not in run]
    of = [sorted({run[name] for run in runs}) for name in ("quality", "seed")]
    qualities, seeds = (", ".join(map(str, values)) for values in of)
    said = (
        f"{len(runs)} of {len(every)} parts of fruits at {qualities}, "
        f"seeds {seeds}, came to s = {record['stage']}. "
        f"{sum(not run['converged'] for run in runs)} did not converge there (largest residual "
        f"{max(run['residual'] for run in runs):.1e}), the deepest penetration is "
        f"{max(run['penetration'] for run in runs):.2g} te."
    )
    return f"{markdown(record['clauses']['head'], record['clauses']['rows'])}\n\n{said}"


_ROADS = {
    "radial": ("concentric spheres", "one dimension per degree"),
    "meridional": ("r4 = r8", "Q2 in the meridional plane per azimuthal wavenumber"),
    "full": ("any", "Q2 between symmetry planes, all parities, Lanczos"),
}


def _roads(record: Row) -> str:
    """Each road with the cases that it was tried on, seconds from the fastest to the slowest, and its worst error."""
    lines = []
    for road, (shapes, method) in _ROADS.items():
        own = [row for row in record["runs"] if row["road"] == road]
        if own:
            seconds = sorted(row["seconds"] for row in own)
            worst = max((row["error"] for row in own), key=abs)
            took = f"{seconds[0]:.2g} to {seconds[-1]:.2g}" if len(own) > 1 else f"{seconds[0]:.2g}"
            lines.append([road, shapes, method, str(len(own)), took, f"{worst:+.1e}"])
    return markdown(("road", "fruits", "method", "spheres tried", "seconds", "worst error of s_cr"), lines)


def _fruits(record: Row) -> str:
    exact = {row["preset"]: row for row in record["fruits"] if row["method"] == "exact"}
    linear = {row["preset"]: row for row in record["fruits"] if row["method"] == "linear"}
    lines = [
        [
            name, f"{row['s_cr']:.4f}", str(row["wavenumber"]), str(row["degree"]), f"{row['seconds']:.2g}",
            f"{linear[name]['s_cr']:.4f} ({100 * (linear[name]['s_cr'] / row['s_cr'] - 1):+.0f} %)",
            str(linear[name]["degree"]),
        ]
        for name, row in exact.items()
    ]  # fmt: skip
    return markdown(("fruit", "s_cr", "m", "degree", "seconds", "Eq. 11", "its degree"), lines)


def _speed(record: Row) -> str:
    """What each run took, by element and step, the shares of its parts, and what a second thread gains."""
    lines, alone = [], {}
    for row in record["runs"]:
        if row["threads"] == 1:
            alone[row["quality"], row["te"], row["mirrors"]] = row["seconds"]
    for row in record["runs"]:
        shares = [f"{100 * part / row['seconds']:.0f} %" for part in row["parts"].values()]
        part = "eighth" if row["mirrors"] == "xyz" else "whole"
        settled = f"{sum(row['converged'])} of {len(row['converged'])}"
        name = f"{row['quality']}, te {row['te']:g}, {part}"
        one = alone.get((row["quality"], row["te"], row["mirrors"])) if row["threads"] > 1 else None
        lines.append(
            [
                name, str(row["threads"]), str(row["elements"]), str(row["steps"]), f"{row['seconds']:.3g}",
                f"{max(row['rounds']):.3g}", _part(row["seconds"]),
                "" if one is None else f"{one / row['seconds']:.2f}", f"{row['cpu']:.3g}",
                f"{1e9 * row['cpu'] / (row['steps'] * row['elements']):.0f}", *shares, settled,
            ]
        )  # fmt: skip
    head = (
        *("run", "threads", "elements", "steps", "seconds", "slowest", "of 7200 s", "over one thread"),
        "processor seconds", "ns per element and step",
    )  # fmt: skip
    return markdown((*head, *record["runs"][0]["parts"], "stages settled"), lines)


def _full(record: Row) -> str:
    """Spheres with their error, and fruits of any shape with what a finer mesh makes of them where it was run."""
    fine = {row["fruit"]: row["s_cr"] for row in record["runs"] if row["quality"] == "fine"}
    lines = []
    for row in record["runs"]:
        finer = fine.get(row["fruit"]) if row["quality"] != "fine" else None
        against = "" if finer is None else f"{100 * (row['s_cr'] / finer - 1):+.2f} % (fine)"
        off = f"{100 * row['error']:+.2f} %" if row["error"] is not None else against
        size, exact = row["settings"], row.get("exact_degree", row["degree"])
        degree = f"{row['degree']}" + f" (exact: {exact})" * (exact != row["degree"])
        lines.append(
            [
                row["fruit"], row["quality"], f"{row['s_cr']:.5f}", off, degree, str(size["stacks"]),
                str(size["unknowns"]), f"{row['seconds']:.0f}", f"{row['cpu']:.0f}",
            ]
        )  # fmt: skip
    head = ("fruit", "quality", "s_cr", "off by", "degree", "columns", "unknowns", "seconds", "processor seconds")
    return markdown(head, lines)


def _whole(record: Row) -> str:
    rows = _measured(record, "")
    lines = []
    for row in rows:
        name = [f"{row['gamma']:g}", f"{row['quality']}, {row['seed']}"]
        if "failed" in row:
            lines.append([*name, row["failed"], *[""] * 8])
            continue
        same = [other for other in rows if other["gamma"] == row["gamma"] and "failed" not in other]
        fine = [other["roughness"] for other in same if other["quality"] == "fine"]
        off = [x / statistics.mean(truth) - 1 for x, *truth in zip(row["roughness"], *fine, strict=True)]
        missed = [f"{s:g}" for s, fine in zip(STAGES, row["converged"], strict=True) if not fine]
        lines.append(
            [
                *name, f"{row['elements']:,}", f"{row['steps']:,}", _four(row["cpu"], "{:.0f}"),
                _four(row["roughness"]), _share(off), _four(row["buckle_count"], "{:.0f}"),
                _four(row["residual"], "{:.1e}"), ", ".join(missed) or "none",
                f"{row['least_jacobian'][-1]:.2f}", _depth(row["penetration"]),
            ]
        )  # fmt: skip
    head = ("gamma", "quality, seed", "elements", "steps", "CPU s to each stage", "roughness [r1]")
    return markdown(
        (*head, "against fine's mean", "buckles", "residual", "not converged at s =", "least J", "deepest [te]"), lines
    )


def _merging(record: Row) -> str:
    """How many buckles there are at each stage, and in how many runs they are fewer at the end than at the start."""
    rows = [row for mirrors in ("", "xyz") for row in _measured(record, mirrors) if "failed" not in row]
    lines = []
    for te, gamma, mirrors, quality in dict.fromkeys((*kind(row), row["quality"]) for row in rows):
        runs = [row["buckle_count"] for row in rows if (*kind(row), row["quality"]) == (te, gamma, mirrors, quality)]
        change = [run[-1] / run[0] - 1 for run in runs]
        counts = [f"{statistics.mean(at):.3g}" for at in zip(*runs, strict=True)]
        spread = f" +- {50 * (max(change) - min(change)):.0f}" if len(change) > 1 else ""
        lines.append(
            [
                f"{te:g}", f"{gamma:g}", "eighth" if mirrors else "whole", f"{quality}, {len(runs)}", *counts,
                f"{100 * statistics.mean(change):+.0f}{spread} %", f"{sum(c < 0 for c in change)} of {len(runs)}",
            ]
        )  # fmt: skip
    stages = [f"s = {s:g}" for s in STAGES]
    return markdown(("te", "gamma", "part", "quality, seeds", *stages, "first to last", "fewer in"), lines)


def _eighths(record: Row) -> str:
    rows = _measured(record, "xyz")
    lines = []
    groups = list(dict.fromkeys((*kind(row), row["quality"]) for row in rows))
    means = summary(record["runs"], record["version"])
    for te, gamma, mirrors, quality in sorted(groups, key=lambda g: (-g[0], g[1])):
        same = [row for row in rows if (*kind(row), row["quality"]) == (te, gamma, mirrors, quality)]
        found = [row for row in means if (*kind(row), row["quality"]) == (te, gamma, mirrors, quality)]
        missed = sum(len(STAGES) - sum(row["converged"]) for row in same)
        off = "" if found[0]["reference"] == quality else _share([row["roughness"]["error"] for row in found])
        lines.append(
            [
                f"{te:g}" + (f", gamma {gamma:g}" if gamma != 10 else ""), f"{quality}, {len(same)}",
                f"{same[0]['elements']:,}", _four([row["cpu"] for row in found], "{:.0f}"),
                _four([row["roughness"]["mean"] for row in found]), off, f"{missed} of {len(same) * len(STAGES)}",
                _depth([depth for row in same for depth in row["penetration"]]), _part(found[-1]["cpu"]),
                f"{max(row['peak_MB'] for row in same):.0f}",
            ]
        )  # fmt: skip
    head = ("te", "quality, seeds", "elements", "CPU s to each stage", "roughness [r1]", "against fine's mean")
    return markdown((*head, "stages not converged", "deepest [te]", f"of {_PAPER:.0f} s", "peak MB"), lines)


def _measured(record: Row, mirrors: str) -> list[Row]:
    order = {"preview": 0, "default": 1, "fine": 2}
    rows = [row for row in record["runs"] if row["version"] == record["version"] and row["mirrors"] == mirrors]
    return sorted(rows, key=lambda row: (-row["te"], row["gamma"], order[row["quality"]], row["seed"]))


def _spheres(record: Row, theta: float) -> str:
    rows = [row for row in record["runs"] if row["theta"] == theta]
    over = {(row["code"], row["mesh"]): row["over_implicit"] for row in ratios(rows)}
    lines = []
    for row in rows:
        name = _CODES[row["code"]].format(row.get("version", "")) + (
            " (default)" * (SHIPPED.get(row["code"]) == row["mesh"])
        )
        if "failed" in row:
            lines.append([name, row["mesh"], "", "", row["failed"], "", ""])
            continue
        times = over.get((row["code"], row["mesh"]))
        lines.append(
            [
                name, row["mesh"], f"{row['unknowns']:,}", f"{row['cpu']:.2f}", f"{row['error_radial_reference']:.1e}",
                f"{row['error_closed_form']:.1e}", f"{times:.1f}" if times else "",
            ]
        )  # fmt: skip
    return markdown(("code", "mesh", "unknowns", "CPU s", "error", "against closed form", "over ours"), lines)


def _best(record: Row) -> str:
    rows = [row for row in record["runs"] if row["theta"] == 0.9]
    lines = []
    for code, name in _CODES.items():
        good = [row for row in rows if row["code"] == code and "failed" not in row]
        failed = [row["mesh"] for row in rows if row["code"] == code and "failed" in row]
        if good:
            best = min(good, key=lambda row: float(row["error_radial_reference"]))
            cells = [name.format(best.get("version", "")), best["mesh"], f"{best['error_radial_reference']:.1e}"]
            lines.append([*cells, f"{best['cpu']:.2f}", ", ".join(failed) or "none"])
    return markdown(("code", "its best mesh", "error", "CPU s", "meshes that failed"), lines)


def _scaling(record: Row) -> str:
    lines = [
        [f"{row['elements']:,}", str(row["steps"]), f"{row['cpu']:.2f}", f"{row['us_per_element_step']:.3f}"]
        for row in record["runs"]
    ]
    made = markdown(("elements", "steps", "CPU s", "CPU-us per element-step"), lines)
    step, march = record["slope_of_a_step"], record["slope_of_the_march"]
    return f"{made}\n\nA step costs elements^{step:.2f}, the march elements^{march:.2f}."


def _skips(record: Row) -> str:
    lines = []
    for row in record["runs"]:
        if "failed" in row:
            lines.append([row["what"], row.get("instead_of", ""), row["failed"], ""])
            continue
        cost = f"{row['cpu_full']:.3g} to {row['cpu']:.3g}"
        if "MB" in row:
            cost += f", {1e3 * row['MB_full']:.3g} to {1e3 * row['MB']:.3g} kB"
        lines.append([row["what"], row["instead_of"], cost, _added(row)])
    return markdown(("asked for", "instead of", "CPU s", "error added"), lines)


def _added(row: dict[str, Any]) -> str:
    if row["error"] == 0:
        return "none"
    relative = row["error_is"].startswith("relative")
    return f"{100 * row['error']:+.0f} %, {row['error_is']}" if relative else f"{row['error']:.1e}, {row['error_is']}"


def _changed(record: Row) -> str:
    """Steps over those of things as they are, a seed each, by change and case, and the roughness over theirs."""
    cases: dict[str, dict[str, list[Row]]] = {}
    for run in record["runs"]:
        if run["te"] < _THICK:
            case = f"{run['quality']}, te {run['te']:g}, gamma {run['gamma']:g}"
            cases.setdefault(case, {}).setdefault(run["changed"], []).append(run)
    as_it_is, *changes = next(iter(cases.values()))
    lines = [["as it is: steps", *(_seeds(f"{r['steps']:,}" for r in case[as_it_is]) for case in cases.values()), ""]]
    for change in changes:
        pairs = [list(zip(case[change], case[as_it_is], strict=True)) for case in cases.values()]
        steps = [_seeds(f"{a['steps'] / b['steps']:.2f}{_missed(a)}" for a, b in case) for case in pairs]
        # at the first stage buckles have only begun to grow
        rough = [
            x / y
            for case in pairs
            for a, b in case
            for x, y in zip(a["roughness"][1:], b["roughness"][1:], strict=True)
        ]
        lines.append([change, *steps, f"{min(rough):.2f} to {max(rough):.2f}"])
    stages = ", ".join(f"{s:g}" for s in record["runs"][0]["stages"][1:])
    return markdown(("changed", *cases, f"roughness at s = {stages}"), lines)


def _seeds(said: Iterable[str]) -> str:
    return ", ".join(said)


def _missed(run: Row) -> str:
    return "" if run["ends"] == "settled" else f" ({run['ends']})"


def _thick(record: Row) -> str:
    """The last stage that each thick skin comes to, and what ends it there."""
    cases: dict[tuple[float, float], list[Row]] = {}
    for run in record["runs"]:
        if run["te"] >= _THICK:
            cases.setdefault((run["te"], run["gamma"]), []).append(run)
    lines = []
    for (te, gamma), runs in cases.items():
        ends = [f"{run['stages'][-1]:g}{'' if run['ends'] == 'settled' else ' (' + run['ends'] + ')'}" for run in runs]
        lines.append([f"{te:g}", f"{gamma:g}", _seeds(ends)])
    return markdown(("te", "gamma", "last stage, a seed each"), lines)
