"""How each species grows over temperature and humidity on its fruit, beside what was published.

    python -m benchmarks.decay_climate [FILE.json]

One wound on the equator, no spores. Radii are those of a cap of the area where the rot map is at least 0.1, on a sphere
of the fruit's area; speeds are slopes of a line between 6 and 20 mm. The lag is where that line meets the wound's radius.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from solver.contract import Context
from solver.decay import SOLVER, DecayParams
from solver.decay.climate import warmth
from solver.decay.fields.colony import ROTS
from solver.decay.fields.stepping import march
from solver.decay.fields.system import System
from solver.decay.settings import choose

__all__ = ["SPECIES", "grown", "measured"]

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
_CELLS, _TOLERANCE = 32, 1e-4
#: Radii [mm] between which a speed is measured, days of a share, and the longest run [day].
_BETWEEN, _DAYS, _LONGEST = (6.0, 20.0), 7.0, 120.0


def _fruit(species: str, **air: float) -> DecayParams:
    values = {"spawning": 0.0, "rot_spawning": 0.0, "wounds": [{"colatitude": 90, "azimuth": 0, "radius": 0.12}]}
    params = SOLVER.parse({**values, "rot": ROTS[species].model_dump(), **air}, SPECIES[species])
    assert isinstance(params, DecayParams)
    return params


def grown(species: str, days: tuple[float, ...], **air: float) -> list[dict[str, float]]:
    """Return per day the radius of the lesion [mm] and the shares of the surface that rot and mould have grown."""
    params = _fruit(species, **air)
    system = System(params, _CELLS, True)
    whole = system.surface.total(1.0)
    radius = system._radius * np.sqrt(whole / (4 * np.pi))
    rows = []
    for reached in march(system, days, _TOLERANCE, choose(params, "preview").longest, Context()):
        assert system.mould is not None
        assert reached.state.mould is not None
        rot, mould = system.rot.share(reached.state.rot), system.mould.share(reached.state.mould)
        cap = system.surface.mean(rot >= 0.1)
        rows.append(
            {
                "day": reached.day,
                "radius_mm": float(radius * np.arccos(1 - 2 * cap)),
                "rotten": cap,
                "mouldy": system.surface.mean(mould >= 0.1),
            }
        )
    return rows


def measured(species: str, celsius: float, humidity: float = 90.0) -> dict[str, float]:
    """Return speed [mm/day] and lag [day] of a lesion; both 0 where none grew to the farther radius."""
    colony = ROTS[species]
    rate = float(warmth(colony, celsius))
    end = _LONGEST if rate == 0 else min(_LONGEST, 3 * (colony.lag + (_BETWEEN[1] + 5) / colony.speed) / rate)
    rows = grown(species, tuple(np.linspace(0, end, 41)), temperature=celsius, humidity=humidity)
    kept = [row for row in rows if _BETWEEN[0] <= row["radius_mm"] <= _BETWEEN[1]]
    if len(kept) < 3:
        return {"mm_per_day": 0.0, "lag": 0.0}
    slope, start = np.polyfit([r["day"] for r in kept], [r["radius_mm"] for r in kept], 1)
    wound = 0.12 * System(_fruit(species), 4, False)._radius
    return {"mm_per_day": float(slope), "lag": float((wound - start) / slope)}


def main(out: str | None = None) -> None:
    document: dict[str, Any] = {"command": "python -m benchmarks.decay_climate", "solver_version": SOLVER.version}
    warm, wet = [], []
    for species in SPECIES:
        for celsius in TEMPERATURES:
            (week,) = grown(species, (_DAYS,), temperature=celsius, humidity=90.0)
            row = {"species": species, "celsius": celsius, **measured(species, celsius)}
            warm.append(row | {"rotten": week["rotten"], "mouldy": week["mouldy"]})
            print(warm[-1], file=sys.stderr)
        best = ROTS[species].best
        for humidity in HUMIDITIES:
            (week,) = grown(species, (_DAYS,), temperature=best, humidity=humidity)
            wet.append({"species": species, "humidity": humidity, "rotten": week["rotten"], "mouldy": week["mouldy"]})
    cold = grown("penicillium-expansum", (56.0, 70.0), temperature=0.0, humidity=90.0)
    (bull,) = grown("neofabraea", (7.0,), temperature=20.0, humidity=90.0)
    document |= {
        "days": _DAYS,
        "temperature": warm,
        "humidity": wet,
        "cold_store_mm": [2 * row["radius_mm"] for row in cold],
        "bulls_eye_mm": 2 * bull["radius_mm"],
    }
    text = json.dumps(document, indent=1)
    if out is None:
        print(text)
    else:
        Path(out).write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
