"""Strain and stress of every edge and bond, as a test bench would map them: read at stages, never in a step."""

from __future__ import annotations

import numpy as np

from ..contract import Need
from .fibres.timber import timber
from .fracture import bows
from .model.joining import lying, moduli
from .model.state import State, Wood
from .params import WoodParams

__all__ = ["BOND", "ROD", "Stresses"]

ROD = ("rod_strain", "rod_stress", "rod_crushed")
BOND = ("bond_position", "bond_tension", "bond_shear", "bond_damage")


def _along(state: State) -> tuple[np.ndarray, np.ndarray]:
    """Return strain along every edge and stress [Pa] where its outer fibre is drawn out most, each (e,); 0 if severed.

    What was crushed is strained, and bears what it is strained beyond that.

    Bending is that of the sharper of the hinges at both ends; a broken hinge bends nothing.
    """
    rods, m = state.wood.rods, state.wood.motion
    way = m.x[rods.b] - m.x[rods.a]
    length = np.linalg.norm(way, axis=1)
    bears = (rods.alive == 1) & (rods.k > 0)
    strain = np.where(bears, length / rods.rest - 1, 0.0)
    t = way / length[:, None]
    bow = np.abs(bows(rods, t, m.theta, m.reference, state.scratch.bent, state.wood.turning)[:, 0])
    sharp = np.zeros(len(strain))
    np.maximum.at(sharp, rods.before, bow)
    np.maximum.at(sharp, rods.after, bow)
    stiff = rods.k / (np.pi * rods.radius**2)
    return strain, np.where(bears, stiff * (strain + 1 - rods.free + rods.radius * sharp), 0.0)


class Stresses:
    """What reads them: it knows what bonds were laid as, before they broke."""

    def __init__(self, params: WoodParams, laid: Wood, need: Need) -> None:
        self._wanted, self._dtype = {*ROD, *BOND} & {*need.fields}, need.dtype
        self._real = laid.rods.k > 0
        if not self._wanted:
            return
        self._across, self._shear = moduli(params, timber(params), laid.straight, laid.rods, laid.bonds)

    def _bonds(self, state: State) -> dict[str, np.ndarray]:
        """Return middles (b, 3) [m], stress along them and shear along the grain (b,) [Pa], and damage (b,) of bonds.

        What is broken and not out of the way bears pressure alone; what is gone bears nothing.
        """
        bonds = state.wood.bonds
        middle, length, slope = lying(state.wood.motion.x, state.wood.rods, bonds.i, bonds.at, bonds.j, bonds.share)
        strain = length / bonds.rest - 1
        there = np.where(bonds.on > 0, 1.0, 0.0)
        left = there * (1 - bonds.damage)
        return {
            "bond_position": middle,
            "bond_tension": self._across * strain * np.where(strain > 0, left, there),
            "bond_shear": self._shear * np.abs(slope - bonds.cosine) * left,
            "bond_damage": np.where(bonds.on > 0, bonds.damage, 1.0),
        }

    def read(self, state: State) -> dict[str, np.ndarray]:
        """Return what is wanted of `ROD` and `BOND`."""
        if not self._wanted:
            return {}
        strain, stress = _along(state)
        crushed = 1 - state.wood.rods.free[self._real]
        found = {"rod_strain": strain[self._real], "rod_stress": stress[self._real], "rod_crushed": crushed}
        found |= self._bonds(state)
        return {name: found[name].astype(self._dtype) for name in self._wanted}
