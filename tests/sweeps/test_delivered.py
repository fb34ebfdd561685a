"""What a shape of a run says of itself is measured on what is handed over, its poles among it."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

from service.formats import write
from solver.geometry.crossings import crossings
from solver.lattice import azimuths, closed_lattice, colatitudes, directions, lattice
from sweeps import outputs

N = 16


def flat_with_a_rim(height: float) -> np.ndarray:
    """A disc whose second circle rises: the waves through it swing down at the pole, below the first one's mean."""
    position = directions(*lattice(N))
    position[..., 1] *= 0.05
    position[0, :, 1] = 0.05
    position[1, :, 1] += height
    position[2, :, 1] += height / 4
    return position


@pytest.mark.parametrize(("height", "crosses"), [(0.0, False), (0.2, False), (0.4, True)])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_crossings_are_counted_with_the_poles_of_the_file(height: float, crosses: bool, kind: type) -> None:
    position = flat_with_a_rim(height).astype(kind)
    run = xr.Dataset(
        {
            "position": (("stage", "colatitude", "azimuth", "component"), position[None]),
            "converged": ("stage", [1]),
            "lattice_crossings": ("stage", [0]),
        },
        {"stage": [0.1], "colatitude": colatitudes(N), "azimuth": azimuths(N)},
    )
    shape = outputs.of_result(run, {}, 0)
    assert shape.poles is not None
    whole = np.concatenate([position.reshape(-1, 3), shape.poles]).astype(float)
    assert shape.crossings == crossings(whole, closed_lattice(N)).count
    assert bool(shape.crossings) is crosses
    # closed by the mean of its first circle, as `lattice_crossings` counts, it crosses nowhere
    rings = np.concatenate([position.reshape(-1, 3), position[[0, -1]].mean(axis=1)]).astype(float)
    assert crossings(rings, closed_lattice(N)).count == 0
    assert json.loads(write(shape, "json"))["crossings"] == shape.crossings


def test_counts_are_among_the_numbers_of_a_run_and_how_it_went_is_not() -> None:
    run = xr.Dataset(
        {
            "position": (("stage", "colatitude", "azimuth", "component"), flat_with_a_rim(0.0)[None]),
            "buckle_count": ("stage", [7]),
            "roughness": ("stage", [0.1]),
            "converged": ("stage", np.ones(1, np.int8)),
            "iterations": ("stage", [2000]),
        },
        {"stage": [0.1], "colatitude": colatitudes(N), "azimuth": azimuths(N)},
    )
    assert outputs.of_result(run, {}, 0).descriptors == {"buckle_count": 7.0, "roughness": 0.1}
