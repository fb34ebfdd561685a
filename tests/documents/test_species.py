"""The page's table of species: every constant of the code, and where each is said to come from."""

from __future__ import annotations

import re

from solver.decay.fields.colony import MOULDS, ROTS

from ._blocks import ROOT


def test_the_species_constants_are_those_of_the_page() -> None:
    text = (ROOT / "docs" / "decay.md").read_text(encoding="utf-8")
    table = text.split("| species | speed mm/day |", 1)[1].split("\n\n", 1)[0]
    rows = [re.findall(r"[^|\n]+", line) for line in table.splitlines()[2:]]
    assert len(rows) == len(ROTS)
    for name, (_, *cells) in zip(ROTS, rows, strict=True):
        rot, felt = ROTS[name], MOULDS.get(name)
        said = [word for cell in cells for word in map(str.strip, cell.split(",")) if word not in ("", "none")]
        assert all(re.fullmatch(r"-?[\d.]+ [rfc]", word) for word in said), said
        constants = [rot.speed, rot.coldest, rot.best, rot.hottest, rot.driest, rot.wettest, rot.lag]
        assert [float(word[:-2]) for word in said] == constants + ([felt.lag] if felt else [])
