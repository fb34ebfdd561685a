"""How stages settle, and what was considered instead: python -m benchmarks.dehydration.stress.settling [--quick].

Eighths of four stages: steps of the whole run, roughness, how far volumes are from a sphere's, and what a stage is left
with, as things are and with one thing changed: rungs that do not stand apart, swings where it would be eased, rest
volumes that stay in every swing, follow in every swing, or go all of the way to those of the pressures, the march at
another kappa/mu, with steps as long as it allows, layers of flesh as thin as fine's. Then thick and stiff skins at
preview, to where they blow up. Kept as dehydration-settling; runs that are in the record already, of this version, are
not run again.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import xarray as xr

from benchmarks.figures import RESULTS, Sheet, load
from solver.contract import Context, Need
from solver.contract.errors import SolverError
from solver.dehydration import SOLVER, settings, settle

from ..balance import sphere_volume

Row = dict[str, Any]

_HEAD = (
    *("quality", "te", "gamma", "seed", "changed", "steps", "of as it is", "roughness [te]"),
    *("volume off [1e-3]", "residual [1e-3]", "drift [te]", "CPU s", "ends"),
)
_STAGES = (0.05, 0.1, 0.2, 0.3)
_THICK_STAGES = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35)
_STONE = 0.4
_AS_IT_IS = "nothing"
_Change = dict[tuple[Any, str], Any]


def _march_at(kappa: float) -> _Change:
    """Steps as long as this kappa/mu allows: all that is counted in them goes with their length."""
    longer = math.sqrt(settings._MARCH_KAPPA / kappa)
    return {(settings, "_MARCH_KAPPA"): kappa, (settings, "_STEPS_N"): settings._STEPS_N * longer}


def _fine_layers() -> _Change:
    """Layers of flesh that grow as slowly as fine's, down to as deep fully integrated."""
    fine, qualities = settings._QUALITIES["fine"], settings._QUALITIES
    same = {"first_layer": fine.first_layer, "growth": fine.growth, "full_levels": 5}
    return {(settings, "_QUALITIES"): {name: dataclasses.replace(one, **same) for name, one in qualities.items()}}


#: What is changed: names of a module, and their values.
_CHANGES: dict[str, _Change] = {
    "rungs close together": {(settings, "_WIDE"): settings._RUNGS},
    "it swings, not eased": {(settle, "_eased"): settle._swung},
    "volumes stay in swings": {(settle, "_SHARE_SWINGING"): 0.0, (settle, "_SHARE_STILL"): 0.0},
    "volumes follow all swings": {(settle, "_DRIVEN"): 10**9},
    "volumes all of the way": {(settle, "_SHARE"): 1.0},
    "march at 15": _march_at(15.0),
    "march at 60": _march_at(60.0),
    "layers of fine": _fine_layers(),
}
_EASY = (("preview", 0.04, 10.0), ("preview", 0.04, 50.0), ("preview", 0.02, 10.0), ("preview", 0.02, 50.0))
_CAREFUL = (("default", 0.04, 10.0), ("default", 0.02, 10.0))
_THICK = ((0.1, 50.0), (0.1, 100.0), (0.15, 30.0), (0.15, 100.0), (0.2, 10.0), (0.2, 30.0))
_SEEDS = (0, 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the first fruit alone")
    asked = parser.parse_args()
    known = {} if asked.quick else _known()
    sheet = Sheet("dehydration-settling", _HEAD, "dehydration")
    base: dict[Any, int] = {}
    for case in _cases(asked.quick):
        quality, te, gamma, seed, changed = case
        row = known.get(case)
        if row is None:
            thick = (te, gamma) in _THICK
            row = _run(quality, te, gamma, seed, changed, _THICK_STAGES if thick else _STAGES)
        if changed == _AS_IT_IS:
            base[case[:4]] = row["steps"]
        _add(sheet, row, base.get(case[:4]))
        if not asked.quick and case not in known:
            sheet.keep()  # a benchmark that is stopped goes on from there
    if not asked.quick:
        sheet.keep()


def _cases(quick: bool) -> Iterator[tuple[str, float, float, int, str]]:
    """Yield quality, te, gamma, seed and what is changed."""
    for quality, te, gamma in _EASY[:1] if quick else _EASY + _CAREFUL:
        for seed in _SEEDS[:1] if quick else _SEEDS:
            for changed in (_AS_IT_IS, *_CHANGES):
                yield quality, te, gamma, seed, changed
    if not quick:
        yield from (("preview", te, gamma, seed, _AS_IT_IS) for te, gamma in _THICK for seed in _SEEDS)


def _run(quality: str, te: float, gamma: float, seed: int, changed: str, stages: tuple[float, ...]) -> Row:
    """Solve an eighth, with one thing changed, and return what is said of it."""
    params = SOLVER.parse({"te": te, "gamma": gamma, "mirrors": "xyz", "seed": seed})
    need = Need(stages=stages, quality=quality, fields=("roughness", "volume"))
    row: Row = {"quality": quality, "te": te, "gamma": gamma, "seed": seed, "changed": changed}
    begin = time.process_time()
    with _changed(changed):
        try:
            found: xr.Dataset | None = SOLVER.solve(params, need, Context())
            row["ends"] = "settled"
        except SolverError as error:
            found, row["ends"] = error.partial, type(error).__name__
    row["cpu"] = time.process_time() - begin
    row |= {"steps": 0, "stages": [], "roughness": [], "volume_off": [], "residual": [], "drift": []}
    if found is None:
        return row
    done = found.stage.values
    exact = [sphere_volume(_STONE, te, float(s)) for s in done]
    row |= {
        "stages": done.tolist(),
        "steps": int(found.iterations.values[-1]),
        "roughness": (found.roughness.values / te).tolist(),
        "volume_off": (found.volume.values / exact - 1).tolist(),
        "residual": found.residual.values.tolist(),
        "drift": found.drift.values.tolist(),
    }
    if missed := int((found.converged.values == 0).sum()):
        row["ends"] = f"{missed} not settled" if row["ends"] == "settled" else f"{row['ends']}, {missed} not settled"
    return row


@contextmanager
def _changed(what: str) -> Iterator[None]:
    change = {} if what == _AS_IT_IS else _CHANGES[what]
    before = {place: getattr(*place) for place in change}
    for place, value in change.items():
        setattr(*place, value)
    try:
        yield
    finally:
        for place, value in before.items():
            setattr(*place, value)


def _known() -> dict[tuple[str, float, float, int, str], Row]:
    """Return the runs of the record, if it is of this version."""
    if not (RESULTS / "dehydration-settling.json").exists():
        return {}
    record = load("dehydration-settling")
    if record["version"] != SOLVER.version:
        return {}
    return {tuple(row[name] for name in ("quality", "te", "gamma", "seed", "changed")): row for row in record["runs"]}


def _add(sheet: Sheet, row: Row, base: int | None) -> None:
    def all_of(name: str, form: str, factor: float = 1.0) -> str:
        return " ".join(format(factor * value, form) for value in row[name])

    last = f"{row['stages'][-1]:g}" if row["stages"] else "none"
    ends = row["ends"] if row["ends"] == "settled" else f"{row['ends']}, to s = {last}"
    sheet.add(
        (
            *(row["quality"], f"{row['te']:g}", f"{row['gamma']:g}", row["seed"], row["changed"], f"{row['steps']:,}"),
            f"{row['steps'] / base:.2f}" if base else "",
            *(all_of("roughness", ".2f"), all_of("volume_off", ".1f", 1e3), all_of("residual", ".1f", 1e3)),
            *(all_of("drift", ".3f"), f"{row['cpu']:.0f}", ends),
        ),
        **row,
    )


if __name__ == "__main__":
    main()
