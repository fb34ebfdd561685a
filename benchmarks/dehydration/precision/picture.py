"""The work-precision diagram: error over CPU seconds, one line per code, shipped settings ringed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullFormatter

from .buckled import kind
from .record import Row
from .spheres import SHIPPED

#: Code -> label, colour, marker; ours are drawn thicker.
CODES = {
    "meridional": ("ours, meridional Q2", "#08519c", "o"),
    "implicit": ("ours, implicit Q2", "#2b8cbe", "s"),
    "explicit": ("ours, explicit Q1", "#74a9cf", "D"),
    "felupe": ("FElupe Q1", "#e6550d", "^"),
    "calculix": ("CalculiX C3D8", "#756bb1", "v"),
    "ngsolve": ("NGSolve Q2", "#31a354", "<"),
    "dolfinx": ("dolfinx Q2", "#a63603", ">"),
}
QUALITIES = {"preview": ("#74a9cf", "o"), "default": ("#2b8cbe", "s"), "fine": ("#08519c", "D")}
INK = "#333333"


def draw(parts: Mapping[str, Any], path: Path) -> None:
    """Draw the spheres at both shrinkages, and below them the descriptors after buckling as far as measured."""
    after = parts.get("buckled_summary", [])
    thetas = sorted({row["theta"] for row in parts.get("spheres", [])}, reverse=True)
    kinds = sorted({kind(row) for row in after}, key=lambda k: (-k[0], *k[1:]))
    kinds = [one for one in kinds if len({row["quality"] for row in after if kind(row) == one}) > 1]
    count = len(thetas) + len(kinds)
    panels = min(count, 3)
    rows = -(-count // panels)
    figure, grid = plt.subplots(rows, panels, figsize=(5.0 * panels, 4.6 * rows), layout="constrained", squeeze=False)
    axes = grid.ravel()
    for at, theta in zip(axes, thetas, strict=False):
        _spheres(at, [row for row in parts["spheres"] if row["theta"] == theta and "failed" not in row], theta)
    for at in axes[1 : len(thetas)]:
        at.sharey(axes[0])
    for at, one in zip(axes[len(thetas) :], kinds, strict=False):
        _buckled(at, [row for row in after if kind(row) == one])
    for at in axes.flat:
        at.set_visible(at.has_data())
    handles, labels = axes[0].get_legend_handles_labels()
    columns = min(len(labels) + 1, 3 * panels - 1)
    ring = Line2D([], [], ls="", marker="o", mfc="none", mec=INK, ms=11, label="shipped setting")
    figure.legend(
        [*handles, ring], [*labels, "shipped setting"], loc="outside lower center", ncols=columns,
        fontsize=9, frameon=False, handlelength=1.8,
    )  # fmt: skip
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _spheres(at: Axes, rows: Sequence[Row], theta: float) -> None:
    for code, (label, colour, marker) in CODES.items():
        points = sorted((row["cpu"], row["error_radial_reference"]) for row in rows if row["code"] == code)
        if not points:
            continue
        ours = label.startswith("ours")
        at.loglog(*zip(*points, strict=True), color=colour, marker=marker, label=label, ms=5, lw=2.2 if ours else 1.2)
        shipped = [row for row in rows if row["code"] == code and row["mesh"] == SHIPPED.get(code)]
        for row in shipped:
            at.plot(row["cpu"], row["error_radial_reference"], "o", mfc="none", mec=INK, ms=12, mew=1.2)
    where = "before buckling" if theta > 0.92 else "unstable smooth branch"
    _dress(at, f"Sphere at s = {1 - theta:.2g}, {where}", "largest error of the radius [r1]")


def _buckled(at: Axes, rows: Sequence[Row]) -> None:
    """Draw means over seeds as deviations from the reference's, with half the range of seeds as bars."""
    te, gamma, mirrors = kind(rows[0])
    part = {"": "whole", "xyz": "eighth"}.get(mirrors, "part")
    for quality, (colour, marker) in QUALITIES.items():
        chosen = [row for row in rows if row["quality"] == quality]
        if not chosen:
            continue
        cpu = [row["cpu"] for row in chosen]
        for name, filled in (("roughness", True), ("dominant_degree", False)):
            error = [100 * row[name]["error"] for row in chosen]
            at.errorbar(
                cpu, error, [100 * row[name]["half_range_relative"] for row in chosen],
                color=colour, marker=marker, ms=6, lw=1.8 if filled else 1.2, ls="-" if filled else "--",
                mfc=colour if filled else "white", capsize=3, elinewidth=1,
            )  # fmt: skip
            if filled:
                for x, y, row in zip(cpu, error, chosen, strict=True):
                    beside = (12 if row is chosen[-1] else -9, 6)
                    label = f"{row['stage']:g}"
                    at.annotate(label, (x, y), beside, textcoords="offset points", size=8, ha="center", color=colour)
    reference = rows[0]["reference"]
    at.axhline(0, color=INK, lw=0.8)
    at.set_xscale("log")
    at.margins(x=0.09, y=0.08)
    _dress(
        at,
        f"Buckled, {part}, te {te:g}, gamma {gamma:g} (numbers: s)",
        f"mean over seeds against {reference} [%]",
    )
    shown = [
        Line2D([], [], color=colour, marker=marker, label=f"{quality}, {_seeds(rows, quality)}")
        for quality, (colour, marker) in QUALITIES.items()
        if _seeds(rows, quality)
    ]
    shown += [Line2D([], [], color=INK, label="roughness")]
    shown += [Line2D([], [], color=INK, ls="--", marker="o", mfc="white", label="dominant degree")]
    at.legend(handles=shown, fontsize=8, frameon=False, loc="upper right")


def _seeds(rows: Sequence[Row], quality: str) -> str:
    count = next((row["seeds"] for row in rows if row["quality"] == quality), 0)
    return f"{count} seed{'s' * (count > 1)}" if count else ""


def _dress(at: Axes, title: str, ylabel: str) -> None:
    at.set_title(title, fontsize=10, color=INK)
    at.set_xlabel("CPU seconds, one thread")
    at.set_ylabel(ylabel)
    at.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    at.xaxis.set_minor_formatter(NullFormatter())
    at.grid(which="major", color="#dddddd", lw=0.6)
    at.spines[["top", "right"]].set_visible(False)
