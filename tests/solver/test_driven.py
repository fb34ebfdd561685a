"""What of the swings of a stage is driven by rest volumes that follow, and given back."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from solver.dehydration.settle import settle

from .test_settle import SETTINGS, Told, at_first  # noqa: F401


class Seen(Exception):
    """There have been turns enough."""


class Driven(Told):
    """Ends each turn as badly as told, in what is to grow of its speed, residual and how far volumes are behind.

    slows: part of its speed that it has lost at a swing's last look.
    begins: state, masses, rest volumes and velocity at the begin of each swing.
    """

    def __init__(self, told, growing, slows=0.0):
        super().__init__([])
        self.told, self.growing, self.slows, self.begins = list(told), growing.split(), slows, []

    def bad(self, what):
        if not self.told:
            raise Seen
        return self.told[0] if what in self.growing or not self.told[0] else 1

    def run(self, state, velocity, rest, count, a, b, damping):
        if damping == SETTINGS.swing_damping and (not self.turns or self.turns[-1][0] != damping):
            self.begins.append((float(state[0, 0]), self.masses, float(rest[0]), float(velocity[0, 0])))
        super().run(state, velocity, rest, count, a, b, damping)
        state[:] += 1
        self.masses = len(self.turns)
        looks = len(list(itertools.takewhile(lambda turn: turn[0] == damping, reversed(self.turns))))
        is_last = looks == round(SETTINGS.swing_steps / count)
        velocity[:, :3] = self.bad("speed") * (1 - self.slows * is_last)

    def rests(self, state, rest, shrinkage):
        if self.turns[-1][0] != SETTINGS.calm_damping:
            return 1.001 * rest
        behind = self.bad("behind") / 100 or 0.01
        self.told.pop(0)
        return rest * (1 + behind)

    def residual(self, state, rest, shrinkage, damping):
        return (9.0 + self.bad("residual") if self.bad("residual") else 0.9) * SETTINGS.residual


@pytest.mark.usefixtures("at_first")
@pytest.mark.parametrize(
    ("told", "growing", "stay"),
    [
        ([1, 1.6, 2.6, 4.2, 5], "speed residual behind", [4, 5]),  # from the swing after the second that is worse
        ([1, 1.6, 2.6, 2, 1], "speed residual behind", [4, 5]),  # whatever comes then
        ([1, 2, 1, 2, 1], "speed residual behind", []),  # not twice in a row
        ([1, 1.4, 1.9, 2.6, 3.5], "speed residual behind", []),
        ([1, 1.6, 2.6, 4.2, 5], "speed behind", []),
        ([1, 1.6, 2.6, 4.2, 5], "residual behind", []),
        ([1, 1.6, 2.6, 4.2, 5], "speed residual", []),
        # the first balances: it is calmed under new volumes, and then swings
        ([0, 0.1, 0.1, 0.1, 2, 4, 2, 2], "speed residual behind", []),
        # slowly: the eighth in a row is three times as bad as the first, or any as the one seven before
        ([1, 1.4, 1.9, 1.7, 2, 2.6, 2.2, 3.1, 1, 1], "speed residual behind", [9, 10]),
        ([1, 1.4, 1.9, 1.7, 2, 2.6, 2.2, 2.9, 4.3, 1], "speed residual behind", [10]),
        ([1, 1.4, 1.9, 1.7, 2, 2.6, 2.2, 2.9, 4.1, 1], "speed residual behind", []),
        ([1, 1.4, 1.9, 1.7, 2, 2.6, 3.1, 1, 1, 1], "speed residual behind", []),
        ([1, 1.4, 1.9, 1.7, 2, 2.6, 2.2, 3.1, 1, 1], "speed residual", []),
    ],
)
@pytest.mark.parametrize("slows", [0.0, 0.01])
def test_volumes_stay_in_longer_swings_where_each_ends_worse(told, growing, slows, stay):
    """They would drive what swings slower than they follow, whether or not all stands still at a swing's last look."""
    motion = Driven(told, growing, slows)
    with pytest.raises(Seen):
        settle(motion, np.zeros((1, 4)), np.zeros((1, 4)), np.ones(1), 0.2)
    swings = [
        [rest for *_, rest in turns]
        for damping, turns in itertools.groupby(motion.turns, key=lambda turn: turn[0])
        if damping == SETTINGS.swing_damping
    ]
    swings.pop()  # it is broken off
    held = [k for k, rests in enumerate(swings, 1) if len(set(rests)) == 1]
    longer = [k for k, rests in enumerate(swings, 1) if len(rests) == 4 * len(swings[0])]
    assert len(swings) >= 5
    assert held == longer == stay


@pytest.mark.usefixtures("at_first")
@pytest.mark.parametrize(
    ("told", "same"),
    [
        ([1, 1.6, 2.6, 4.2, 5], {3: 1}),  # the fourth from where the second began, and no other
        ([1, 1.6, 1, 1.6, 2.6, 4.2], {5: 3}),
        ([1, 1.4, 1.9, 2.6, 3.5], {}),
    ],
)
def test_swings_that_were_driven_are_given_back(told, same):
    """State, masses and rest volumes are those of before the first of them, and all stands still."""
    motion = Driven(told, "speed residual behind")
    state, velocity = np.zeros((1, 4)), np.zeros((1, 4))
    with pytest.raises(Seen):
        settle(motion, state, velocity, np.ones(1), 0.2)
    places = [begin[:3] for begin in motion.begins]
    assert {k: places.index(place) for k, place in enumerate(places) if place in places[:k]} == same
    assert [motion.begins[k][3] for k in same] == [0.0] * len(same)
