"""What the dehydration solver is to be broken with: every hostile corner of its parameters, one case each."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

from solver.fruit import PRESETS

from .judged import Case

__all__ = ["matrix"]

DEEP, SWOLLEN = (0.3, 0.6), (-0.3, -0.1)
NO_STONE = [0.0, 0.0]
#: An ellipsoid of half-axes 1 and 0.3, and a stone that fits.
NEEDLE: dict[str, Any] = {"radii": [1, 0.53, 0.34, 0.3, 0.34, 0.53, 1, 0.3], "stone": [0.3, 0.12]}
#: Its equator stretched to another ellipse.
BLADE: dict[str, Any] = {**NEEDLE, "radii": [*NEEDLE["radii"][:7], 0.9]}
FLAT: dict[str, Any] = {"radii": [1, 1, 1, 1, 1, 1, 1, 0.3], "stone": [0.3, 0.3]}
WIDE: dict[str, Any] = {"radii": [1, 1, 1, 1, 1, 1, 1, 2], "stone": [0.4, 0.4]}


def matrix(quick: bool = False) -> list[Case]:
    """Return all cases, or a dozen that take a few seconds together."""
    made = (_skins, _deep, _stones, _shapes, _folds, _steps, _stiff, _seeds, _loadings, _cancelled, _hostile)
    cases = [case for make in made for case in make()]
    return [case for case in cases if case.quick] if quick else cases


def _skins() -> Iterator[Case]:
    for te, gamma in itertools.product((0.002, 0.005, 0.02, 0.04, 0.1, 0.2), (1, 3, 10, 100, 1000)):
        values = {"te": te, "gamma": gamma}
        yield Case("skin", f"te {te:g}, gamma {gamma:g}", values, n=6, quick=(te, gamma) == (0.2, 1))


def _deep() -> Iterator[Case]:
    for te, gamma in itertools.product((0.002, 0.01, 0.04, 0.2), (1, 10, 1000)):
        values = {"te": te, "gamma": gamma}
        yield Case("deep", f"te {te:g}, gamma {gamma:g}, s 0.6", values, stages=DEEP)
        yield Case("swelling", f"te {te:g}, gamma {gamma:g}, s -0.3", values, stages=SWOLLEN, n=6)
    # the most careful quality, on other elements than the rest
    fine = {"quality": "fine"}
    for te, gamma in ((0.01, 10), (0.01, 100), (0.04, 3), (0.04, 10), (0.2, 3), (0.2, 1000)):
        yield Case("fine", f"te {te:g}, gamma {gamma:g}, s 0.6", {"te": te, "gamma": gamma}, stages=DEEP, need=fine)
    for name in PRESETS:
        yield Case("preset", f"{name}, s 0.6", {}, name, stages=(0.1, *DEEP))
        yield Case("preset", f"{name}, s -0.3", {}, name, stages=SWOLLEN, quick=name == "plum1", n=6)


def _stones() -> Iterator[Case]:
    for te, gamma in itertools.product((0.002, 0.04, 0.2), (10, 1000)):
        values = {"te": te, "gamma": gamma, "stone": NO_STONE}
        yield Case("stone", f"none, te {te:g}, gamma {gamma:g}, both ways", values, stages=(-0.3, 0.0, *DEEP))
    for stone in ((0.05, 0.05), (0.97, 0.97), (0.95, 0.05), (0.05, 0.95)):
        yield Case("stone", f"{stone[0]:g} x {stone[1]:g}, s 0.6", {"stone": list(stone)}, stages=DEEP)
    yield Case("stone", "0.97 x 0.97, s -0.3", {"stone": [0.97, 0.97]}, stages=SWOLLEN, n=6)
    for touching in ((0.985, 0.985), (1.0, 1.0), (1.0, 0.4), (1.5, 1.5)):
        what = f"{touching[0]:g} x {touching[1]:g}, touching"
        yield Case("stone", what, {"stone": list(touching)}, refuse="smaller", quick=True)
    for half in ((0.0, 0.4), (0.4, 0.0), (0.01, 0.01)):
        yield Case("stone", f"{half[0]:g} x {half[1]:g}", {"stone": list(half)}, refuse="both")


def _shapes() -> Iterator[Case]:
    for name, shape in {"r4 0.3": NEEDLE, "r4 0.3, r8 0.9": BLADE, "r8 0.3": FLAT, "r8 2": WIDE}.items():
        yield Case("shape", f"{name}, s 0.6", shape, stages=DEEP)
        yield Case("shape", f"{name}, thin, s 0.3", {**shape, "te": 0.005}, stages=(0.1, 0.3))
        yield Case("shape", f"{name}, s -0.3", shape, stages=SWOLLEN, n=6)
    yield Case("shape", "r4 0.3, no stone, s 0.6", {**NEEDLE, "stone": NO_STONE}, stages=DEEP)
    yield Case("shape", "r4 0.3 alone", {"r4": 0.3}, refuse="closer")
    yield Case("shape", "r4 0.3, stone of the sphere", {"radii": NEEDLE["radii"]}, refuse="smaller")
    yield Case("shape", "r2 2, dented", {"r2": 2.0}, refuse="closer")


def _folds() -> Iterator[Case]:
    for te, gamma in itertools.product((0.005, 0.01, 0.02), (30, 100)):
        values = {"te": te, "gamma": gamma, "imperfection": 0.01}
        yield Case("contact", f"te {te:g}, gamma {gamma:g}, s 0.6", values, stages=(0.2, 0.4, 0.6), n=10)
    yield Case("contact", "flat, te 0.01, s 0.6", {**FLAT, "te": 0.01}, stages=(0.2, 0.4, 0.6), n=10)
    yield Case("contact", "no stone, te 0.01, s 0.6", {"stone": NO_STONE, "te": 0.01}, stages=(0.4, 0.6), n=10)


def _steps() -> Iterator[Case]:
    fruits = {"sphere": {}, "thin": {"te": 0.005}, "stiff": {"gamma": 1000}, "no stone": {"stone": NO_STONE}}
    for name, values in fruits.items():
        yield Case(
            "huge step", f"{name}, pace x 100, s 0.6", values, stages=DEEP, pace=100, quick=name == "sphere", n=6
        )
        yield Case("huge step", f"{name}, pace x 1000, no damping", values, stages=DEEP, pace=1000, damping=0.0)
    yield Case("huge step", "raisin, pace x 100", {}, "raisin", stages=DEEP, pace=100)
    yield Case("huge step", "wet on one side, pace x 100", {"wx": 0.8}, stages=(0.3, 0.5), pace=100)


def _stiff() -> Iterator[Case]:
    fruits = {"sphere": {}, "thin": {"te": 0.005}, "gamma 1000": {"gamma": 1000}, "flat": FLAT}
    for name, values in fruits.items():
        yield Case("kappa/mu 1e6", f"{name}, s 0.3", values, kappa_ratio=1e6)
    yield Case("kappa/mu 1e6", "sphere, s -0.3", {}, stages=SWOLLEN, kappa_ratio=1e6)
    yield Case("kappa/mu 1e6", "no stone, s 0.3", {"stone": NO_STONE}, kappa_ratio=1e6)


def _seeds() -> Iterator[Case]:
    for name in ("sphere", "raisin", "plum1"):
        for amplitude in (0.0, 0.01):
            yield Case("imperfection", f"{name}, {amplitude:g}", {"imperfection": amplitude}, name, stages=DEEP)
    yield Case("imperfection", "thin skin, 0.01", {"te": 0.002, "imperfection": 0.01}, stages=DEEP, n=6)
    yield Case("imperfection", "largest seed", {"seed": 2**63 - 1}, stages=(0.05, 0.1), n=6, quick=True)
    for name in ("sphere", "raisin"):
        values = {"imperfection": 0.01, "imperfection_kind": "mode"}
        yield Case("imperfection", f"{name}, mode", values, name, stages=DEEP, limit=120)
    mode = {"imperfection_kind": "mode"}
    yield Case("imperfection", "elliptic equator, mode", {**mode, **FLAT, "te": 0.2}, stages=DEEP, limit=120)
    yield Case("imperfection", "no stone, mode", {**mode, "stone": NO_STONE}, limit=120)
    yield Case("imperfection", "gamma 1, mode", {**mode, "gamma": 1}, limit=120)
    yield Case("imperfection", "mode of wet flesh", {**mode, "wx": 0.5}, refuse="waves", quick=True)


def _loadings() -> Iterator[Case]:
    wet = ([0.8, 0, 0], [0, -0.8, 0], [0.46, 0.46, 0.46])
    factors = ([0, 0, 0], [2, 1, 1], [0, 1, 2], [0, 0, 2], [1.5, 1.5, 1.5])
    for g in wet:
        yield Case("wetness", f"{g}, s 0.5", {"wetness": g}, stages=(0.1, 0.3, 0.5))
        yield Case("wetness", f"{g}, no stone", {"wetness": g, "stone": NO_STONE}, stages=(-0.3, 0.3, 0.5))
    yield Case(
        "wetness", "thin and stiff, s -0.3", {"wetness": wet[0], "te": 0.005, "gamma": 1000}, stages=SWOLLEN, n=6
    )
    for a in factors:
        yield Case("anisotropy", f"{a}, s 0.45", {"anisotropy": a}, stages=(0.2, 0.45), quick=a[1:] == [0, 2], n=6)
        yield Case("anisotropy", f"{a}, no stone, s -0.3", {"anisotropy": a, "stone": NO_STONE}, stages=SWOLLEN, n=6)
    both = {"wetness": wet[0], "anisotropy": [0.5, 1, 2]}
    yield Case("anisotropy", "wet, blade, thin", {**BLADE, **both, "te": 0.01}, stages=(0.1, 0.25))
    yield Case("anisotropy", "[2, 2, 2], s 0.6", {"anisotropy": [2, 2, 2]}, stages=DEEP, refuse="Ask for stages below")
    yield Case("wetness", "0.8, s 0.6", {"wx": 0.8}, stages=DEEP, refuse="Ask for stages below")
    yield Case("wetness", "a wide fruit swells", {**WIDE, "wz": 0.6}, stages=SWOLLEN, refuse="multiply", quick=True)
    yield Case("wetness", "1.4 long", {"wetness": [0.8, 0.8, 0.8]}, refuse="multiply")


def _cancelled() -> Iterator[Case]:
    for n, name in ((16, "stages"), (30, "slices")):
        what = f"after 3 s, between {name}"
        yield Case("cancel", what, {"te": 0.01}, stages=(0.01, *DEEP), n=n, limit=3.0, cancel=True)


def _hostile() -> Iterator[Case]:
    nan, inf = float("nan"), float("inf")
    wrong: dict[str, tuple[Any, str]] = {
        "NaN": ({"te": nan}, "finite"),
        "infinity": ({"modulus_ratio": inf}, "finite"),
        "minus infinity": ({"gamma": -inf}, "finite"),
        "NaN in a list": ({"radii": [1, nan, 1, 1, 1, 1, 1, 1]}, "finite"),
        "a word": ({"te": "thick"}, "number"),
        "NaN as a word": ({"te": "nan"}, "finite"),
        "a huge integer": ({"te": 10**400}, "exocarp_thickness"),
        "a huge integer for a seed": ({"seed": 10**400}, "seed"),
        "a huge number": ({"gamma": 1e308}, "less than or equal"),
        "a negative": ({"te": -0.04}, "greater than"),
        "a negative seed": ({"seed": -1}, "seed"),
        "a seed of 1.5": ({"seed": 1.5}, "seed"),
        "null": ({"te": None}, "number"),
        "an object for a number": ({"te": {"value": 0.04}}, "number"),
        "a list for a number": ({"te": [0.04]}, "number"),
        "a number for a list": ({"radii": 1}, "radii"),
        "a word for a list": ({"radii": "11111111"}, "radii"),
        "an object for a list": ({"radii": {"0": 1}}, "radii"),
        "an entry of a number": ({"radii": 1, "r4": 0.8}, "radii"),
        "seven radii": ({"radii": [1] * 7}, "radii"),
        "nine radii": ({"radii": [1] * 9}, "radii"),
        "a million radii": ({"radii": [1] * 1_000_000}, "radii"),
        "an empty list": ({"stone": []}, "stone"),
        "r1 = 2": ({"radii": [2] * 8}, "divide"),
        "unknown": ({"te": 0.04, "colour": "red"}, "colour"),
        "misspelt": ({"gama": 3}, "did you mean 'gamma'"),
        "a kind": ({"imperfection_kind": "ripples"}, "waves"),
        "a nest": ({"te": _nest(200)}, "number"),
        "a long word": ({"te": "x" * 1_000_000}, "number"),
        "a list of parameters": ([1, 2, 3], ""),
        "a word of parameters": ("te=0.04", ""),
        "null parameters": (None, ""),
    }
    for name, (values, word) in wrong.items():
        yield Case("hostile", name, values, refuse=word, quick=name in ("NaN", "a huge integer"))
    needs: dict[str, tuple[dict[str, Any], str]] = {
        "stage NaN": ({"stages": [nan]}, "finite"),
        "stage 1e308": ({"stages": [1e308]}, "outside"),
        "stage 10^400": ({"stages": [10**400]}, "stages"),
        "stage a word": ({"stages": ["dry"]}, "number"),
        "stages a number": ({"stages": 0.1}, "stages"),
        "resolution 10^9": ({"resolution": 10**9}, "resolution"),
        "resolution -1": ({"resolution": -1}, "resolution"),
        "quality": ({"quality": "best"}, "preview"),
        "tolerance 0": ({"tolerance": 0}, "tolerance"),
        "region back to front": ({"region": {"colatitude": [90, 30]}}, "smaller"),
        "a field": ({"fields": ["colour"]}, "colour"),
    }
    for name, (need, word) in needs.items():
        yield Case("hostile", f"need: {name}", need=need, refuse=word, quick=name == "stage NaN")
    yield Case("hostile", "nothing at all", stages=(0.02,), n=6)
    yield Case("hostile", "an empty region", stages=(0.02,), n=6, need={"region": {"azimuth": [1.0, 1.1]}})


def _nest(depth: int) -> Any:
    inner: Any = 0.04
    for _ in range(depth):
        inner = [inner]
    return inner
