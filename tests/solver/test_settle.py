"""How a stage comes to rest: it swings, and is calmed, and rest volumes follow; and where the rungs stand."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

from solver import registry
from solver.contract import Context, Unstable
from solver.dehydration import settle as settling
from solver.dehydration.kernel.march import SEARCH_EVERY
from solver.dehydration.path import Path
from solver.dehydration.settings import choose
from solver.dehydration.settle import settle

SOLVER = registry.get("dehydration")
PARAMS = SOLVER.parse({"mirrors": "xyz"})
SETTINGS = choose(PARAMS, "preview")
EASING = 20 * SETTINGS.swing_damping


class Told:
    """Stands in for `Motion`: at each look the residual is the next that it is told; the surface stays.

    volumes: rest volumes that go with the pressures at the end of each turn, as long as they are told; then the last.
    """

    params, settings = PARAMS, SETTINGS
    slice = 1000
    masses = None

    def __init__(self, residuals, volumes=(1.0,)):
        self.left, self.volumes, self.turns, self.steps = list(residuals), list(volumes), [], 0
        self.layout = self
        self.mass, self.pull, self.free = np.ones(1), np.zeros(0), np.ones(1, bool)
        self.sector = self
        self.copies = 1

    def surface(self, state):
        return np.zeros((1, 3))

    def whole(self, surface):
        return surface

    def run(self, state, velocity, rest, count, a, b, damping):
        self.steps += count
        self.turns.append((damping, count, float(rest[0])))

    def residual(self, state, rest, shrinkage, damping):
        return self.left.pop(0) * SETTINGS.residual

    def rests(self, state, rest, shrinkage):
        return np.full(1, self.volumes.pop(0) if len(self.volumes) > 1 else self.volumes[0])

    def strained(self, state, rest, shrinkage, with_energy):
        return 0.0, 1.0

    def least_ratio(self, state, shrinkage):
        return 1.0

    def looks(self):
        """S for each swing, E for each turn of easing and c for each look while it is calmed, in order."""
        letters = {SETTINGS.calm_damping: "c", SETTINGS.swing_damping: "s", EASING: "e"}
        word = "".join(letters[damping] for damping, *_ in self.turns)
        # two that swing or ease never follow each other
        return re.sub("e+", "E", re.sub("s+", "S", word))


@pytest.fixture
def at_first(monkeypatch):
    """Only how it balances at first, looked at twice while it is calmed: it does not go on from there."""
    monkeypatch.setattr(settling, "_CALM_LOOK", SETTINGS.calm_steps // 2)
    monkeypatch.setattr(settling, "_to_the_end", lambda motion, state, velocity, found, *_: found)


def settled(residuals, shrinkage=0.2, volumes=(1.0,)):
    motion = Told(residuals, volumes)
    found = settle(motion, np.zeros((1, 4)), np.zeros((1, 4)), np.ones(1), shrinkage)
    assert not motion.left
    assert found.residual <= SETTINGS.residual
    assert found.rest == pytest.approx(motion.volumes[-1], rel=SETTINGS.residual)
    return motion


@pytest.mark.usefixtures("at_first")
@pytest.mark.parametrize(
    ("residuals", "turns"),
    [
        ([0.9], "Sc"),
        ([1.2, 0.9], "Scc"),
        ([9.0, 5.0, 0.9], "SccSc"),
    ],
)
def test_it_swings_and_is_calmed_by_turns(residuals, turns):
    assert settled(residuals).looks() == turns


@pytest.mark.usefixtures("at_first")
@pytest.mark.parametrize(
    ("residuals", "turns"),
    [
        # near: eased; not near: it swings
        ([2.9, 2.9, 0.9], "SccEc"),
        ([3.1, 3.1, 0.9], "SccSc"),
        # nearer each time: eased on, else it swings
        ([2.9, 2.9, 2.0, 2.0, 1.3, 1.3, 0.9], "SccEccEccEc"),
        ([2.9, 2.9, 2.1, 2.1, 0.9], "SccEccSc"),
        # near again after that swing: eased, however near it was before
        ([2.9, 2.9, 2.8, 2.8, 2.9, 2.9, 0.9], "SccEccSccEc"),
        # off balance after easing: it swings
        ([2.9, 2.9, 9.0, 9.0, 0.9], "SccEccSc"),
    ],
)
def test_what_is_near_balance_is_eased_as_long_as_that_helps(residuals, turns):
    assert settled(residuals).looks() == turns


@pytest.mark.usefixtures("at_first")
def test_a_turn_of_easing_is_as_long_as_a_swing_and_volumes_follow_it_twice():
    still = [1.0] * len(settled([0.9]).turns)  # a swing, and the turn after it
    motion = Told([2.9, 2.9, *[0.9] * 9], (*still, 1.01))
    settle(motion, np.zeros((1, 4)), np.zeros((1, 4)), np.ones(1), 0.2)
    assert motion.looks().startswith("SccEc")
    eased = [(count, rest) for damping, count, rest in motion.turns if damping == EASING]
    after = [rest for damping, _, rest in motion.turns if damping == SETTINGS.calm_damping][2]
    assert sum(count for count, _ in eased) == pytest.approx(SETTINGS.swing_steps, abs=1)
    assert [*(rest for _, rest in eased), after] == pytest.approx([1.0, 1.01**0.5, 1.01**0.75])


@pytest.mark.usefixtures("at_first")
def test_volumes_follow_a_swing_a_little_and_more_where_all_stands_still():
    class Swinging(Told):
        """The kinetic energy begins to fall at the fourth look."""

        def run(self, state, velocity, rest, count, a, b, damping):
            super().run(state, velocity, rest, count, a, b, damping)
            velocity[:, :3] = min(len(self.turns), 6 - len(self.turns))

    motion = Swinging([0.9] * 9, (1.1,))
    settle(motion, np.zeros((1, 4)), np.zeros((1, 4)), np.ones(1), 0.2)
    left = np.log(1.1 / np.array([rest for *_, rest in motion.turns[:5]]))
    assert left[1:] / left[:-1] == pytest.approx([0.85, 0.85, 0.85, 0.8])


def test_what_is_smooth_is_calmed_alone_at_first():
    """Before the march begins there are no buckles that could merge."""
    assert settled([9.0, 0.9], SETTINGS.start / 2).looks() == "cc"


@pytest.mark.usefixtures("at_first")
def test_what_balances_is_calmed_under_new_rest_volumes():
    """And swings again if three turns do not bring it to rest."""
    still = len(settled([0.9]).turns) - 1  # volumes begin to lag once it has swung
    motion = settled([0.9, 1.5, 0.9], volumes=(*[1.0] * still, 1.004))
    assert motion.looks() == "Sccc"
    assert [rest for *_, rest in motion.turns[-3:]] == pytest.approx([1.0, 1.002, 1.002], abs=1e-5)
    assert settled([0.9, *[3.5] * 6, 0.9], volumes=(*[1.0] * still, 1.003)).looks() == "S" + 7 * "c" + "Sc"


@pytest.mark.usefixtures("at_first")
def test_rest_volumes_follow_half_of_the_way_at_a_time():
    still = len(settled([0.9]).turns) - 1
    motion = settled([0.9] * 4, volumes=(*[1.0] * still, 1.01))
    assert motion.looks() == "Scccc"
    assert [rest for *_, rest in motion.turns[-4:]] == pytest.approx([1.01 ** (1 - 0.5**k) for k in range(4)])


@pytest.mark.usefixtures("at_first")
def test_volumes_that_follow_by_less_than_forces_are_out_of_balance_are_right():
    still = [1.0] * (len(settled([0.9]).turns) - 1)
    assert settled([0.9], volumes=(*still, 1 + 0.9 * SETTINGS.residual)).looks() == "Sc"
    assert settled([0.9, 0.9], volumes=(*still, 1 + 1.1 * SETTINGS.residual)).looks() == "Scc"


@pytest.mark.usefixtures("at_first")
@pytest.mark.parametrize(("residual", "rest"), [(2.5, 0.98**0.5), (3.5, 1.0)])
def test_rest_volumes_are_taken_anew_near_balance_alone(residual, rest):
    still = [1.0] * (len(settled([0.9]).turns) - 1)
    motion = Told([residual, residual, *[0.9] * 9], (*still, 0.98))
    settle(motion, np.zeros((1, 4)), np.zeros((1, 4)), np.ones(1), 0.2)
    first = motion.looks()[:4]
    assert first == ("SccE" if residual < 3 else "SccS")
    assert motion.turns[len(still) + 2][2] == pytest.approx(rest)


@pytest.mark.usefixtures("at_first")
def test_what_each_swing_throws_out_of_balance_is_eased_in_the_end():
    """Volumes follow then three times a turn: half of the way each time."""
    motion = Told([1.2, 1.2, 9.0, 9.0] * 999, (1.5,))
    settle(motion, np.zeros((1, 4)), np.zeros((1, 4)), np.ones(1), 0.2)
    steps = np.cumsum([count for _, count, _ in motion.turns])
    late = steps > 0.75 * SETTINGS.settle_steps + SETTINGS.swing_steps + SETTINGS.calm_steps
    last = [damping for (damping, *_), is_late in zip(motion.turns, late, strict=True) if is_late]
    still = {settling._STILL_DAMPING}  # at last
    assert set(last) - still == {SETTINGS.calm_damping, EASING}
    assert {damping for damping, *_ in motion.turns} - still == {SETTINGS.calm_damping, SETTINGS.swing_damping, EASING}


@pytest.mark.parametrize(("drift", "stands"), [(0.5, True), (2.0, False)])
def test_what_rings_in_contact_stands_still_at_last(monkeypatch, drift, stands):
    """If it is at rest: under that damping anything would seem to be."""
    monkeypatch.setattr(settling, "_way", lambda motion, state, surface: drift * SETTINGS.drift / 4)

    class Ringing(Told):
        def residual(self, state, rest, shrinkage, damping):
            return (9.0 if damping < settling._STILL_DAMPING else 0.5) * SETTINGS.residual

    motion = Ringing([])
    found = settle(motion, np.zeros((1, 4)), np.zeros((1, 4)), np.ones(1), 0.2)
    assert found.drift == pytest.approx(drift * SETTINGS.drift)
    assert (found.residual == pytest.approx(0.5 * SETTINGS.residual)) == stands
    still = [count for damping, count, _ in motion.turns if damping == settling._STILL_DAMPING]
    assert still == ([50] if stands else [])


@pytest.mark.usefixtures("at_first")
def test_what_runs_out_of_steps_says_how_far_its_volumes_lag():
    """Forces balance after each turn, but volumes never do."""

    class Restless(Told):
        def rests(self, state, rest, shrinkage):
            return 0.99 * rest

        def residual(self, state, rest, shrinkage, damping):
            return 0.5 * SETTINGS.residual

    motion = Restless([])
    found = settle(motion, np.zeros((1, 4)), np.zeros((1, 4)), np.ones(1), 0.2)
    assert motion.steps >= SETTINGS.settle_steps
    assert found.residual == pytest.approx(0.01)
    assert found.rest == motion.turns[-1][2]


@pytest.mark.usefixtures("at_first")
def test_released_energy_is_that_between_two_states_under_the_same_rest_volumes():
    class Weighed(Told):
        copies = 8

        def marched_energy(self, state, rest, shrinkage):
            return float(rest[0]) + (1.0 if state[0, 0] else 3.0)

        def run(self, state, *args):
            super().run(state, *args)
            state[:] = 1

    motion = Weighed([0.9] * 3, (1.003,))
    motion.copies = 8
    found = settle(motion, np.zeros((1, 4)), np.zeros((1, 4)), np.ones(1), 0.2, with_release=True)
    assert found.rest > 1
    assert found.released == pytest.approx(8 * (3.0 - 1.0))


def smooth_at_first(motion, way):
    """Settle what is seen to be smooth, and goes `way` [te] when it is left to swing."""
    motion.surface = lambda state: state[:, :3]
    swing, count = motion.run, 4 * SETTINGS.swing_steps

    def run(state, velocity, rest, steps, *args):
        swing(state, velocity, rest, steps, *args)
        if steps == count:
            state[:, 0] += way * PARAMS.exocarp_thickness

    motion.run = run
    return settle(motion, np.zeros((1, 4)), np.zeros((1, 4)), np.ones(1), 0.2, smooth=lambda state: True)


@pytest.mark.usefixtures("at_first")
def test_rest_volumes_are_those_of_where_a_smooth_state_went():
    """They go with the buckles that came up, not with the smooth state that was left."""
    still = [1.0] * len(settled([0.9]).turns)
    went = smooth_at_first(Told([0.9] * 9, (*still, 1.01)), 1.0)
    assert went.rest == pytest.approx(1.01, rel=SETTINGS.residual)
    stayed = smooth_at_first(Told([0.9], (*still, 1.01)), 0.01)
    assert stayed.rest == 1.0
    assert stayed.surface[0, 0] == 0


@pytest.mark.usefixtures("at_first")
def test_a_smooth_state_that_leaves_the_finite_when_left_to_swing_swings_from_where_it_was():
    class Wild(Told):
        def run(self, state, velocity, rest, count, *args):
            super().run(state, velocity, rest, count, *args)
            if count == 4 * SETTINGS.swing_steps:
                state[:], velocity[:], self.masses = np.nan, np.nan, "heavy"
                raise Unstable("left the finite", advice="")

    motion = Wild([0.9] * 2)
    motion.masses = "light"
    found = smooth_at_first(motion, 0.0)
    assert np.isfinite(found.surface).all()
    assert motion.masses == "light"
    assert motion.looks() == "ScSc"  # swung, calmed, left to swing and swung, calmed


@pytest.mark.usefixtures("at_first")
def test_a_swing_that_leaves_the_finite_is_put_back():
    """State, masses and rest are those of before; it is calmed from there."""
    seen = []

    class Wild(Told):
        def run(self, state, velocity, rest, count, a, b, damping):
            super().run(state, velocity, rest, count, a, b, damping)
            if damping == SETTINGS.swing_damping:
                state[:], velocity[:], self.masses = np.nan, np.nan, "heavy"
                raise Unstable("left the finite", advice="")
            seen.append((state.max(), velocity.max(), self.masses))

    motion = Wild([0.9])
    motion.masses = "light"
    settle(motion, np.zeros((1, 4)), np.ones((1, 4)), np.ones(1), 0.2)
    assert seen == [(0.0, 0.0, "light")]


def test_the_march_goes_on_under_the_rest_volumes_of_the_rung(monkeypatch):
    """Buckles take pressure off there: the volumes that it came with are those of before."""
    come = Path._settle

    def settled(path, state, velocity, rest, shrinkage):
        return dataclasses.replace(come(path, state, velocity, rest, shrinkage), rest=0.999 * rest)

    monkeypatch.setattr(Path, "_settle", settled)
    params = SOLVER.parse({"te": 0.2, "gamma": 3.0, "mirrors": "xyz"})
    path = Path(params, dataclasses.replace(choose(params, "preview"), rungs=(0.01,), start=0.005), Context())
    settled = path.stage(0.01, 0.02)
    np.testing.assert_array_equal(path._rest, settled.rest)


@pytest.mark.usefixtures("at_first")
def test_whole_searches_for_contact_lie_between_two_looks():
    swing = [count for damping, count, _ in settled([0.9]).turns if damping != SETTINGS.calm_damping]
    assert {count % SEARCH_EVERY for count in swing} == {0}
    assert sum(swing) == pytest.approx(SETTINGS.swing_steps, rel=0.1)


class Falling(Told):
    """Its energy falls as told by each turn of what went on."""

    def __init__(self, residuals, energies):
        super().__init__(residuals)
        self.energies = list(energies)

    def run(self, state, *args):
        super().run(state, *args)
        state[:] += 1

    def marched_energy(self, state, rest, shrinkage):
        return self.energies.pop(0)


def test_what_balances_goes_on_until_it_gives_up_next_to_no_energy():
    """Before and after each turn: 2 % of the energy, a fifth of one, and next to none."""
    motion = Falling([0.9] * 4, [1.02, 1.0, 1.0, 0.998, 0.998, 0.9975])
    found = settle(motion, np.zeros((1, 4)), np.zeros((1, 4)), np.ones(1), 0.2)
    assert motion.looks() == "ScScScSc"
    assert not motion.energies
    assert found.residual == pytest.approx(0.9 * SETTINGS.residual)


def test_what_is_smooth_does_not_go_on():
    motion = Falling([0.9], [])
    settle(motion, np.zeros((1, 4)), np.zeros((1, 4)), np.ones(1), SETTINGS.start / 2)
    assert motion.looks() == "c"
    quiet = Falling([0.9], [])
    settle(quiet, np.zeros((1, 4)), np.zeros((1, 4)), np.ones(1), 0.2, smooth=lambda state: True)
    assert quiet.looks() == "ScS"  # left to swing on a copy, which stays


@pytest.mark.parametrize("ends", ["off balance", "out of the finite", "inside out"])
def test_a_turn_that_does_not_balance_is_taken_back(ends):
    class Lost(Falling):
        def residual(self, state, rest, shrinkage, damping):
            if len(self.turns) < self.first or ends == "inside out":
                return 0.9 * SETTINGS.residual
            if ends == "out of the finite":
                raise Unstable("left the finite", advice="")
            return 9 * SETTINGS.residual

        def least_ratio(self, state, shrinkage):
            return 1.0 if len(self.turns) < self.first or ends != "inside out" else -0.1

    motion = Lost([], [])
    motion.masses, motion.first = "light", 99
    begin = Lost([], [1.0, 1.0])
    begin.first, begin.masses = 99, None
    settle(begin, np.zeros((1, 4)), np.zeros((1, 4)), np.ones(1), 0.2)
    first = begin.looks().index("S", 1)
    motion.first = next(k for k, (damping, *_) in enumerate(begin.turns) if k and damping == SETTINGS.calm_damping) + 1
    motion.first += 1
    state = np.zeros((1, 4))
    found = settle(motion, state, np.zeros((1, 4)), np.ones(1), 0.2)
    assert first == 2
    assert found.residual == pytest.approx(0.9 * SETTINGS.residual)
    assert motion.masses == "light"
    # where it was when it first balanced, by its steps
    assert state[0, 0] == motion.first - 1


@pytest.mark.usefixtures("at_first")
@pytest.mark.parametrize(
    ("drifts", "looks"),
    [
        ([9.0, 8.9, 0.5], "SccEc"),  # 1 % less each time leaves too much
        ([9.0, 3.0, 0.9], "Sccc"),  # a third each time is little enough after eight
        ([9.0, 2.0, 1.9, 0.5], "ScccEc"),  # it had slowed down, and does no more
        ([9.0, 9.5, 0.5], "SccEc"),
        ([0.9], "Sc"),
    ],
)
def test_what_drifts_on_is_calmed_no_longer(monkeypatch, drifts, looks):
    """Not to the end of its calm steps: a swing, or easing where forces nearly balance, leads farther."""
    monkeypatch.setattr(settling, "_CALM_LOOK", SETTINGS.calm_steps // 8)
    left = [drift * SETTINGS.drift for drift in drifts]
    monkeypatch.setattr(settling, "_way", lambda *_: left.pop(0) * (SETTINGS.calm_steps // 8) / 200)
    assert settled([0.9] * len(drifts)).looks() == looks
    assert not left


@pytest.mark.parametrize("quality", ["preview", "default", "fine"])
def test_rungs_stand_wherever_a_run_may_end(quality):
    rungs = choose(PARAMS, quality).rungs
    assert rungs[-1] == pytest.approx(SOLVER.stages.highest)
    assert np.all(np.diff(rungs) > 0)
