"""Whether the error that a look-up says to expect covers the one that it makes.

    python -m benchmarks.dehydration.calibration [--held-out STORE --name NAME] [--picture docs/calibration.png]
    python -m benchmarks.dehydration.calibration --kept --picture docs/calibration.png

Every sample of a family in the package is predicted from the others, and what the others' own errors, so found, let
expect there stands beside the error that is made; a table says so many times as much as covers 90 % of them. This is
what a question one spacing away from its samples is told, which is farther than any between them.
With a store of runs between the samples of one family, the errors of these beside what the table says of them; without,
those in the record stay if they are of that very table (by its digest). Shares of errors covered, and the factor that
covers 90 % (record dehydration-calibration). --kept measures nothing, and draws what the record holds.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from benchmarks import figures
from benchmarks.figures import Sheet
from solver import registry
from store.blending import methods
from store.generations import generation, trust
from store.lookup import ShapeTable
from store.starter import ROOT
from store.store import Store
from store.surfaces.measures import Measures, Surface, compare
from store.tables import path_of
from sweeps.refining import score as scores

_RECORD = "dehydration-calibration"
_LEFT, _HELD = "samples from the others", "runs held out"
_SHOWN = ("rgh", "dB", "W1", "corr")
_HEAD = ("family", "errors of", "cases", *(f"{name} covered, factor" for name in _SHOWN))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--held-out", type=Path, help="a store with runs between the samples of --name")
    parser.add_argument("--name", default="default")
    parser.add_argument("--picture", type=Path, help="share covered over the factor on what is said")
    parser.add_argument("--kept", action="store_true", help="measure nothing: draw what the record holds")
    asked = parser.parse_args()
    kept = figures.load(_RECORD)["runs"]
    if asked.kept:
        if asked.picture is None:
            parser.error("--kept draws the record: name a --picture")
        _draw({(row["family"], row["of"]): np.array(row["ratios"]) for row in kept}, asked.picture)
        return
    store, sheet, curves = Store.open(ROOT), Sheet(_RECORD, _HEAD, "dehydration"), {}
    for name in store.table_names():
        table = ShapeTable.open(store, name, surfaces=registry.surface)
        if table.size > 2:
            curves[name, _LEFT] = _add(sheet, table, _LEFT, _ratios(*_left_out(store, table)))
        said = next((row for row in kept if (row["family"], row["of"]) == (name, _HELD)), None)
        if asked.held_out is not None and name == asked.name:
            curves[name, _HELD] = _add(sheet, table, _HELD, _ratios(*_held(store, table, asked.held_out)))
        elif said is not None and said["digest"] == table.info.digest:
            curves[name, _HELD] = _add(sheet, table, _HELD, np.array(said["ratios"]))
    if asked.picture is not None:
        _draw(curves, asked.picture)
    sheet.keep(share=trust.COVERED, measures=Measures._fields)


def _left_out(store: Store, table: ShapeTable) -> np.ndarray:
    """Return errors made and expected (2, case, measure) of samples predicted from the others."""
    opened = generation.read(path_of(store, table.info))
    found = generation.left_out(opened)
    assert found is not None
    assert table._samples is not None
    own, expected = trust.foretold(*found, table._samples)
    said = own.shape[-1]
    return np.stack([own.reshape(-1, said), expected.reshape(-1, said)])


def _held(store: Store, table: ShapeTable, held: Path) -> np.ndarray:
    """Return errors made and expected (2, case, measure) of runs that the table has not seen."""
    made, expected = [], []
    for case in scores.cases(store, table, held)[0]:
        values = {name: float(text) for name, text in (part.split(" = ") for part in case.label.split(", "))}
        for stage in table.stages:
            alike = compare(
                Surface(case.fresh, case.found(methods.DEFAULT, stage)), Surface(case.fresh, case.truth(stage))
            )
            made.append(list(trust.errors(alike).values()))
            said = table.at(values, stage, fields=()).expected_error
            assert said is not None
            expected.append([said[name] for name in Measures._fields])
    return np.stack([np.array(made), np.array(expected)])


def _ratios(made: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Return how many times the expected errors were made (case, measure)."""
    found: np.ndarray = (made / np.maximum(expected, 1e-12)).round(4)
    return found


def _add(sheet: Sheet, table: ShapeTable, of: str, ratios: np.ndarray) -> np.ndarray:
    """Print and keep one row; return the ratios."""
    name = table.info.name
    covered, factor = (ratios <= 1).mean(axis=0), np.quantile(ratios, trust.COVERED, axis=0)
    places = [Measures._fields.index(shown) for shown in _SHOWN]
    sheet.add(
        (name, of, len(ratios), *(f"{covered[k]:.0%}, {factor[k]:.1f}" for k in places)),
        family=name, digest=table.info.digest, of=of, cases=len(ratios),
        covered=dict(zip(Measures._fields, covered.tolist(), strict=True)),
        factor=dict(zip(Measures._fields, factor.tolist(), strict=True)), ratios=ratios.tolist(),
    )  # fmt: skip
    return ratios


def _draw(curves: Mapping[tuple[str, str], np.ndarray], path: Path) -> None:
    """Draw which share of the errors of a family and a kind is covered by so many times what is said."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(_SHOWN), figsize=(13, 4.4), sharey=True, layout="constrained")
    factors, families = np.geomspace(0.1, 10, 200), list(dict.fromkeys(family for family, _ in curves))
    for panel, name in zip(axes, _SHOWN, strict=True):
        for (family, of), ratios in curves.items():
            column, colour = ratios[:, Measures._fields.index(name)], plt.get_cmap("tab20")(families.index(family))
            # runs that a table has not seen stand out of the many that it has
            style = {"label": f"{family}, held out", "linestyle": "--", "linewidth": 2.4}
            style = style if of == _HELD else {"label": family}
            panel.plot(factors, [(column <= factor).mean() for factor in factors], color=colour, **style)
        panel.axvline(1, color="grey", linewidth=0.6)
        panel.axhline(trust.COVERED, color="grey", linewidth=0.6)
        panel.set(xscale="log", xlabel=f"times the expected {name}")
    axes[0].set(ylabel="share of errors covered")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right center", fontsize=8)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
