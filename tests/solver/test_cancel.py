"""A run and an onset look for a cancel often, and looking changes nothing."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from solver import registry
from solver.contract import Cancelled, Context
from solver.dehydration import motion as module
from solver.dehydration import onset
from solver.dehydration.motion import Motion
from solver.dehydration.settings import choose

SOLVER = registry.get("dehydration")


class Watch:
    """Counts the looks, and asks to stop after as many as it stands."""

    def __init__(self, stands):
        self.looks, self._stands = 0, stands

    def __call__(self):
        self.looks += 1
        return self.looks > self._stands


def _marched(watch, watched, monkeypatch):
    monkeypatch.setattr(module, "_WATCHED", watched)
    params = SOLVER.parse({"te": 0.1, "mirrors": "xyz"})
    moving = Motion(params, dataclasses.replace(choose(params, "preview"), n=8), Context(cancelled=watch))
    state, velocity = moving.smooth(0.02)
    watch.looks = 0
    moving.run(state, velocity, moving.rest, 95, 0.02, 0.03, 0.01)
    return state


def test_a_march_is_looked_at_as_often_as_asked_and_stays_the_same(monkeypatch):
    once, often = Watch(1000), Watch(1000)
    whole, cut = _marched(once, 10**9, monkeypatch), _marched(often, 1, monkeypatch)
    assert once.looks == 1
    assert often.looks == 10  # at every search for contact
    # theta is the same line, cut into pieces and rounded anew
    assert np.abs(whole - cut).max() * 2.0**-29 < 1e-6
    with pytest.raises(Cancelled):
        _marched(Watch(3), 1, monkeypatch)


def test_an_onset_on_the_full_road_looks_within_its_factors():
    """One equilibrium of Newton's method takes some ten steps: a look at each alone would be few."""
    params = SOLVER.parse({"te": 0.1}, preset="sphere")
    watch = Watch(60)
    with pytest.raises(Cancelled):
        onset(params, road="full", quality="preview", context=Context(cancelled=watch))
    assert watch.looks == 61
