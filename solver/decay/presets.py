"""Fruits of Tables 1 and 2 and the four environments, as parameters.

Table 2 has no peach and no pear: they take the apple's skin and rates. A fruit grows its own species at the speed that
was measured; the same fruit as `...-paper` has the paper's climate, growth rates and transpiration coefficients, of
which orange and peach are implausible: 9 and 17 % of the weight in a day (docs/decay.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .dress.peel import LESIONS, PEELS
from .fields.colony import MOULDS, PAPER_MOULDS, PAPER_ROT, ROTS
from .hyphae import FURS

__all__ = ["ENVIRONMENTS", "FRUITS", "PRESETS", "SIZES", "SPECIES"]

#: Transpiration coefficients by area [g/(m2 s MPa)], where Table 1's are implausible; sources in docs/decay.md.
_TRANSPIRATION = {"orange": 1.72, "peach": 5.2}


def _fruit(
    weight: float,
    water: float,
    k: float,
    porosity: float,
    firmness: float,
    rates: tuple[float, float],
    mould: str,
    skin: tuple[float, float, float],
    mould_colour: tuple[float, float, float],
    **shape: Any,
) -> dict[str, Any]:
    return {
        "weight": weight,
        "water_content": water,
        "transpiration": k,
        "porosity": porosity,
        "firmness": firmness,
        "climate": "paper",
        "growth_rate": rates[0],
        "propagation_rate": rates[1],
        "mould": PAPER_MOULDS[mould].model_dump(),
        "rot": PAPER_ROT.model_dump(),
        "hyphae": FURS[mould].model_dump(),
        "lesion": LESIONS[mould].model_dump(),
        "skin_colour": skin,
        "mould_colour": mould_colour,
        **shape,
    }


def _lived(name: str, paper: Mapping[str, Any], mould: str) -> dict[str, Any]:
    """Return a fruit of the paper as it is outside of it."""
    rest = {key: value for key, value in paper.items() if key not in ("climate", "growth_rate")}
    return rest | {
        "transpiration": _TRANSPIRATION.get(name, paper["transpiration"]),
        "mould": MOULDS[mould].model_dump(),
        "rot": ROTS[mould].model_dump(),
        **({"mould_colour": _RIPE[mould]} if mould in _RIPE else {}),
    }


_BLUE = (0.16, 0.27, 0.26)
_GREY_BLUE = (0.20, 0.27, 0.31)
_GREY = (0.10, 0.10, 0.09)
_PALE = (0.45, 0.40, 0.30)
#: Ripe spores as they are seen, where the paper's colours are others: of the green mould olive, of the blue one duller.
_RIPE = {"penicillium-digitatum": (0.17, 0.185, 0.075), "penicillium-expansum": (0.15, 0.225, 0.195)}

#: The apple's skin is thin enough to shrivel in folds; the others keep the default, at which orange and tomato have
#: large shallow dents and folds: looked at, at 0.02 and 0.04 (docs/decay.md).
_APPLE: dict[str, Any] = {
    "radii": (1.0, 1.04, 1.1, 1.15, 1.14, 1.08, 1.0, 1.15),
    "stone": (0.3, 0.25),
    "exocarp_thickness": 0.03,
}
_PEAR: dict[str, Any] = {"radii": (1.0, 1.02, 1.03, 0.98, 0.92, 1.0, 1.2, 0.98), "stone": (0.3, 0.3)}
_TOMATO: dict[str, Any] = {"radii": (1.0, 1.05, 1.13, 1.18, 1.13, 1.05, 1.0, 1.18), "stone": (0, 0)}
_ORANGE: dict[str, Any] = {"stone": (0, 0)}

#: Four climates: temperature [degC] and relative humidity [percent]. Temperate is the paper's 72 F and 50 %.
ENVIRONMENTS: Mapping[str, Mapping[str, float]] = {
    "temperate": {"temperature": 22.2, "humidity": 50.0},
    "tropical": {"temperature": 30.0, "humidity": 85.0},
    "hot-desert": {"temperature": 40.0, "humidity": 15.0},
    "cold-desert": {"temperature": 5.0, "humidity": 35.0},
}

_TABLES: Mapping[str, Mapping[str, Any]] = {
    "apple": _fruit(138, 84, 0.17, 25, 80, (20, 5), "penicillium-expansum", (0.55, 0.06, 0.04), _BLUE, **_APPLE),
    "apple-neofabraea": _fruit(138, 84, 0.17, 25, 80, (20, 5), "neofabraea", (0.50, 0.42, 0.08), _PALE, **_APPLE),
    "orange": _fruit(
        140, 87, 8.48, 60, 40, (50, 3), "penicillium-digitatum", (0.85, 0.28, 0.02), _GREY_BLUE, **_ORANGE
    ),
    "peach": _fruit(87, 88, 14.1, 25, 80, (20, 5), "rhizopus", (0.80, 0.35, 0.18), _GREY),
    "pear": _fruit(166, 84, 0.68, 25, 80, (20, 5), "penicillium-expansum", (0.55, 0.52, 0.10), _BLUE, **_PEAR),
    "tomato": _fruit(123, 94, 0.9, 40, 50, (75, 1), "rhizopus", (0.70, 0.06, 0.03), _GREY, **_TOMATO),
}

#: Radius r1 [m] of a fruit of that weight.
_SIZES = {"apple": 0.03, "orange": 0.033, "peach": 0.028, "pear": 0.034, "tomato": 0.028}

#: Which species a fruit grows.
SPECIES = {
    "apple": "penicillium-expansum",
    "apple-neofabraea": "neofabraea",
    "orange": "penicillium-digitatum",
    "peach": "rhizopus",
    "pear": "penicillium-expansum",
    "tomato": "rhizopus",
}
_PAPER: Mapping[str, Mapping[str, Any]] = {
    name: {**values, "peel": PEELS[name.partition("-")[0]].model_dump()} for name, values in _TABLES.items()
}
#: Fruits in the temperate climate, each with its own species.
FRUITS: Mapping[str, Mapping[str, Any]] = {name: _lived(name, paper, SPECIES[name]) for name, paper in _PAPER.items()}

#: Fruits in the temperate climate, every fruit in each of the others as e.g. `orange-tropical`, and in the paper's.
PRESETS: Mapping[str, Mapping[str, Any]] = {
    **FRUITS,
    **{
        f"{fruit}-{climate}": {**values, **air}
        for fruit, values in FRUITS.items()
        for climate, air in ENVIRONMENTS.items()
        if climate != "temperate"
    },
    **{f"{fruit}-paper": values for fruit, values in _PAPER.items()},
}

#: Length of r1 [m] by preset.
SIZES: Mapping[str, float] = {name: _SIZES[name.partition("-")[0]] for name in PRESETS}
