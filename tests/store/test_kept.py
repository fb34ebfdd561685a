"""What is kept by its size: as much as there is room for, the last used longest."""

from __future__ import annotations

import itertools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from store.blending.methods import bands, cells, poles
from store.blending.methods.products import Products
from store.kept import Kept, Part


def test_the_last_used_stay_and_no_more_than_there_is_room_for() -> None:
    made: list[str] = []
    kept: Kept[str, bytes] = Kept(10, len)

    def get(key: str, size: int) -> bytes:
        def make() -> bytes:
            made.append(key)
            return bytes(size)

        return kept.get(key, make)

    get("a", 4), get("b", 4), get("a", 4), get("c", 4)
    assert made == ["a", "b", "c"]  # and b is gone, which was used before a
    get("a", 4), get("c", 4)
    assert made == ["a", "b", "c"]
    get("b", 4)
    assert made == ["a", "b", "c", "b"]
    assert len(get("whale", 100)) == 100  # larger than the room: alone, until the next
    assert len(kept) == 1
    get("a", 4), get("b", 4)
    assert len(kept) == 2


def test_owners_share_a_room_and_leave_it() -> None:
    class Owner:
        pass

    made: list[tuple[int, str]] = []
    shared: Kept[tuple[int, str], bytes] = Kept(10, len)
    owners = [Owner(), Owner()]
    parts = [Part(shared, owner) for owner in owners]

    def get(number: int, key: str) -> None:
        def make() -> bytes:
            made.append((number, key))
            return bytes(4)

        parts[number].get(key, make)

    get(0, "a"), get(1, "a"), get(0, "a"), get(1, "a")
    assert made == [(0, "a"), (1, "a")]
    get(1, "b")  # the first owner's makes room for it
    get(1, "a"), get(1, "b")
    assert made == [(0, "a"), (1, "a"), (1, "b")]
    get(0, "a")
    assert len(shared) == 2
    del owners[0]
    assert len(shared) == 1
    get(1, "b"), get(1, "c")
    assert made[3:] == [(0, "a"), (1, "c")]
    assert len(shared) == 2


def test_threads_that_make_one_thing_twice_count_it_once() -> None:
    kept: Kept[int, bytes] = Kept(100, len)
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda i: kept.get(i % 10, lambda: bytes(10)), range(2000)))
    assert {len(value) for value in found} == {10}
    assert len(kept) == 10


def test_a_table_of_a_hundred_cells_makes_each_of_them_once() -> None:
    """A grid of 5 x 6 samples at 5 stages has so many: to make one anew takes as long as ten look-ups."""
    stored = np.random.default_rng(3).standard_normal((30, 5, 3, 25, 25, 2)).astype(np.float32)
    known, made = cells.Cells(stored, Products(stored, bands.Bands(24))), 0
    corners = [
        ((i, i + 1, i + 6, i + 7), stages)
        for i in (6 * row + column for row in range(4) for column in range(5))
        for stages in ((0,), (0, 1), (1, 2), (2, 3), (3, 4))
    ]
    make = known._make

    def counted(samples: tuple[int, ...], stages: tuple[int, ...]) -> cells.Cell:
        nonlocal made
        made += 1
        return make(samples, stages)

    known._make = counted  # type: ignore[method-assign]
    for samples, stages in itertools.chain(corners, corners):
        known.of(samples, stages)
    assert made == len(corners) == 100


def test_a_scene_of_all_fruits_at_three_levels_of_detail_makes_its_windows_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Eighteen tables have eighteen highest degrees, and windows take three look-ups to make."""
    made, make = 0, poles._windows

    def counted(band: int, degree: int, dtype: str) -> tuple[np.ndarray, np.ndarray]:
        nonlocal made
        made += 1
        return make(band, degree, dtype)

    monkeypatch.setattr(poles, "_windows", counted)
    monkeypatch.setattr(poles, "_kept", Kept(poles._ROOM, lambda both: both[0].nbytes + both[1].nbytes))
    pairs = [(band, degree) for degree in range(41, 59) for band in (8, 16, 32)]
    for band, degree in pairs + pairs:
        waves = np.ones((3, band + 1, band + 1), np.complex64)
        poles.multiply(waves, np.ones((band + 1, band + 1), np.float32), degree)
    assert made == len(pairs)
