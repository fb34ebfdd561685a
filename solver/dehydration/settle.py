"""Settling of a stage: its shrinkage is held until forces balance and the surface has come to rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Singles
from ..contract import Unstable
from .motion import Motion

__all__ = ["State", "settle"]

Fixed = NDArray[np.int32]

#: Looks at the kinetic energy per swing.
_LOOKS = 15

#: Steps over which the surface's drift is measured.
_REST_STEPS = 200


@dataclass(frozen=True, eq=False)
class State:
    """A settled stage: nodes of the outer surface (nc, 3), how settled it is, and the steps spent so far.

    residual: out-of-balance force over internal force. drift: rms motion of the surface in the last 200 steps, in
    exocarp thicknesses. least_ratio: least J/Jd of all integration points. energy: strain energy in mu r1^3, and
    released: by how much settling lowered it, where that was asked for.
    """

    surface: Floats
    shrinkage: float
    residual: float
    drift: float
    steps: int
    least_ratio: float
    energy: float
    released: float | None = None


def settle(
    motion: Motion, state: Fixed, velocity: Singles, rest: Floats, shrinkage: float, with_release: bool = False
) -> State:
    """Hold the shrinkage until forces balance *and* the surface has come to rest.

    Just past the onset the forces nearly balance while buckles still grow, so the residual alone would stop there.
    It swings to where the energy leads: after the onset buckles go on merging for thousands of steps, along ways
    so soft that damping would only delay them. Kinetic damping knows no rate (Day 1965, Cundall 1976): all stands
    still whenever the kinetic energy begins to fall, for there the potential was about least. Then it is calmed,
    and swings again if it was not there yet. State and velocity change in place.

    Raises:
        Cancelled: the observer asked to stop.
        Unstable: the state left the finite, or elements turned inside out.

    """
    settings = motion.settings
    surface = motion.surface(state)
    if shrinkage == 0:
        whole = motion.sector.whole(surface)
        return State(whole, shrinkage, 0.0, 0.0, motion.steps, 1.0, 0.0, 0.0)  # free of stress: nothing to settle
    copies = motion.sector.copies
    before = float(motion.report(state, rest, shrinkage).energy.sum()) if with_release else None
    spent, residual, drift = 0, np.inf, np.inf
    while (residual > settings.residual or drift > settings.drift) and spent < settings.settle_steps:
        if spent or shrinkage > settings.start:
            _swing(motion, state, velocity, rest, shrinkage)
            spent += settings.swing_steps
        rested = 0
        while (residual > settings.residual or drift > settings.drift) and rested < settings.calm_steps:
            surface = motion.surface(state)
            # rest volumes stay: under some that go on following, forces have no potential and hardly balance
            count = min(_REST_STEPS, max(20, motion.slice))
            motion.run(state, velocity, rest, count, shrinkage, shrinkage, settings.calm_damping)
            rested += count
            residual = motion.residual(state, rest, shrinkage, settings.calm_damping)
            moved = np.square(motion.surface(state) - surface).sum(axis=1).mean()
            drift = float(np.sqrt(moved) / count * _REST_STEPS / motion.params.exocarp_thickness)
        spent += rested
    report = motion.report(state, rest, shrinkage)
    least = float(report.least_ratio.min())
    if least <= 0:
        raise Unstable(
            f"elements turned inside out at shrinkage s = {shrinkage:.3f} (least J {least:.2f}).",
            advice="Ask for stages below that, a finer quality, or a thicker exocarp.",
            residual=residual,
        )
    released = copies * (before - float(report.energy.sum())) if before is not None else None
    energy = copies * motion.strain_energy(state, rest, shrinkage)
    whole = motion.sector.whole(motion.surface(state))
    return State(whole, shrinkage, residual, drift, motion.steps, least, energy, released)


def _swing(motion: Motion, state: Fixed, velocity: Singles, rest: Floats, shrinkage: float) -> None:
    """Let the state fall for `swing_steps`, standing still at each peak of the kinetic energy."""
    settings = motion.settings
    count = settings.swing_steps // _LOOKS
    last = 0.0
    for _ in range(_LOOKS):
        motion.run(state, velocity, rest, count, shrinkage, shrinkage, settings.swing_damping)
        layout = motion.layout
        energy = float((layout.mass * np.square(velocity[:, :3]).sum(axis=1, dtype=np.float64))[layout.free].sum())
        if energy < last:
            velocity[:] = energy = 0.0
        last = energy
