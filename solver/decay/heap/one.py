"""One fruit of a heap at a stage, in numbers and maps."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from ..fields.stepping import Reached
from ..fields.system import System

__all__ = ["One"]

#: Map value from which a place counts as rotten or mouldy.
_SEEN = 0.1


class One:
    """One fruit's stage, in numbers."""

    def __init__(self, system: System, reached: Reached) -> None:
        self._system, self._state, self._day = system, reached.state, reached.day
        self._rot = system.rot.share(reached.state.rot)
        layers = zip((system.rot, system.mould), reached.state[:2], strict=True)
        self.budget = [layer.budget_error(s) for layer, s in layers if layer is not None and s is not None]
        self.water = reached.state.water

    def maps(self) -> dict[str, Floats]:
        """Return its fields by name (v)."""
        age = self._system.age(self._state, self._day)
        found = {"rot": self._rot, "substrate": self._state.rot.n, "rot_age": age}
        if self._system.mould is not None and self._state.mould is not None:
            mould, state = self._system.mould, self._state.mould
            found |= {
                "mould": mould.share(state),
                "mould_active": np.minimum(state.u / mould.rates.theta, 1.0),
                "nutrient": state.n,
            }
        return found

    def means(self) -> dict[str, float]:
        """Return shares and means over its surface by name."""
        mean, maps = self._system.surface.mean, self.maps()
        found = {"rotten_share": mean(self._rot >= _SEEN), "mean_rot": mean(self._rot)}
        if "mould" in maps:
            found |= {
                "mouldy_share": mean(maps["mould"] >= _SEEN),
                "mean_mould": mean(maps["mould"]),
                "mean_nutrient": mean(maps["nutrient"]),
            }
        return found
