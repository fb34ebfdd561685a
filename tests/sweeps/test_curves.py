"""A test bench's curves: what is drawn over what."""

from __future__ import annotations

import re

import numpy as np
import pytest
import xarray as xr

from sweeps.curves import as_svg

#: Two grips of which the first goes, the second turns, by 0, 1e-3 and 2e-3 at loads 0, 3 and 5.
WAY = np.array([[[0.0, 0, 0], [0, 0, 0]], [[1e-3, 0, 0], [0, 0, 0]], [[2e-3, 0, 0], [0, 0, 0]]])
LOAD = np.array([[[0.0, 0, 0], [0, 0, 0]], [[3, 0, 0], [0, 3, 0]], [[5, 0, 0], [0, 5, 0]]])
DIMS = ("stage", "grip", "component")


def run(**fields: np.ndarray) -> xr.Dataset:
    return xr.Dataset({name: (DIMS, values) for name, values in fields.items()}, coords={"stage": [0.0, 1.0, 2.0]})


def words(svg: bytes) -> list[str]:
    """Return the words of a drawing, which matplotlib leaves as comments beside their outlines."""
    return re.findall(r"<!-- (.*?) -->", svg.decode())


@pytest.mark.parametrize(
    ("fields", "wanted", "unwanted"),
    [
        (
            {"grip_force": LOAD, "grip_shift": WAY},
            {"way [mm]": 1, "force [N]": 2, "grip 0": 2, "grip 1": 1, "stage [1]": 1},
            ["moment [N m]"],
        ),
        (
            {"grip_torque": LOAD, "grip_turn": WAY[:, ::-1] * np.pi / 180},
            {"turn [degree]": 1, "moment [N m]": 2, "grip 1": 2, "grip 0": 1, "stage [1]": 1},
            ["force [N]"],
        ),
        (
            {"grip_force": LOAD, "grip_shift": WAY, "grip_torque": LOAD, "grip_turn": WAY[:, ::-1]},
            {"way [mm]": 1, "turn [degree]": 1, "stage [1]": 2, "force [N]": 2, "moment [N m]": 2},
            [],
        ),
        # what rests bears a moment all the same, and what bears nothing is left out
        ({"body_torque": LOAD * [[1.0], [0.0]]}, {"moment [N m]": 1, "body 0": 1, "stage [1]": 1}, ["body 1"]),
    ],
)
def test_loads_are_drawn_over_what_moved_and_over_the_stage(
    fields: dict[str, np.ndarray], wanted: dict[str, int], unwanted: list[str]
) -> None:
    found = words(as_svg(run(**fields)))
    assert {word: found.count(word) for word in wanted} == wanted
    assert not set(unwanted) & set(found)


def test_the_scales_are_millimetres_and_degrees() -> None:
    """By the largest number on an axis: ways of 2 mm, turns of .002 radian, loads to 5."""
    for fields, wanted in (
        ({"grip_force": LOAD, "grip_shift": WAY}, "2.00"),
        ({"grip_torque": LOAD, "grip_turn": WAY[:, ::-1] * 500 * np.pi}, "175"),
    ):
        numbers = [word for word in words(as_svg(run(**fields))) if re.fullmatch(r"[0-9.]+", word)]
        assert wanted in numbers
        assert max(map(float, numbers)) == max(float(wanted), 5.0)
