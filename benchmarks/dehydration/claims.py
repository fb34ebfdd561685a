"""The paper's maps as measured statements: python -m benchmarks.dehydration.claims DIR [--json FILE].

DIR holds one store per plan: fig7, fig8, fig9, fig10, table1 (`wizen sweep examples/fig7.toml --store DIR/fig7`, ...).
Claims C1 to C6 are those of Liu et al. 2014, section 4; each gets the quantity that decides it, at s = 0.3, and a
verdict. A plan that was not run, or a sample that is missing, is said to be missing.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.dehydration.pattern import Pattern, patterns

STAGE = 0.3
#: A trend counts if its ends differ by more than twice what another seed changes (about 5 %).
CLEAR = 0.10
#: Wrinkles are local to the thick flesh if they are at least that many times as high there.
LOCAL = 1.5


class Claim(NamedTuple):
    """One statement of the paper, what was measured, and whether it holds."""

    name: str
    statement: str
    measured: str
    verdict: str


def _series(values: Sequence[float]) -> str:
    return " ".join(f"{value:.3g}" for value in values)


def _trend(values: Sequence[float], rising: bool) -> bool | None:
    """Whether the ends differ clearly in the wanted direction; None if they hardly differ."""
    change = values[-1] / values[0] - 1
    return None if abs(change) < CLEAR else (change > 0) == rising


def _verdict(trends: Sequence[bool | None]) -> str:
    if all(trend is True for trend in trends):
        return "holds"
    if any(trend is False for trend in trends):
        return "holds in part" if any(trend is True for trend in trends) else "does not hold"
    return "holds in part" if any(trend is True for trend in trends) else "unclear"


def _rows(found: Sequence[Pattern], by: Callable[[Pattern], float], along: Callable[[Pattern], float]) -> dict:
    rows: dict[float, list[Pattern]] = {}
    for pattern in sorted(found, key=along):
        rows.setdefault(by(pattern), []).append(pattern)
    return dict(sorted((value, row) for value, row in rows.items() if len(row) > 1))


def thickness_and_stiffness(found: Sequence[Pattern]) -> list[Claim]:
    """C1 and C2, from Fig. 7."""
    claims = []
    for name, text, fixed, along in (
        ("C1", "buckles fewer and larger with te", "gamma", "te"),
        ("C2", "buckles larger with gamma", "te", "gamma"),
    ):
        rows = _rows(found, lambda p, k=fixed: getattr(p, k), lambda p, k=along: getattr(p, k))
        trends, parts = [], []
        for value, row in rows.items():
            counts, sizes = [p.buckles for p in row], [p.wavelength for p in row]
            trends.append(_trend(sizes, True))
            if name == "C1":
                trends.append(_trend(counts, False))
            parts.append(f"{fixed} {value:g}: wavelength {_series(sizes)}, buckles {_series(counts)}")
        claims.append(Claim(name, text, "; ".join(parts), _verdict(trends)))
    return claims


def stone_size(found: Sequence[Pattern]) -> Claim:
    """C3, from Fig. 8: how long the pits are for their width."""
    rows = _rows(found, lambda p: p.te, lambda p: p.stone[0])
    parts = [
        f"te {te:g}: elongation {_series([p.elongation for p in row])}, buckles {_series([p.buckles for p in row])}"
        for te, row in rows.items()
    ]
    growth = [row[-1].elongation / row[0].elongation - 1 for row in rows.values()]
    if len(growth) < 2:
        return Claim("C3", "a larger stone makes strips, most for thin te", "; ".join(parts), "unclear: one skin only")
    thin, thick = growth[0], growth[-1]
    verdict = "holds" if thin > CLEAR and thin > thick else "unclear" if abs(thin) < CLEAR else "does not hold"
    return Claim("C3", "a larger stone makes strips, most for thin te", "; ".join(parts), verdict)


def stone_length(found: Sequence[Pattern]) -> Claim:
    """C4, from Fig. 9: wrinkles within 35 degrees of the poles against those within 30 degrees of the equator."""
    rows = _rows(found, lambda p: p.te, lambda p: p.stone[0])
    parts = [f"te {te:g}: poles/equator {_series([p.poles_to_equator for p in row])}" for te, row in rows.items()]
    falls = [_trend([p.poles_to_equator for p in row], False) for row in rows.values()]
    change = [row[-1].poles_to_equator / row[0].poles_to_equator for row in rows.values()]
    less = "less so at the thickest skin" if change[-1] > change[0] else "not less so at the thickest skin"
    return Claim("C4", "a longer stone flattens the poles", "; ".join(parts) + f" ({less})", _verdict(falls))


def slenderness(found: Sequence[Pattern]) -> Claim:
    """C5, from Fig. 10: +1 ridges along meridians, 0 reticular, -1 rings; at the equator and towards the poles."""
    rows = _rows(found, lambda p: p.te, lambda p: p.waist)
    parts = [
        f"te {te:g}, r4 {_series([p.waist for p in row])}: anisotropy at the equator "
        f"{_series([p.equator_anisotropy for p in row])}, poles {_series([p.polar_anisotropy for p in row])}"
        for te, row in rows.items()
    ]
    ridged = [row[0].equator_anisotropy > 0.3 for row in rows.values()]
    weaker = [row[0].equator_anisotropy > row[-1].equator_anisotropy + CLEAR for row in rows.values()]
    verdict = "holds" if all(ridged) and all(weaker) else "holds in part" if any(weaker) else "does not hold"
    return Claim("C5", "prolate fruits have ridges along meridians, stronger as r4 falls", "; ".join(parts), verdict)


def fruits(found: Sequence[Pattern]) -> Claim:
    """C6, from Table 1: ridged or reticular, and where plum 1 buckles at all."""
    said = {"jujube1": True, "raisin": True, "wolfberry": True, "jujube2": False, "plum2": False}
    parts, right = [], []
    for pattern in found:
        if pattern.name == "plum1":
            right.append(pattern.thick_to_thin > LOCAL)
            parts.append(f"plum1: wrinkles {pattern.thick_to_thin:.2g} times as high where the flesh is thick")
            continue
        ridged = abs(pattern.equator_anisotropy) > 0.3
        right.append(ridged == said.get(pattern.name, ridged))
        parts.append(f"{pattern.name} {pattern.equator_anisotropy:+.2f} ({'ridged' if ridged else 'reticular'})")
    verdict = "holds" if all(right) else f"holds for {sum(right)} of {len(right)}"
    statement = "jujube 1, raisin, wolfberry ridged; jujube 2, plum 2 reticular; plum 1 only where thick"
    return Claim("C6", statement, "; ".join(parts), verdict)


def judge(root: Path) -> list[Claim]:
    """All claims whose plans were run in stores under `root`."""
    makers: dict[str, Callable[[Sequence[Pattern]], list[Claim]]] = {
        "fig7": thickness_and_stiffness,
        "fig8": lambda found: [stone_size(found)],
        "fig9": lambda found: [stone_length(found)],
        "fig10": lambda found: [slenderness(found)],
        "table1": lambda found: [fruits(found)],
    }
    claims = []
    for name, maker in makers.items():
        found = patterns(root / name, STAGE)
        claims += maker(found) if len(found) > 1 else [Claim(name, "", "not run", "missing")]
    return claims


def main() -> int:
    """Print the claims as a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("root", type=Path, help="folder with one store per plan")
    parser.add_argument("--json", type=Path, help="write the claims here as well")
    asked = parser.parse_args()
    claims = judge(asked.root)
    table = Table("claim", "the paper says", f"measured at s = {STAGE}", "verdict", show_lines=True)
    for claim in claims:
        table.add_row(*claim)
    Console(width=160).print(table)
    if asked.json:
        asked.json.write_text(json.dumps([claim._asdict() for claim in claims], indent=1) + "\n", encoding="utf-8")
    return 0 if np.all([claim.verdict != "missing" for claim in claims]) else 1


if __name__ == "__main__":
    sys.exit(main())
