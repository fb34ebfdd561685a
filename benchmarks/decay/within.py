"""Fields in the flesh against closed forms, and what they take: python -m benchmarks.decay.within [forms|lesion].

By points of the flesh: the slowest round mode of an insulated ball, its eigenvalue; a ball that dries through its skin
(Biot 5.8), water lost after 5 and 30 days against Crank's series, and after 5 beside the series of a ball that has half
of its outermost flesh less in water's way; a ball in hot air, its middle after half an hour; and CPU seconds of a step
of rot and of a day of water. By quality, and with `lesion` this alone (`forms`: all but this): the share of the flesh
that one wound has rotted by day 6.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np
from scipy.optimize import brentq

from benchmarks.figures import Sheet
from solver.arrays import Floats
from solver.contract import Context, Quality
from solver.decay import SOLVER, DecayParams
from solver.decay.environment import saturation
from solver.decay.fields.diffusion import linked
from solver.decay.fields.stepping import march
from solver.decay.fields.system import System
from solver.decay.settings import choose
from solver.decay.surfaces.surface import extent, lay
from solver.decay.within import water
from solver.decay.within.joint import Joint, joined
from solver.decay.within.roast import Roast
from solver.decay.within.spread import spread

#: Radius of the round fruit with its skin [r1], cells of its surface, points of its flesh.
RADIUS, CELLS, POINTS = 1.04, 32, (3000, 12000, 50000)


def mode(ball: Joint) -> float:
    """Return how far the eigenvalue of sin(k r) / r, tan k R = k R, is off."""
    k = brentq(lambda x: np.tan(x) - x, 4.3, 4.6) / RADIUS
    r = np.maximum(np.linalg.norm(ball.points, axis=1), 1e-9)
    r[len(ball.cover.points) :] *= (RADIUS - 0.01) / RADIUS
    y = np.sin(k * r) / r
    y -= ball.mean(y)
    none, every = np.zeros(len(y)), np.arange(len(y))
    links = linked(np.ones(len(y)), np.empty(0), every, ball.start, ball.near, ball.weight, ball.area)
    left = y
    for _ in range(20):
        left = spread(left, links, 0.05, none, none, ball.stiffest, 0.03)
    kept = ball.total((left - ball.mean(left)) * y) / ball.total(y * y)
    return float(-np.log(kept) / (k * k * 0.05 * 0.6) - 1)


def series(biot: float, fourier: float) -> tuple[float, float]:
    """Return what is left in the mean and in the middle of a ball whose surface gives in proportion."""
    roots = [brentq(lambda b: b / np.tan(b) + biot - 1, (n + 1e-9) * np.pi, (n + 1 - 1e-9) * np.pi) for n in range(80)]
    mean = middle = 0.0
    for b in roots:
        below, fades = b * b + biot * (biot - 1), np.exp(-b * b * fourier)
        mean += 6 * biot**2 * fades / (b * b * below)
        middle += 2 * biot * (b * b + (biot - 1) ** 2) / below * np.sin(b) / b * fades
    return mean, middle


def drying(ball: Joint) -> tuple[float, float, float]:
    """Return how far water lost after 5 and 30 days is off, over it; activity in proportion to what there is.

    And after 5 days beside a ball that gives without half of the outermost flesh, from whose middle water leaves here.
    """
    params = given({"transpiration": 3.0, "open_transpiration": 0.0, "humidity": 0.0, "water_content": 80.0})
    assert params.within is not None
    kept = water.activity, water.rising
    water.activity, water.rising = np.asarray, np.ones_like  # type: ignore[assignment]
    try:
        found = water.Water(params, params.within, ball, extent(params))
        wet, errors = found.fresh, []
        radius = (params.weight * 1e-6 / (4 / 3 * np.pi)) ** (1 / 3)
        biot = 3e-12 * float(saturation(20.0)) / 0.8 * radius / params.within.water
        for day in range(0, 30, 5):
            wet = found.advance(wet, np.zeros(len(ball.cover.points)), float(day), day + 5.0)
            fourier = params.within.water * (day + 5) * 86400 / radius**2
            for through in (biot, 1 / (1 / biot - params.within.skin / 2 / RADIUS)):
                errors.append(found.lost(wet) / (0.8 * (1 - series(through, fourier)[0])) - 1)
    finally:
        water.activity, water.rising = kept
    return float(errors[0]), float(errors[1]), float(errors[-2])


def heating(ball: Joint) -> float:
    """Return how far the middle is off after half an hour in 95 degC, over the whole rise."""
    params = given({"oven": {"celsius": 95}, "transpiration": 0.0, "open_transpiration": 0.0})
    assert params.within is not None
    assert params.oven is not None
    found = Roast(params, params.within, params.oven, ball, extent(params))
    state = found.fresh
    for _ in range(180):
        state = found.advance(state, 10.0)
    radius = (params.weight * 1e-6 / (4 / 3 * np.pi)) ** (1 / 3)
    biot = params.oven.film * radius / params.oven.conductivity
    _, middle = series(biot, params.oven.diffusivity * 1800 / radius**2)
    at = len(ball.cover.points) + int(np.argmin(np.linalg.norm(ball.flesh, axis=1)))
    return float((95 - state.warm[at]) / 75 - middle)


def given(more: dict[str, object]) -> DecayParams:
    params = SOLVER.parse({"stone": (0, 0), "weight": 100.0, "temperature": 20.0, "within": {}, **more})
    assert isinstance(params, DecayParams)
    return params


def costs(count: int) -> tuple[float, float]:
    """Return CPU seconds of a step of rot all through the flesh, and of a day of water."""
    params = SOLVER.parse({"within": {}}, "orange")
    assert isinstance(params, DecayParams)
    system = System(params, CELLS, False, None, count)
    assert system.joint is not None
    assert params.within is not None
    full = np.full(len(system.joint.area), 0.5 * system.rot.rates.cap)
    state = system.start.rot._replace(u=full)
    dried = water.Water(params, params.within, system.joint, system.skin.extent)
    sound: Floats = np.zeros(len(system.surface.points))
    took = []
    for step in (lambda: system.rot.advance(state, 0.05), lambda: dried.advance(dried.fresh, sound, 0.0, 1.0)):
        step()
        begun = time.process_time()
        step()
        took.append(time.process_time() - begun)
    return took[0], took[1]


def lesion(quality: Quality) -> dict[str, Any]:
    """Return the share of the flesh that an even apple's one wound has rotted by day 6, and what that took."""
    even = {"stone": (0, 0), "noise": 0.0, "unevenness": 0.0, "spawning": 0.0, "rot_spawning": 0.0}
    params = SOLVER.parse({**even, "wounds": ({"colatitude": 0},), "within": {}})
    assert isinstance(params, DecayParams)
    settings, begun = choose(params, quality), time.process_time()
    system = System(params, settings.cells, False, None, settings.within)
    laid = time.process_time()
    *_, last = march(system, (6.0,), settings.tolerance, settings.longest, Context())
    assert system.joint is not None
    return {
        "quality": quality,
        "skin": len(system.surface.points),
        "flesh": len(system.joint.flesh),
        "rotten": system.joint.mean(system.rot.share(last.state.rot)),
        "seconds": (laid - begun, time.process_time() - laid),
    }


def lesions() -> None:
    """Keep what qualities say of one lesion, beside the finest."""
    head = ("quality", "points of the skin", "of the flesh", "rotten, day 6", "off the finest", "laying", "six days")
    sheet = Sheet("decay-lesion", head, "decay")
    rows = [lesion(quality) for quality in ("preview", "default", "fine")]
    for row in rows:
        off = row["rotten"] / rows[-1]["rotten"] - 1
        spent = (f"{seconds:.1f} s" for seconds in row["seconds"])
        told = (f"{100 * row['rotten']:.2f} %", f"{100 * off:+.1f} %" if row is not rows[-1] else "")
        sheet.add((row["quality"], row["skin"], row["flesh"], *told, *spent), **row, off=off)
    sheet.keep()


def main(only: str = "") -> None:
    if only != "lesion":
        forms()
    if only != "forms":
        lesions()


def forms() -> None:
    """Keep errors against closed forms."""
    head = (
        *("points of the flesh", "eigenvalue", "water, day 5", "without half the skin's layer", "day 30"),
        "heat, middle",
        *("a step of rot", "a day of water"),
    )
    sheet = Sheet("decay-within", head, "decay")
    for count in POINTS:
        ball = joined(lay(given({}), CELLS), count, 0.01)
        errors = (mode(ball), *drying(ball), heating(ball))
        rot, wet = costs(count)
        cells = (
            f"{len(ball.flesh)}",
            *(f"{100 * e:+.2f} %" for e in errors),
            f"{rot:.2f} s",
            f"{wet:.2f} s",
        )
        sheet.add(cells, points=len(ball.flesh), errors=errors, seconds=(rot, wet))
    sheet.keep()


if __name__ == "__main__":
    main(*sys.argv[1:])
