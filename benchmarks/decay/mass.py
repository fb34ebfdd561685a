"""Weight, volume and density of five fruits over twenty days, and what a sound one loses beside what was published.

    python -m benchmarks.decay.mass

Each preset has two wounds, a body, and no skin, whose folds hold air. Weight is what the result books; volume is that
of the surface as it is handed over, by its triangles, and so is the density, over that of day 0. What a sound fruit
loses in a day is held against a skin coefficient times area and vapour pressure deficit by hand: of a ball of the
fruit's weight, with a water activity of 0.98 and Magnus' formula.
"""

from __future__ import annotations

import argparse

import numpy as np
import xarray as xr

from benchmarks.figures import Sheet
from solver.arrays import Array
from solver.contract import Need
from solver.decay import SOLVER, DecayParams

__all__ = ["PRESETS", "PUBLISHED", "by_hand", "rotting", "sound", "told"]

PRESETS = ("apple", "apple-neofabraea", "orange", "peach", "pear", "tomato")
DAYS = tuple(float(day) for day in range(21))
_SHOWN = (0, 5, 10, 15, 20)
_WOUNDS = ({"colatitude": 60, "azimuth": 70}, {"colatitude": 110, "azimuth": 140})
#: Skin coefficients [g/m2 s MPa] from and to, and where they stand; that of the peach is per weight [ng/kg s Pa].
PUBLISHED = {
    "apple": (0.17, 0.17, "Table 1"),
    "orange": (1.38, 2.14, "Becker and Fricke 1996"),
    "peach": (572.0, 572.0, "Sastry et al. 1978, by weight"),
    "pear": (0.68, 0.68, "Table 1"),
    "tomato": (0.9, 0.9, "Table 1"),
}


def rotting(preset: str, quality: str = "default") -> xr.Dataset:
    """Return twenty days of a wounded fruit."""
    params = SOLVER.parse({"body": "quasi-static", "wounds": _WOUNDS}, preset)
    booked = ("mass", "water_lost", "juice_lost", "respired", "density", "rotten_share", "mesh_position", "triangle")
    return SOLVER.solve(params, Need(stages=DAYS, quality=quality, fields=booked))


def volumes(run: xr.Dataset) -> Array:
    """Return what the triangles of each stage enclose, by the divergence of the place."""
    corners = run["mesh_position"].values.astype(float)[:, run["triangle"].values]
    a, b, c = (corners[:, :, k] for k in range(3))
    found: Array = np.abs((a * np.cross(b, c)).sum(axis=(1, 2))) / 6
    return found


def told(run: xr.Dataset) -> dict[str, Array]:
    """Return by day shares of the fresh weight and volume, density over the fresh one, and what the weight lacks."""
    mass = run["mass"].values.astype(float)
    volume = volumes(run)
    shares = {name: run[name].values.astype(float) for name in ("water_lost", "juice_lost", "respired", "rotten_share")}
    closed = np.abs(mass + shares["water_lost"] + shares["juice_lost"] + shares["respired"] - 1)
    density = mass / (volume / volume[0])
    return {"mass": mass, "volume": volume / volume[0], "density": density, **shares, "closed": closed}


def sound(preset: str) -> float:
    """Return the share of its weight that a fruit without wounds loses on its first day."""
    params = SOLVER.parse({"wounds": (), "rot_spawning": 0.0, "spawning": 0.0}, preset)
    run = SOLVER.solve(params, Need(stages=(1.0,), fields=("water_lost",)))
    return float(run["water_lost"].values[0])


def by_hand(preset: str) -> tuple[float, float]:
    """Return what a day takes of a ball's weight by the published coefficients, from and to."""
    params = SOLVER.parse({}, preset)
    assert isinstance(params, DecayParams)
    celsius, humidity, weight = params.temperature, params.humidity, params.weight
    saturated = 611.2 * np.exp(17.62 * celsius / (243.12 + celsius))
    deficit = saturated * (0.98 - humidity / 100)
    low, high, _ = PUBLISHED[preset]
    if preset == "peach":
        factor = 1e-12 * deficit * 86400
    else:
        factor = 4 * np.pi * (3 * weight * 1e-6 / (4 * np.pi)) ** (2 / 3) * deficit * 1e-6 * 86400 / weight
    return low * factor, high * factor


def main() -> None:
    """Print both tables."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    head = ("fruit", "day", "weight", "water lost", "juice", "respired", "volume", "density", "rotten")
    sheet = Sheet("decay-mass", (*head, "density, all days", "closed to"), "decay")
    for preset in PRESETS:
        found = told(rotting(preset))
        for day in _SHOWN:
            shares = [found[name][day] for name in ("mass", "water_lost", "juice_lost", "respired", "volume")]
            cells = [*(f"{100 * x:.1f} %" for x in shares), f"{found['density'][day]:.3f}"]
            last = f"{found['density'].min():.3f} to {found['density'].max():.3f}", f"{found['closed'].max():.0e}"
            ends = last if day == _SHOWN[-1] else ("", "")
            sheet.add(
                (preset, day, *cells, f"{100 * found['rotten_share'][day]:.0f} %", *ends),
                preset=preset, day=day, **{name: x.tolist() for name, x in found.items() if day == _SHOWN[-1]},
            )  # fmt: skip
    sheet.keep()
    sheet = Sheet("decay-transpired", ("fruit", "a day, here", "by the coefficient", "from"), "decay")
    for preset, (_, _, where) in PUBLISHED.items():
        here, (low, high) = sound(preset), by_hand(preset)
        hand = f"{100 * low:.2f} %" if low == high else f"{100 * low:.2f} to {100 * high:.2f} %"
        sheet.add((preset, f"{100 * here:.2f} %", hand, where), preset=preset, here=here, by_hand=[low, high])
    sheet.keep()


if __name__ == "__main__":
    main()
