"""Schedules of faults against the real ledger and runner: every job ends, once, and old defects are found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from _simulation import Broken, Unfenced, World


def play(seeds: range, root: Path, **defect: Any) -> int | None:
    """Return the first seed whose schedule breaks an invariant, if one does."""
    for seed in seeds:
        try:
            World(seed, root, **defect).run()
        except Broken:
            return seed
    return None


def test_a_thousand_schedules(tmp_path: Path) -> None:
    """As many as find each old defect, see below."""
    for seed in range(1000):
        World(seed, tmp_path).run()


@pytest.mark.slow
def test_a_hundred_thousand_schedules(tmp_path: Path) -> None:
    for seed in range(1000, 102_000):
        World(seed, tmp_path).run()


@pytest.mark.parametrize(
    "defect", [{"ledger": Unfenced}, {"shared_names": True}, {"dated": True}], ids=["unfenced", "one name", "dates"]
)
def test_old_defects_are_found_within_a_thousand(tmp_path: Path, defect: dict[str, Any]) -> None:
    assert play(range(1000), tmp_path, **defect) is not None


def test_a_seed_is_a_schedule(tmp_path: Path) -> None:
    """The same seed tells the same story, so that a failure can be looked at."""
    one, two = World(7, tmp_path), World(7, tmp_path)
    one.run()
    two.run()
    assert one.now == two.now
    assert [(j.key, j.state, j.claims) for j in one.view.jobs()] == [
        (j.key, j.state, j.claims) for j in two.view.jobs()
    ]
