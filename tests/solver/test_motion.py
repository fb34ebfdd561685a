"""What moves a fruit: what has left the finite is taken again, and then refused."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from solver.contract import Context, Unstable
from solver.dehydration import DehydrationParams
from solver.dehydration.motion import Motion
from solver.dehydration.path import Path
from solver.dehydration.settings import choose

PARAMS = DehydrationParams.parse({"te": 0.2, "gamma": 3.0, "mirrors": "xyz"})
STEPS = 40


def moving():
    motion = Motion(PARAMS, dataclasses.replace(choose(PARAMS, "preview"), n=6), Context())
    return motion, *motion.smooth(0.05)


def run(motion, state, velocity):
    motion.run(state, velocity, motion.rest, STEPS, 0.05, 0.06, 0.01)


def test_what_leaves_the_finite_is_taken_again_with_masses_that_follow_closely(monkeypatch):
    motion, state, velocity = moving()
    arrive, blown = motion._arrive, []

    def once(state, count, shrinkage):
        if not blown:
            blown.append(shrinkage)
            state[:], velocity[:], motion.masses = 2**30, np.nan, (motion.layout, state, False)
            raise Unstable("left the finite", advice="")
        arrive(state, count, shrinkage)

    monkeypatch.setattr(motion, "_arrive", once)
    run(motion, state, velocity)
    assert blown
    careful, expected, speed = moving()
    careful._closely = True
    run(careful, expected, speed)
    assert_array_equal(state, expected)
    assert_array_equal(velocity, speed)
    assert motion.steps == STEPS
    assert motion._closely


def test_a_stage_on_a_copy_leaves_the_march_as_it_was(monkeypatch):
    """Masses that follow closely from there on would be another march's."""
    path = Path(PARAMS, dataclasses.replace(choose(PARAMS, "preview"), n=6, start=0.0, rungs=(0.05,)), Context())
    settle = path._settle

    def blown(*args):
        found = settle(*args)
        path.motion._closely = True
        return found

    path.stage(0.01, 0.05)
    monkeypatch.setattr(path, "_settle", blown)
    path.stage(0.02, 0.05)
    assert not path.motion._closely


def test_what_leaves_the_finite_nevertheless_is_refused(monkeypatch):
    motion, state, velocity = moving()
    tries = []

    def never(state, count, shrinkage):
        tries.append(count)
        raise Unstable("left the finite", advice="")

    monkeypatch.setattr(motion, "_arrive", never)
    for _ in range(2):
        with pytest.raises(Unstable):
            run(motion, state, velocity)
    assert len(tries) == 3  # it is tried closely once


def test_masses_that_follow_closely_are_taken_anew_sooner():
    found = []
    for closely in (False, True):
        motion, state, velocity = moving()
        motion._closely = closely
        before = motion.layout
        state += round(0.3 * motion._edge * 2**29)
        motion._follow(state, velocity)
        found.append(motion.layout is not before)
    assert found == [False, True]


def test_who_goes_on_from_another_state_looks_for_pairs_anew():
    """What was searched where the last steps were stays for the next ones alone."""
    motion, state, velocity = moving()
    run(motion, state, velocity)
    searched = motion._skin.contact.searched.copy()
    assert np.abs(searched).max() < 2
    motion.run(state, velocity, motion.rest, 10, 0.06, 0.06, 0.5)
    assert_array_equal(motion._skin.contact.searched, searched)
    motion.masses = motion.masses
    assert motion._skin.contact.searched.min() > 1e6
    begun = []
    motion.run = lambda *_: begun.append(motion._skin.contact.searched.min())
    run(motion, state, velocity)
    motion.advance(state, velocity, motion.rest, 10, 0.06, 0.06, 0.5)
    assert begun == [pytest.approx(1e15)] * 2
