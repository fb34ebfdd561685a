"""Weighted sums of spectra, against sums term by term."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from store.blending import stacks
from store.blending.stacks import Stacks
from store.kept import Kept
from store.surfaces import steps
from store.surfaces.steps_compiled import COMPILED


def spectra(symmetric: bool) -> np.ndarray:
    found = np.random.default_rng(2).standard_normal((5, 2, 3, 9, 9, 2)).astype(np.float32)
    if symmetric:
        found[..., 1::2, :, :] = 0
    return found


@pytest.mark.parametrize("symmetric", [False, True])
@pytest.mark.parametrize("band", [4, 8])
def test_a_sum_is_a_sum(symmetric: bool, band: int) -> None:
    stored = spectra(symmetric)
    samples, stages, parts = (4, 0, 3), (1, 0), np.array([0.3, 0.1, -0.2, 0.5, 0.25, 0.05])
    wanted = sum(
        w * stored[i, j, :, : band + 1, : band + 1]
        for (i, j), w in zip(itertools.product(samples, stages), parts, strict=True)
    )
    kept = Stacks(stored)
    for _ in range(2):  # made, then kept
        found = kept.mean(samples, stages, parts, band)
        assert found.flags.c_contiguous
        np.testing.assert_allclose(found, wanted, atol=1e-6)
    assert not kept.mean(samples, (), np.empty(0), band).any()


@pytest.mark.parametrize("symmetric", [False, True])
@pytest.mark.parametrize("way", [steps.PLAIN, COMPILED])
def test_many_samples_share_the_stacks_of_their_stages(
    symmetric: bool, way: steps.Steps, monkeypatch: pytest.MonkeyPatch
) -> None:
    stored = np.concatenate([spectra(symmetric), 2 * spectra(symmetric)])
    monkeypatch.setattr(steps, "_way", [way])
    room = Kept[Any, Any](1 << 20, lambda stack: stack.waves.nbytes)
    monkeypatch.setattr(stacks, "_kept", room)
    kept, parts = Stacks(stored), np.random.default_rng(3).standard_normal((10, 12))
    for samples in ((0, 1, 2, 3, 4, 5), (3, 9, 1, 8, 2, 0), (9, 8, 7, 6, 5)):
        for own in parts[:, : 2 * len(samples)]:
            wanted = np.einsum("t,t...->...", own, stored[list(samples)].reshape(-1, *stored.shape[2:]))
            np.testing.assert_allclose(kept.mean(samples, (0, 1), own, 8), wanted, atol=1e-5)
    assert len(room) == 2


def test_tables_keep_no_more_together_than_there_is_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    stored = spectra(False)
    room = Kept[Any, Any](5 * stored[0, 0].nbytes, lambda stack: stack.waves.nbytes)
    monkeypatch.setattr(stacks, "_kept", room)
    tables = Stacks(stored), Stacks(2 * stored)
    for i in range(5):
        for scale, kept in enumerate(tables, 1):
            found = kept.mean((i, (i + 1) % 5), (0,), np.array([0.5, 0.5]), 8)
            np.testing.assert_allclose(found, scale * (stored[i, 0] + stored[(i + 1) % 5, 0]) / 2, atol=1e-6)
    assert len(room) == 2
