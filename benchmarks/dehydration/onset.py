"""The onset of the exact references by road: python -m benchmarks.dehydration.onset --help.

Error is that of s_cr, relative to the reference; seconds are those of one call on this machine. With --elliptic: only
spheres and Table 1's fruits with elliptic equators by the road of fruits of any shape (a record of its own, kept after
each run; --finer adds the fruits at quality fine, which their default's error is measured against).
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

from benchmarks.figures import keep
from solver.dehydration import SOLVER, DehydrationParams
from solver.dehydration.bifurcation import onset

REFERENCE = Path(__file__).parents[2] / "tests" / "solver" / "core_shell_sphere.json"
AXISYMMETRIC = ("raisin", "wolfberry", "jujube1", "jujube2")
#: The paper gives no r8 of a wolfberry: r8 = r4 in the preset, and a nearly round equator here.
ELLIPTIC: dict[str, dict[str, float]] = {"plum2": {}, "plum1": {}, "wolfberry": {"r8": 0.38}}

#: The sphere that the road of fruits of any shape is tried on: stone, te, gamma.
_SPHERE = (0.4, 0.04, 10)
#: More of them, beside the reference's: thicker skins, on whose meshes neighbouring degrees come almost at once.
_THICKER, _MODULI = (0.05, 0.06, 0.07, 0.08, 0.1), (10, 50)


def measure(case: dict[str, Any], quality: str, full: bool) -> list[dict[str, Any]]:
    """Return the onset of a sphere by its roads, one of them by that of fruits of any shape where asked for."""
    stone, te, gamma = (case[name] for name in ("stone_radius", "exocarp_thickness", "gamma"))
    params = DehydrationParams.parse({"stone": (stone, stone), "te": te, "gamma": gamma})
    rows = []
    for kappa, key in ((None, "s_cr"), (1000.0, "s_cr_kappa_over_mu_1000")):
        there = full and (stone, te, gamma) == _SPHERE
        for road in ("radial", "meridional", *["full"] * there):
            found = onset(params, kappa_ratio=kappa, road=road, quality=quality)  # type: ignore[arg-type]
            assert found.s_cr is not None
            error = found.s_cr / case[key] - 1
            row = {"stone": stone, "te": te, "gamma": gamma, "kappa_ratio": kappa, "road": road, "s_cr": found.s_cr}
            rows.append(row | {"error": error, "degree": found.degree, "seconds": found.seconds})
            print(
                f"A {stone:g} te {te:g} gamma {gamma:<3g} kappa/mu {kappa or 'inf':<7} {road:11} s_cr {found.s_cr:.7f} "
                f"error {error:+9.1e} degree {found.degree:3d} (exact {case['l_cr']}) {found.seconds:7.2f} s",
                flush=True,
            )
    return rows


def fruits(quality: str) -> list[dict[str, Any]]:
    rows = []
    for name in AXISYMMETRIC:
        params = SOLVER.parse({}, name)
        assert isinstance(params, DehydrationParams)
        for method in ("exact", "linear"):
            found = onset(params, quality=quality, method=method)
            rows.append({"preset": name, **found.summary()})
            print(
                f"{name:10} {method:7} s_cr {found.s_cr:.5f} m {found.wavenumber} degree {found.degree} "
                f"{found.seconds:7.2f} s",
                flush=True,
            )
    return rows


def _by_the_full_road(params: DehydrationParams, name: str, quality: str, exact: float | None) -> dict[str, Any]:
    begin = time.process_time()
    found = onset(params, road="full", quality=quality)
    assert found.s_cr is not None
    error = found.s_cr / exact - 1 if exact else None
    row = {"fruit": name, "quality": quality, **found.summary(), "error": error, "cpu": time.process_time() - begin}
    del row["ties"]
    print({key: row[key] for key in ("fruit", "quality", "s_cr", "error", "seconds", "cpu")}, flush=True)
    return row


def elliptic(finer: bool) -> None:
    """Keep the onsets that only the road of fruits of any shape finds, and spheres by it, after each of them."""
    rows: list[dict[str, Any]] = []
    names = ("stone_radius", "exocarp_thickness", "gamma")
    cases = [tuple(case[name] for name in names) for case in json.loads(REFERENCE.read_text())["bifurcation"]]
    thicker = [(_SPHERE[0], te, gamma) for gamma in _MODULI for te in _THICKER]
    for stone, te, gamma in [*(case for case in cases if case[1] == _SPHERE[1]), *thicker]:
        params = DehydrationParams.parse({"stone": (stone, stone), "te": te, "gamma": gamma})
        exact = onset(params)
        name = f"sphere, stone {stone:g}, te {te:g}, gamma {gamma:g}"
        rows.append(_by_the_full_road(params, name, "default", exact.s_cr) | {"exact_degree": exact.degree})
    for quality in ("default", *["fine"] * finer):
        for name, changes in ELLIPTIC.items():
            fruit = SOLVER.parse(changes, name)
            assert isinstance(fruit, DehydrationParams)
            told = ", ".join([name, *(f"{key} = {value:g}" for key, value in changes.items())])
            rows.append(_by_the_full_road(fruit, told, quality, None))
            keep("dehydration-onset-full", rows, "dehydration")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quality", default="default", choices=("preview", "default", "fine"))
    parser.add_argument("--full", action="store_true", help="one sphere by the road of fruits of any shape, too")
    parser.add_argument("--fruits", action="store_true", help="the axisymmetric fruits of Table 1, too")
    parser.add_argument("--elliptic", action="store_true", help="only fruits of any shape, and spheres as if they were")
    parser.add_argument("--finer", action="store_true", help="with --elliptic: at quality fine, too (minutes)")
    asked = parser.parse_args()
    if asked.elliptic:
        elliptic(asked.finer)
        return
    cases = json.loads(REFERENCE.read_text())["bifurcation"]
    rows = [row for case in cases for row in measure(case, asked.quality, asked.full)]
    for road in ("radial", "meridional"):
        worst = max(abs(row["error"]) for row in rows if row["road"] == road)
        print(f"{road}: largest error {worst:.1e}")
    more = fruits(asked.quality) if asked.fruits else []
    keep("dehydration-onset", rows, "dehydration", quality=asked.quality, fruits=more)


if __name__ == "__main__":
    main()
