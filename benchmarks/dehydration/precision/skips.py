"""What a need lets the solver skip: CPU seconds saved and error added, row by row.

Stages and qualities are compared run against run; what only the hand-over of a stage skips (fields, region, type,
resolution) costs milliseconds, and is timed on one settled stage, many times.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from solver.contract import Quality

from .buckled import summary
from .record import Record, Row, worker

#: Hand-overs of one stage per figure.
REPEATS = 15


def _seconds(call: Callable[[], Any]) -> tuple[Any, float]:
    begun = time.process_time()
    found = call()
    return found, time.process_time() - begun


def early_stop(quality: Quality, last: float, wanted: float) -> Row:
    """Stop at `wanted` instead of running to `last`; the stage must be the same to the last bit."""
    from solver.contract import Need
    from solver.dehydration import SOLVER

    params = SOLVER.parse({})

    def run(*stages: float) -> Any:
        return SOLVER.solve(params, Need(stages=stages, quality=quality, fields=("displacement",)))

    SOLVER.solve(params, Need(stages=(0.01,), quality=quality))
    whole, long = _seconds(lambda: run(wanted, last))
    part, short = _seconds(lambda: run(wanted))
    apart = float(np.abs(whole["displacement"][0] - part["displacement"][0]).max())
    return {"cpu_full": long, "cpu": short, "error": apart, "error_is": "largest difference of displacement [r1]"}


def below_onset(quality: Quality, shrinkage: float) -> Row:
    """Take the closed form below the onset instead of marching there from the fresh shape."""
    from solver.contract import Context
    from solver.dehydration.params import DehydrationParams
    from solver.dehydration.path import Path
    from solver.dehydration.settings import choose

    params = DehydrationParams()
    usual = choose(params, quality)

    def run(start: float) -> Any:
        return Path(params, replace(usual, start=start), Context()).stage(shrinkage, shrinkage)

    run(usual.start)
    part, short = _seconds(lambda: run(usual.start))
    whole, long = _seconds(lambda: run(0.0))
    apart = float(np.linalg.norm(part.surface - whole.surface, axis=1).max())
    return {"cpu_full": long, "cpu": short, "error": apart, "error_is": "largest distance of surface nodes [r1]"}


def hand_over(quality: Quality, shrinkage: float) -> list[Row]:
    """Hand one settled stage over in every way; return CPU seconds, megabytes and error of each."""
    from solver.contract import Context, Need
    from solver.dehydration import SOLVER
    from solver.dehydration.params import DehydrationParams
    from solver.dehydration.path import Path
    from solver.dehydration.run import Record
    from solver.dehydration.settings import choose
    from store.surfaces.spectra import spectrum, synthesize

    params = DehydrationParams()
    settings = choose(params, quality)
    path = Path(params, settings, Context())
    state, run_seconds = _seconds(lambda: path.stage(shrinkage, shrinkage))

    def give(asked: Mapping[str, Any]) -> tuple[Any, float, float]:
        need = SOLVER.settle(Need(**{"stages": (shrinkage,), "quality": quality, "resolution": 96, **asked}))

        def once() -> Any:
            record = Record(params, need, path.mesh)
            record.add(state, state.residual <= settings.residual)
            return record.dataset({})

        once()
        times = [_seconds(once) for _ in range(REPEATS)]
        data = times[0][0]
        return data, float(np.median([seconds for _, seconds in times])), data.nbytes / 1e6

    shape: dict[str, Any] = {"fields": ("displacement",)}
    scalars = {"fields": ("roughness", "dominant_degree", "wavelength")}
    full, full_cpu, full_size = give({})
    whole = {"instead_of": "all default fields", "cpu_full": full_cpu, "MB_full": full_size}
    exact, shape_cpu, shape_size = give({**shape, "dtype": "float64"})
    u = exact["displacement"].values[0]
    rms = float(np.sqrt(np.square(u - u.mean(axis=(0, 1))).mean()))

    def coarse(data: Any) -> float:
        back = synthesize(spectrum(data["displacement"].values[0].astype(float)), u.shape[0])
        return float(np.sqrt(np.square(back - u).sum(axis=-1).mean()))

    def described(data: Any) -> float:
        return float(np.abs(data["roughness"] - full["roughness"]).max())

    def same(data: Any) -> float:
        v = data["displacement"].values[0]
        return float(np.abs(v - u[: v.shape[0], : v.shape[1]]).max())

    rows = [
        {"what": "displacement only", **whole} | _row(give(shape), same, "largest difference [r1]"),
        {"what": "descriptors only", **whole} | _row(give(scalars), described, "difference of roughness [r1]"),
    ]
    base = {"cpu_full": shape_cpu, "MB_full": shape_size}
    for what, (against, asked) in _narrow().items():
        given = _row(give({**shape, **asked}), same, "largest difference [r1]")
        rows.append({"what": what, "instead_of": against, **base} | given)
    given = _row(give({**shape, "dtype": "float64", "resolution": 32}), coarse, "rms of what is lost [r1]")
    rows.append({"what": "resolution 32", "instead_of": "96", **base} | given)
    shared = {"quality": quality, "stage": shrinkage, "cpu_of_the_run": run_seconds, "rms_displacement": rms}
    return [{**row, **shared} for row in rows]


def _narrow() -> dict[str, tuple[str, dict[str, Any]]]:
    """Return needs of less than the whole displacement in doubles, and what each is less than."""
    from solver.contract import Region

    half = {"region": Region(colatitude=(0, 90), azimuth=(0, 360)), "dtype": "float64"}
    return {"half of the surface": ("all of it", half), "float32": ("float64", {"dtype": "float32"})}


def _row(given: tuple[Any, float, float], error: Callable[[Any], float], meaning: str) -> Row:
    data, seconds, size = given
    return {"cpu": seconds, "MB": size, "error": error(data), "error_is": meaning}


def handed(quality: Quality, shrinkage: float) -> Row:
    """Wrap `hand_over` for a process of its own."""
    return {"rows": hand_over(quality, shrinkage)}


def measure(record: Record, quality: Quality = "preview") -> None:
    """Run every row anew; the quality's row comes from the runs after buckling, if they are in the record."""
    whole_runs = {
        "stop at s = 0.15": ("run to s = 0.3", "skips:early_stop", {"last": 0.3, "wanted": 0.15}),
        "closed form at s = 0.05": ("march from s = 0", "skips:below_onset", {"shrinkage": 0.05}),
    }
    rows: list[Row] = []
    for what, (instead, function, arguments) in whole_runs.items():
        row = {"what": what, "instead_of": instead, "quality": quality}
        rows.append(row | worker(function, quality=quality, **arguments))
    handed_over = worker("skips:handed", quality=quality, shrinkage=0.15)
    rows += handed_over.get("rows", [{"what": "hand-over", **handed_over}])
    buckled = record.rows("buckled")
    # of the newest version that they were run by, which need not be the solver's
    rows += _qualities(summary(buckled, max((row["version"] for row in buckled), key=int, default="")))
    record.parts["skips"] = rows
    record.save("skips")
    for row in rows:
        if "failed" in row:
            print(f"{row['what']}: {row['failed']}")
            continue
        print(
            f"{row['what']:24} instead of {row['instead_of']:20} {row['cpu_full']:9.4f} -> {row['cpu']:9.4f} CPU s, "
            f"error {row['error']:.1e} ({row['error_is']})"
            + (f", {row['MB_full']:.2f} -> {row['MB']:.5f} MB" if "MB" in row else "")
        )


def _qualities(summary: list[Row]) -> list[Row]:
    """Compare preview with default, and an eighth with the whole, at the last stage."""
    last: dict[tuple[float, str, str], Row] = {}
    for row in summary:
        if row["gamma"] == 10:
            last[row["te"], row["mirrors"], row["quality"]] = row
    rows = []
    for te in sorted({te for te, _, _ in last}, reverse=True):
        usual = last.get((te, "", "default"))
        for what, other in (("preview", (te, "", "preview")), ("an eighth (mirrors=xyz)", (te, "xyz", "default"))):
            part = last.get(other)
            if part is None or usual is None:
                continue
            added = part["roughness"]["mean"] / usual["roughness"]["mean"] - 1
            rows.append({
                "what": f"{what}, te {te:g}", "instead_of": "default", "cpu_full": usual["cpu"], "cpu": part["cpu"],
                "error": added, "error_is": f"relative, of roughness at s = {part['stage']:g}",
            })  # fmt: skip
    return rows
