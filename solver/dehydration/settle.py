"""Settling of a stage: its shrinkage is held until forces balance and the surface has come to rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Singles
from ..contract import Unstable
from .kernel import kinetic_energy
from .kernel.march import SEARCH_EVERY
from .motion import Masses, Motion

__all__ = ["State", "lagging", "settle"]

Fixed = NDArray[np.int32]

#: Looks at the kinetic energy per swing, about; whole searches for contact lie between two.
_LOOKS = 10

#: Steps in which a surface at rest may drift so far.
_REST_STEPS = 200

#: Share of the way that rest volumes go to those of the pressures: all of the way takes as many steps.
_SHARE = 0.5

#: Likewise in a swing, at each look and where all stands still: a swing goes far, and its pressures with it.
_SHARE_SWINGING, _SHARE_STILL = 0.15, 0.2

#: Growth of what rest volumes lag by over a swing that ends faster and farther out of balance than the one before, and
#: such swings in a row, after which those are given back, volumes stay in swings, and swings are so many times as long.
#: What swings slower than they follow they drive on, as the volume of a long fruit along its axis: each swing goes
#: farther then (the wolfberry of gamma = 7: by 3 in kinetic energy and more), until the steps for swinging are spent.
#: It is slower than a swing is long, too: from rest it would go a fifth of its way in each. Buckles that grow for three
#: swings leave volumes a third farther behind at most, or end slower, or nearer to balance.
_DRIVEN_BY, _DRIVEN, _SLOWER = 1.5, 2, 4
#: Swings in a row, the last of which leaves volumes so many times as far behind as the first, and ends faster and
#: farther out of balance, after which they are driven, too: slowly, by a mode that does not keep time with the swings
#: (the wolfberry of te = 0.0056). Stiff skins on fine meshes may be driven more slowly yet (gamma = 50, n = 48 at
#: s = 0.1: by 2.8 in eight swings at most), for 38 swings, and come to rest when they are eased in the end.
_DRIVEN_ON, _SLOWLY = 3.0, 8
#: How fast, far out of balance and far behind a turn ended that did not swing: none is worse.
_NO_SWING = (np.inf, np.inf, np.inf)

#: Share of the steps that a stage may settle for after which it swings no more: what each swing throws out of balance,
#: as rest volumes hardly hold it, comes to rest when eased while they follow.
_SWINGING = 0.75

#: Parts of a turn of easing, after each of which rest volumes follow, and what of the residual is left where it is
#: worth another.
_EASING_PARTS, _EASED = 2, 0.7

#: Damping under which what is at rest stands still that rings in contact. Walls of a deep fold that are pressed on each
#: other from many sides may ring for ever under `calm_damping`, by a thousandth of the skin (te = 0.04, gamma = 7 at
#: s = 0.3). Whether a surface rests is not judged under it: it would creep.
_STILL_DAMPING = 0.5

#: Turns of calming alone in which a state comes to rest under new rest volumes, before it swings again.
_CALM_TURNS = 3

#: Calm steps between two looks at residual and drift, after a swing and of a smooth fruit, which creeps to its radius.
_CALM_LOOK, _SMOOTH_LOOK = 50, 200

#: Part of its strain energy that a turn gives up where it is the last. Ways can be so soft that forces balance in the
#: middle of one: eighths at te = 0.04 that were left where they balanced would have gone on, most of them by a third of
#: their roughness.
_GIVEN_UP = 1e-3

#: Swings that a state is left to itself to show whether it is stable, and the rms way of the surface [te] after which
#: it was not: of what is seen to be smooth, and of what may have buckles, whose soft ways are longer. 1 % past the
#: onset the bumps of a fresh fruit are buckles after 2,000 steps at n = 18, which is 3.6 swings.
_TRIAL_SWINGS, _LEFT, _LEFT_BUCKLED = 4, 0.05, 0.25


@dataclass(frozen=True, eq=False)
class State:
    """A settled stage: nodes of the outer surface (nc, 3), how settled it is, and the steps spent so far.

    residual: out-of-balance force over internal force or, if larger, by how much rest volumes lag (rms). drift: rms
    motion of the surface in 200 steps, by the last that were looked at, in exocarp thicknesses. least_ratio: least J/Jd
    of all integration points. energy: strain energy in mu r1^3, and released: by how much settling lowered it, where
    they were asked for. rest: rest volumes (ne,) of the elements, which go with their pressures.
    """

    surface: Floats
    shrinkage: float
    residual: float
    drift: float
    steps: int
    least_ratio: float
    energy: float | None
    rest: Floats
    released: float | None = None


def settle(
    motion: Motion,
    state: Fixed,
    velocity: Singles,
    rest: Floats,
    shrinkage: float,
    with_release: bool = False,
    with_energy: bool = True,
    smooth: Callable[[Fixed], bool] | None = None,
) -> State:
    """Hold the shrinkage until forces balance, the surface has come to rest *and* it would stay there.

    Just past the onset the forces nearly balance while buckles still grow, so the residual alone would stop there.
    It swings to where the energy leads: after the onset buckles go on merging for thousands of steps, along ways
    so soft that damping would only delay them. Kinetic damping knows no rate (Day 1965, Cundall 1976): all stands
    still whenever the kinetic energy begins to fall, for there the potential was about least. Then it is calmed,
    and swings again if it was not there yet, until most of its steps are spent. What is near balance by then does not
    swing but is eased, under a damping between the two, for as long as that helps: it is a soft way from its end, and
    a swing would go past it. State and velocity change in place.

    `rest` volumes are those of the pressures that it came with, and buckles take much of the pressure off a fruit with
    a stiff skin. Where a state balances they go half of the way to those of its pressures, and it is calmed alone for
    a few turns; while it is eased, and near balance after a swing and at last, they do so, too; in a swing they follow
    a little. So on, until they are off (rms) by no more than forces may be.

    What balances may still be in the middle of a soft way. So it goes on, turn by turn, each a swing and what it takes
    to balance after it, until one gives up next to no energy. A turn that does not balance in the steps that are left,
    or turns elements inside out, is taken back. What is at rest, but rings in contact, stands still under a damping of
    its own at last, and balances under that.

    smooth: whether a state at rest may have no buckles yet. Such a one is left to swing, and where it goes elsewhere
    settles there: a smooth fruit past its onset balances and is not stable, but buckles grow from its bumps, at first
    by less than a drift that counts.

    Raises:
        Cancelled: the observer asked to stop.
        Unstable: the state left the finite, or elements turned inside out.

    """
    surface = motion.surface(state)
    if shrinkage == 0:
        whole = motion.sector.whole(surface)
        # free of stress: nothing to settle
        return State(whole, shrinkage, 0.0, 0.0, motion.steps, 1.0, 0.0, rest, 0.0)
    arrived = state.copy() if with_release else None
    rest, residual, drift = _settled(motion, state, velocity, rest, shrinkage, smooth)
    energy, least = motion.strained(state, rest, shrinkage, with_energy)
    if least <= 0:
        raise Unstable(
            f"elements turned inside out at shrinkage s = {shrinkage:.3f} (least J {least:.2f}).",
            advice="Ask for stages below that, or for a finer quality.",
            residual=residual,
        )
    released = None
    if arrived is not None:
        # under the same rest volumes: energies under others do not compare
        before, after = (motion.marched_energy(each, rest, shrinkage) for each in (arrived, state))
        released = motion.sector.copies * (before - after)
    whole = motion.sector.whole(motion.surface(state))
    return State(whole, shrinkage, residual, drift, motion.steps, least, energy, rest, released)


def _settled(
    motion: Motion,
    state: Fixed,
    velocity: Singles,
    rest: Floats,
    shrinkage: float,
    smooth: Callable[[Fixed], bool] | None,
) -> tuple[Floats, float, float]:
    """Settle, see `settle`; return rest volumes, residual and drift."""
    settings = motion.settings
    rest, spent, residual, drift = _come_to_rest(motion, state, velocity, rest, shrinkage)
    stays = smooth is not None and spent < settings.settle_steps and smooth(state)
    if stays and _leaves(motion, state, velocity, rest, shrinkage):
        rest, spent, residual, drift = _come_to_rest(motion, state, velocity, rest, shrinkage)
        stays = False
    if shrinkage > settings.start and residual > settings.residual and drift <= settings.drift:
        residual = _stilled(motion, state, velocity, rest, shrinkage)
        return rest, residual, drift
    if shrinkage <= settings.start or stays or residual > settings.residual or drift > settings.drift:
        return rest, residual, drift
    return _to_the_end(motion, state, velocity, (rest, residual, drift), shrinkage, spent)


def _to_the_end(
    motion: Motion,
    state: Fixed,
    velocity: Singles,
    found: tuple[Floats, float, float],
    shrinkage: float,
    spent: int,
) -> tuple[Floats, float, float]:
    """Let a state that balances go on until it gives up next to no energy; return rest volumes, residual and drift.

    found: those that it has. spent: steps that it has taken to balance.
    """
    settings, begun, now = motion.settings, np.inf, 0.0
    while begun - now > _GIVEN_UP * now and spent + settings.swing_steps < settings.settle_steps:
        before, masses = state.copy(), motion.masses
        try:
            rest = _swung(motion, state, velocity, found[0], shrinkage)
            spent += settings.swing_steps
            rest, spent, residual, drift = _come_to_rest(motion, state, velocity, rest, shrinkage, spent)
        except Unstable:
            residual, drift = np.inf, np.inf
        balances = residual <= settings.residual and drift <= settings.drift
        if not balances or motion.least_ratio(state, shrinkage) <= 0:
            state[:], motion.masses = before, masses
            velocity[:] = 0
            break
        found = rest, residual, drift
        # under the same rest volumes: energies under others do not compare
        begun, now = (motion.marched_energy(each, rest, shrinkage) for each in (before, state))
    return found


def _come_to_rest(
    motion: Motion, state: Fixed, velocity: Singles, rest: Floats, shrinkage: float, spent: int = 0
) -> tuple[Floats, int, float, float]:
    """Swing and calm by turns; return the rest volumes, the steps spent, the residual and the drift.

    spent: steps before, of a state that has swung already.
    """
    settings = motion.settings
    residual, drift, behind = np.inf, np.inf, np.inf
    swings = shrinkage > settings.start
    calm, eases, driven = 0 if swings and not spent else 1, False, _Driven()
    while spent < settings.settle_steps:
        late, before = spent >= _SWINGING * settings.settle_steps, residual
        swung = calm == 0 and not (late or eases)
        if swung:
            driven.swings(motion, state, rest, (residual, drift, behind))
        if late or eases:
            rest = _eased(motion, state, velocity, rest, shrinkage)
        elif swung:
            rest = _swung(motion, state, velocity, rest, shrinkage, driven)
        if late or calm == 0:
            spent += settings.swing_steps * (_SLOWER if swung and driven.held else 1)
        rested, residual, drift = _calmed(motion, state, velocity, rest, shrinkage)
        spent += rested
        lag = motion.rests(state, rest, shrinkage) / rest
        behind = lagging(lag)
        if driven.ended((driven.speed, residual, behind) if swung else _NO_SWING):
            rest, (residual, drift, behind) = driven.given_back(motion, state, velocity)
            eases = False
            continue
        balanced = residual <= settings.residual and drift <= settings.drift
        if balanced and behind <= settings.residual:
            break
        near = (calm == 0 or late) and residual <= settings.near
        if spent < settings.settle_steps and (balanced or near):
            rest = rest * lag**_SHARE
        # what is eased gets nearer each time, or it is not the end of a way but the middle of one
        eases = near and not balanced and (not eases or residual < _EASED * before)
        # under new rest volumes what balances stays where it is, or nearly: to swing would throw it far
        calm = _CALM_TURNS if balanced else max(calm - 1, 0)
    return rest, spent, max(residual, behind), drift


class _Driven:
    """Tells by how swings end whether rest volumes that follow drive them.

    speed: kinetic energy at the last look of a swing, whether or not all stood still then. held: they are driven, and
    volumes follow no more.
    """

    def __init__(self) -> None:
        self.speed, self.held = 0.0, False
        self._count, self._row = 0, [_NO_SWING]
        self._kept: tuple[Fixed, Masses, Floats, tuple[float, float, float]] | None = None

    def swings(self, motion: Motion, state: Fixed, rest: Floats, found: tuple[float, float, float]) -> None:
        """Keep what a swing begins from that may be the first of those that are driven; found: how settled that is."""
        if not self._count:
            self._kept = None if self.held else (state.copy(), motion.masses, rest, found)

    def ended(self, ended: tuple[float, float, float]) -> bool:
        """Return whether a swing was the last of those that are driven; ended: how fast, out of balance and behind."""
        self._row = [*self._row[1 - _SLOWLY :], ended] if ended is not _NO_SWING else [_NO_SWING]
        self._count = self._count + 1 if self._worse(2, _DRIVEN_BY) else 0
        if self.held or not (self._count == _DRIVEN or self._worse(_SLOWLY, _DRIVEN_ON)):
            return False
        self.held = True
        return True

    def _worse(self, swings: int, by: float) -> bool:
        """Return whether the last of so many swings in a row ended worse than the first, with volumes `by` behind."""
        if len(self._row) < swings:
            return False
        now, then = self._row[-1], self._row[-swings]
        return now[0] > then[0] and now[1] > then[1] and now[2] > by * then[2]

    def given_back(self, motion: Motion, state: Fixed, velocity: Singles) -> tuple[Floats, tuple[float, float, float]]:
        """Put back, at rest, what the first driven swing began from; return rest volumes and how settled it is."""
        assert self._kept is not None
        kept, motion.masses, rest, found = self._kept
        state[:], velocity[:] = kept, 0
        self._count, self._kept = 0, None
        return rest, found


def _calmed(
    motion: Motion, state: Fixed, velocity: Singles, rest: Floats, shrinkage: float
) -> tuple[int, float, float]:
    """Calm the state until it balances; return the steps that took, the residual and the drift.

    What rings is gone after two or three looks. What drifts on then hardly slows down, and a swing leads it farther: a
    state that would not be at rest in time is given back. Rest volumes stay: under some that go on following, forces
    have no potential and hardly balance.
    """
    settings = motion.settings
    swings = shrinkage > settings.start
    rested, residual, drift, keeps = 0, np.inf, np.inf, False
    while (residual > settings.residual or drift > settings.drift) and rested < settings.calm_steps and not keeps:
        surface, before = motion.surface(state), drift
        count = min(_CALM_LOOK if swings else _SMOOTH_LOOK, max(20, motion.slice))
        motion.run(state, velocity, rest, count, shrinkage, shrinkage, settings.calm_damping)
        rested += count
        residual = motion.residual(state, rest, shrinkage, settings.calm_damping)
        drift = _way(motion, state, surface) / count * _REST_STEPS
        last = _foreseen(drift, before, (settings.calm_steps - rested) / count)
        keeps = swings and min(drift, last) > settings.drift
    return rested, residual, drift


def _stilled(motion: Motion, state: Fixed, velocity: Singles, rest: Floats, shrinkage: float) -> float:
    """Let what is at rest, but for what rings in contact, stand still; return its residual, volumes' lag included."""
    settings = motion.settings
    residual, rested = np.inf, 0
    while residual > settings.residual and rested < settings.calm_steps:
        motion.run(state, velocity, rest, _CALM_LOOK, shrinkage, shrinkage, _STILL_DAMPING)
        residual = motion.residual(state, rest, shrinkage, _STILL_DAMPING)
        rested += _CALM_LOOK
    return max(residual, lagging(motion.rests(state, rest, shrinkage) / rest))


def lagging(lag: Floats) -> float:
    """Return by how much rest volumes lag, from what they are to be over what they are."""
    return float(np.sqrt(np.mean(np.square(lag - 1))))


def _foreseen(drift: float, before: float, looks: float) -> float:
    """Return the drift after so many more looks, if each leaves as much of it as the last did."""
    return drift * (drift / before) ** looks if before else drift


def _way(motion: Motion, state: Fixed, surface: Floats) -> float:
    """Return the rms way of the state's surface from `surface` (nc, 3) [te]."""
    moved = np.square(motion.surface(state) - surface).sum(axis=1).mean()
    return float(np.sqrt(moved) / motion.params.exocarp_thickness)


def _leaves(motion: Motion, state: Fixed, velocity: Singles, rest: Floats, shrinkage: float) -> bool:
    """Return whether a state at rest goes elsewhere when left to swing; it is there then, else where it was.

    So it is if it leaves the finite, as no peak of the kinetic energy stops it here: it swings from where it was then.
    """
    settings = motion.settings
    surface, masses, steps = motion.surface(state), motion.masses, motion.steps
    tried, speed = state.copy(), np.zeros_like(velocity)
    count = _TRIAL_SWINGS * settings.swing_steps
    try:
        motion.run(tried, speed, rest, count, shrinkage, shrinkage, settings.swing_damping)
    except Unstable:
        motion.masses, velocity[:] = masses, 0
        return True
    if _way(motion, tried, surface) < (_LEFT if motion.params.stays_spherical else _LEFT_BUCKLED):
        motion.masses, motion.steps = masses, steps  # as if it had not been looked at
        return False
    state[:], velocity[:] = tried, 0
    return True


def _eased(motion: Motion, state: Fixed, velocity: Singles, rest: Floats, shrinkage: float) -> Floats:
    """Let the state slide for as long as a swing, and return the rest volumes, which follow."""
    settings = motion.settings
    for _ in range(_EASING_PARTS):
        count = settings.swing_steps // _EASING_PARTS
        motion.run(state, velocity, rest, count, shrinkage, shrinkage, settings.easing_damping)
        rest = _followed(motion, state, rest, shrinkage, _SHARE)
    return rest


def _followed(motion: Motion, state: Fixed, rest: Floats, shrinkage: float, share: float) -> Floats:
    """Return rest volumes a share of the way to those of the state's pressures."""
    lag = motion.rests(state, rest, shrinkage) / rest
    followed: Floats = rest * lag**share
    return followed


def _swung(
    motion: Motion,
    state: Fixed,
    velocity: Singles,
    rest: Floats,
    shrinkage: float,
    driven: _Driven | None = None,
) -> Floats:
    """Let the state fall, or stay where it was if it falls so fast that it leaves the finite; return rest volumes."""
    begin, masses = state.copy(), motion.masses
    try:
        return _swing(motion, state, velocity, rest, shrinkage, driven or _Driven())
    except Unstable:
        state[:], motion.masses = begin, masses
        velocity[:] = 0
        return rest


def _swing(motion: Motion, state: Fixed, velocity: Singles, rest: Floats, shrinkage: float, driven: _Driven) -> Floats:
    """Let the state fall for `swing_steps`, standing still at each peak of the kinetic energy; return rest volumes.

    driven: takes the speed; where it is held they stay, and it swings longer.
    """
    settings = motion.settings
    count = SEARCH_EVERY * max(1, round(settings.swing_steps / _LOOKS / SEARCH_EVERY))
    last = 0.0
    for _ in range(round(settings.swing_steps / count) * (_SLOWER if driven.held else 1)):
        motion.run(state, velocity, rest, count, shrinkage, shrinkage, settings.swing_damping)
        energy = driven.speed = kinetic_energy(motion.layout, velocity)
        falls = energy < last
        if falls:
            velocity[:] = energy = 0.0
        last = energy
        if not driven.held:
            rest = _followed(motion, state, rest, shrinkage, _SHARE_STILL if falls else _SHARE_SWINGING)
    return rest
