"""How large fruits are: of presets it is known, of what is nobody's preset it is not."""

from __future__ import annotations

import numpy as np
import pytest

from solver import registry
from solver.lattice import lattice

SIZED = [name for name in registry.names() if registry.get(name).sizes]


@pytest.mark.parametrize("name", SIZED)
def test_presets_are_as_large_as_they_say_and_as_fruits_are(name: str) -> None:
    solver = registry.get(name)
    assert set(solver.sizes) <= set(solver.presets)
    for preset, size in solver.sizes.items():
        assert 0.003 < size < 0.1
        assert solver.metres(solver.parse({}, preset).model_dump(mode="json")) == size


def test_a_raisin_stays_one_with_another_skin_and_a_sphere_is_of_any_size() -> None:
    solver = registry.get("dehydration")
    raisin = solver.parse({"te": 0.03, "gamma": 40}, "raisin").model_dump(mode="json")
    assert solver.metres(raisin) == solver.sizes["raisin"]
    fresh = solver.fresh(raisin)
    assert fresh is not None
    grape = np.ptp(fresh.points(*lattice(32)).reshape(-1, 3), axis=0).max() * solver.sizes["raisin"]
    assert 0.015 < grape < 0.02  # dried it is 1.5 cm long: tests/service/blender measures one
    for te in (0.005, 0.04, 0.08, 0.085, 0.2):
        assert solver.metres(solver.parse({"te": te}, "sphere").model_dump(mode="json")) is None
    assert solver.metres(solver.parse({"r4": 0.52}, "raisin").model_dump(mode="json")) is None


def test_who_knows_no_sizes_says_none() -> None:
    for name in set(registry.names()) - set(SIZED):
        assert registry.get(name).metres({}) is None
