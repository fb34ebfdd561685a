"""How each species grows over temperature and humidity on its fruit, beside what was published.

    python -m benchmarks.decay.climate [published]

One wound on the equator, no spores. Radii are those of a cap of the area where the rot map is at least 0.1, on a sphere
of the fruit's area; speeds are slopes of a line between 6 and 20 mm. The lag is where that line meets the wound.

`GRAPES` is the model of Judet-Correia, Bollaert, Duquenne, Charpentier, Bensoussan and Dantigny 2010, Int. J. Food
Microbiol. 142, 106-113 (P. expansum on berries of Red Globe, fitted on agar for its cardinal values and on berries for
its rate), with the constants that GroPIN's entries 170 and 171 give. No constant of `ROTS` was taken from it.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.figures import Sheet
from solver.contract import Context
from solver.decay import SOLVER, DecayParams
from solver.decay.climate import warmth
from solver.decay.fields.colony import ROTS
from solver.decay.fields.stepping import march
from solver.decay.fields.system import System
from solver.decay.settings import choose

__all__ = ["ROTS", "SPECIES", "grown", "measured"]

#: Species, and the fruit it is measured on.
SPECIES = {
    "penicillium-expansum": "apple",
    "penicillium-digitatum": "orange",
    "neofabraea": "apple-neofabraea",
    "rhizopus": "peach",
    "erwinia": "tomato",
}
TEMPERATURES = (-10.0, -5.0, 0.0, 2.0, 5.0, 10.0, 15.0, 20.0, 24.0, 27.0, 30.0, 33.0, 36.0, 40.0, 45.0)
HUMIDITIES = (0.0, 15.0, 35.0, 50.0, 65.0, 75.0, 85.0, 90.0, 95.0, 100.0)
#: Cardinal temperatures [degC] and the rate at the best one [mm/day] of P. expansum on grapes.
GRAPES = (-4.4, 23.9, 32.5, 4.19)
#: At which temperatures [degC] Baert et al. 2007 grew it.
_BAERT = (2.0, 4.0, 10.0, 16.0, 25.0, 30.0)
_CELLS, _TOLERANCE = 32, 1e-4
#: Radii [mm] between which a speed is measured, days of a share, and the longest run [day].
_BETWEEN, _DAYS, _LONGEST = (6.0, 20.0), 7.0, 120.0


def _fruit(species: str, **air: float) -> DecayParams:
    values = {"spawning": 0.0, "rot_spawning": 0.0, "wounds": [{"colatitude": 90, "azimuth": 0, "radius": 0.12}]}
    params = SOLVER.parse({**values, "rot": ROTS[species].model_dump(), **air}, SPECIES[species])
    assert isinstance(params, DecayParams)
    return params


def grown(species: str, days: tuple[float, ...], with_mould: bool = True, **air: float) -> list[dict[str, float]]:
    """Return per day the radius of the lesion [mm] and the shares of the surface that rot and mould have grown."""
    params = _fruit(species, **air)
    system = System(params, _CELLS, with_mould)
    whole = system.surface.total(1.0)
    radius = system.skin.radius * np.sqrt(whole / (4 * np.pi))
    rows = []
    for reached in march(system, days, _TOLERANCE, choose(params, "preview").longest, Context()):
        rot, mould = system.rot.share(reached.state.rot), np.zeros(1)
        if system.mould is not None and reached.state.mould is not None:
            mould = system.mould.share(reached.state.mould)
        cap = system.surface.mean(rot >= 0.1)
        rows.append(
            {
                "day": reached.day,
                "radius_mm": float(radius * np.arccos(1 - 2 * cap)),
                "rotten": cap,
                "mouldy": system.surface.mean(mould >= 0.1) if with_mould else 0.0,
            }
        )
    return rows


def measured(species: str, celsius: float, humidity: float = 90.0) -> dict[str, float]:
    """Return speed [mm/day] and lag [day] of a lesion; both 0 where none grew to the farther radius."""
    colony = ROTS[species]
    rate = float(warmth(colony, celsius))
    end = _LONGEST if rate == 0 else min(_LONGEST, 3 * (colony.lag + (_BETWEEN[1] + 5) / colony.speed) / rate)
    rows = grown(species, tuple(np.linspace(0, end, 41)), False, temperature=celsius, humidity=humidity)
    kept = [row for row in rows if _BETWEEN[0] <= row["radius_mm"] <= _BETWEEN[1]]
    if len(kept) < 3:
        return {"mm_per_day": 0.0, "lag": 0.0}
    slope, start = np.polyfit([r["day"] for r in kept], [r["radius_mm"] for r in kept], 1)
    wound = 0.12 * System(_fruit(species), 4, False).skin.radius
    return {"mm_per_day": float(slope), "lag": float((wound - start) / slope)}


def temperatures() -> None:
    """Print speeds, lags and shares over temperature."""
    sheet = Sheet("decay-climate", ("degC", *(f"{name}: mm/day, lag d, rotten %" for name in SPECIES)), "decay")
    for celsius in TEMPERATURES:
        runs = []
        for species in SPECIES:
            (week,) = grown(species, (_DAYS,), False, temperature=celsius, humidity=90.0)
            runs.append({"species": species, **measured(species, celsius), "rotten": week["rotten"]})
        cells = [
            f"{run['mm_per_day']:.2f}, {run['lag']:.1f}, {100 * run['rotten']:.0f}" if run["mm_per_day"] else "0"
            for run in runs
        ]
        sheet.add((f"{celsius:g}", *cells), celsius=celsius, humidity=90.0, days=_DAYS, species=runs)
    sheet.keep()


def humidities() -> None:
    """Print the shares of rot and felt over humidity, at each species' best temperature."""
    sheet = Sheet("decay-humidity", ("humidity %", *(f"{name}: rotten, mouldy %" for name in SPECIES)), "decay")
    for humidity in HUMIDITIES:
        runs = []
        for species in SPECIES:
            (week,) = grown(species, (_DAYS,), temperature=ROTS[species].best, humidity=humidity)
            runs.append({"species": species, **week})
        cells = [f"{100 * run['rotten']:.0f}, {100 * run['mouldy']:.0f}" for run in runs]
        sheet.add((f"{humidity:g}", *cells), humidity=humidity, days=_DAYS, species=runs)
    sheet.keep()


def published() -> None:
    """Print what was published, and the same of this model."""
    sheet = Sheet("decay-published", ("species", "published", "here"), "decay")
    blue = measured("penicillium-expansum", 24.0)["mm_per_day"]
    said = "colony 9.2 mm wider a day at 24 C (Tannous et al. 2016, abstract)"
    sheet.add(("P. expansum", said, f"{2 * blue:.1f}"), measured=2 * blue, published=9.2)
    cold = [2 * row["radius_mm"] for row in grown("penicillium-expansum", (56.0, 70.0), temperature=0.0, humidity=90.0)]
    said = "25 to 32 mm across after 8 to 10 weeks in a cold store (apples.extension.org)"
    sheet.add(("P. expansum", said, " to ".join(f"{x:.0f}" for x in cold)), measured=cold, published=[25.4, 31.8])
    (bull,) = grown("neofabraea", (7.0,), temperature=20.0, humidity=90.0)
    said = "up to 20 to 30 mm across 7 days after wounding (Vico et al. 2016, abstract)"
    sheet.add(("Neofabraea", said, f"{2 * bull['radius_mm']:.0f}"), measured=2 * bull["radius_mm"], published=[20, 30])
    said = "a spot becomes the whole peach in 24 to 48 h, at what temperatures is not said (Penn State Extension)"
    for celsius in (22.2, ROTS["rhizopus"].best):
        soft = grown("rhizopus", tuple(np.arange(0.0, 4.01, 0.05)), temperature=celsius, humidity=90.0)
        first, last = (next(row["day"] for row in soft if row["rotten"] > share) for share in (0.0, 0.99))
        whole = 24 * (last - first)
        sheet.add(
            ("Rhizopus", said, f"{whole:.0f} h at {celsius:g} C"), celsius=celsius, measured=whole, published=[24, 48]
        )
    sheet.keep()


def on_grapes(celsius: float) -> float:
    """Return how fast P. expansum grows on grapes by the published model [mm/day]."""
    low, best, high, rate = GRAPES
    if not low < celsius < high:
        return 0.0
    above = (celsius - high) * (celsius - low) ** 2
    below = (best - low) * ((best - low) * (celsius - best) - (best - high) * (best + low - 2 * celsius))
    return rate * above / below


def rates() -> None:
    """Print lesions on apples beside the published model of the same species on grapes: bias and accuracy factor."""
    sheet = Sheet("decay-rates", ("degC", "lesion on an apple, mm/day", "colony on grapes, mm/day", "ratio"), "decay")
    ratios = []
    for celsius in _BAERT:
        here, there = measured("penicillium-expansum", celsius)["mm_per_day"], on_grapes(celsius)
        ratios.append(here / there)
        cells = (f"{celsius:g}", f"{here:.2f}", f"{there:.2f}", f"{here / there:.2f}")
        sheet.add(cells, celsius=celsius, humidity=90.0, here=here, published=there)
    logs = np.log10(ratios)
    bias, accuracy = float(10 ** logs.mean()), float(10 ** np.abs(logs).mean())
    sheet.add(("bias and accuracy factor", "", "", f"{bias:.2f}, {accuracy:.2f}"), bias=bias, accuracy=accuracy)
    sheet.keep()


def main(only: str = "") -> None:
    """Run all four, or what stands beside publications alone."""
    published()
    if only:
        return
    rates()
    humidities()
    temperatures()


if __name__ == "__main__":
    main(*sys.argv[1:])
