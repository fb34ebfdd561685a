"""Moisture ratio MR = M / M0 (water over dry matter, over that of the fresh fruit) after hours of drying.

What was measured, each figure from the paper's abstract:

- Grapes in the open sun: I. Doymaz, J. Food Sci. Technol. 49 (2012) 214, doi 10.1007/s13197-011-0272-9. Seedless
  berries of 1.72 cm from 78.2 % water to about 22 % in 176 h, seeded ones of 2.20 cm from 79.5 % in 228 h. Between the
  two the rate goes with a power of the diameter. Berries lose their water as exp(-k t) (Martin and Stott, Aust. J.
  Agric. Res. 8 (1957) 444: log(c / (c - w)) linear in time in each of three stages, the last from 95 % of the loss).
  The diffusivities of Doymaz's abstract are not used: they leave 15 and 31 % of the water; 8 and 7 % were left.
- Whole jujubes in hot air: Motevali et al., J. Agric. Sci. Technol. 14 (2012) 523: effective diffusivity 1.1532e-10 to
  5.1895e-10 m2/s in the first of two periods, at 50 to 70 C and 0.5 to 1.5 m/s, activation energy 34.97 to 74.20
  kJ/mol. Its ends are taken for the coldest and slowest, and the hottest and fastest air; the middle of the energies
  gives the part of temperature (3.3 times), the rest is the air's (1.4 times). Between the ends that is a choice: with
  the least energy temperature does 2.1 times, with the largest all of it. The slower second period is left out.

Neither varied humidity.
"""

from __future__ import annotations

import math

from ...contract import InvalidInput
from ...rounding import towards_zero
from .conditions import Drying

__all__ = ["grape", "jujube", "page", "sphere"]

#: Diameter [mm], water over mass when fresh and when dry, hours between.
_SEEDLESS, _SEEDED = (17.2, 0.782, 176.0), (22.0, 0.795, 228.0)
_DRY = 0.22
#: Temperature [C], air [m/s] and diffusivity [m2/s] at the two ends.
_SLOWEST, _FASTEST = (50.0, 0.5, 1.1532e-10), (70.0, 1.5, 5.1895e-10)
_ENERGY = (34.97 + 74.20) / 2 * 1e3
_GAS = 8.314462618
_ZERO = 273.15
#: No fruit dries for longer [h]: 114 years.
_LONGEST = 1e6


def grape(hours: float, under: Drying) -> float:
    """Return MR of grapes in the open sun.

    Raises:
        InvalidInput: an artificial climate, a berry of another size, or more hours than were measured.

    """
    for name in ("temperature", "humidity", "air_speed"):
        if getattr(under, name) is not None:
            raise InvalidInput(
                f"{name} is set, but these grapes dried in the open sun.",
                advice=f"Leave {name} out, or set kinetics=page with rate, exponent and moisture of your own.",
            )
    diameter = _SEEDLESS[0] if under.diameter is None else under.diameter
    _within("diameter", diameter, _SEEDLESS[0], _SEEDED[0], "mm")
    small, large = (math.log(_ratio(fresh) / _ratio(_DRY)) / time for _, fresh, time in (_SEEDLESS, _SEEDED))
    place = math.log(diameter / _SEEDLESS[0]) / math.log(_SEEDED[0] / _SEEDLESS[0])
    rate = small ** (1 - place) * large**place
    longest = _SEEDLESS[2] ** (1 - place) * _SEEDED[2] ** place
    _within("hours", hours, 0.0, longest, "h")
    return math.exp(-rate * hours)


def jujube(hours: float, under: Drying) -> float:
    """Return MR of whole jujubes in hot air.

    Raises:
        InvalidInput: temperature, air or diameter missing; air that nobody measured; a humidity, which nobody varied;
            hours that no fruit dries for.

    """
    if under.humidity is not None:
        raise InvalidInput("humidity was not varied where jujubes were measured.", advice="Leave humidity out.")
    if under.temperature is None or under.air_speed is None or under.diameter is None:
        missing = [name for name in ("temperature", "air_speed", "diameter") if getattr(under, name) is None]
        raise InvalidInput(
            f"jujubes in hot air want {', '.join(missing)}.",
            advice="For example temperature=60, air_speed=1, diameter=22 (C, m/s, mm).",
        )
    (cold, slow, least), (hot, fast, largest) = _SLOWEST, _FASTEST
    _within("temperature", under.temperature, cold, hot, "C")
    _within("air_speed", under.air_speed, slow, fast, "m/s")
    _bearable(hours)

    def warmth(temperature: float) -> float:
        return _ENERGY / _GAS * (1 / (_ZERO + cold) - 1 / (_ZERO + temperature))

    power = (math.log(largest / least) - warmth(hot)) / math.log(fast / slow)
    diffusivity = least * math.exp(warmth(under.temperature)) * (under.air_speed / slow) ** power
    return sphere(diffusivity * 3600 * hours / (under.diameter / 2000) ** 2)


def page(hours: float, under: Drying) -> float:
    """Return MR by Page's law with the asker's own rate and exponent (G. E. Page, Purdue University, 1949).

    Raises:
        InvalidInput: no rate, or hours that no fruit dries for.

    """
    if under.rate is None:
        raise InvalidInput("kinetics=page wants a rate k.", advice="For example rate=0.05, exponent=1 (per hour).")
    _bearable(hours)
    return math.exp(-under.rate * hours**under.exponent)


def sphere(number: float) -> float:
    """Return what is left in a sphere with a dry surface at Fourier number D t / r^2.

    J. Crank, The Mathematics of Diffusion (2nd ed. 1975), Eq. 6.20; below 0.1 its Eq. 6.22, whose first omitted term is
    below 1e-4 there.
    """
    if number <= 0.1:
        return 1 - 6 * math.sqrt(number / math.pi) + 3 * number
    terms = (math.exp(-((n * math.pi) ** 2) * number) / n**2 for n in range(1, 12))
    return 6 / math.pi**2 * sum(terms)


def _ratio(wet: float) -> float:
    """Return water over dry matter of what holds `wet` of its mass as water."""
    return wet / (1 - wet)


def _bearable(hours: float) -> None:
    if not 0 <= hours <= _LONGEST:
        raise InvalidInput(
            f"hours = {hours:.15g} h is no time that a fruit dries for: 0 to {_LONGEST:.0f} h.",
            advice="Take hours from there.",
        )


def _within(name: str, value: float, low: float, high: float, units: str) -> None:
    if not low <= value <= high:
        raise InvalidInput(
            f"{name} = {value:.15g} {units} is outside of what was measured: "
            f"{low:g} to {towards_zero(high, 4)} {units}.",
            advice=f"Take {name} from there, or set kinetics=page with rate, exponent and moisture of your own.",
        )
