"""An ellipsoid as a looked-up shape, the volume of its mesh, and the points format read by its description."""

from __future__ import annotations

import json
import struct

import numpy as np
from numpy.typing import NDArray

from service.formats import About
from service.formats.points import MAGIC
from solver.fruit import azimuths, colatitudes, directions, lattice
from store.shape import Shape

HALF_AXES = np.array([1.0, 1.4, 0.7])
#: Where the raisin of Table 1 lies in its family.
RAISIN_AT = {"te": 0.01, "gamma": 10.0}
ABOUT = About("dehydration", "main", {"gamma": 10.0}, "s", {"te": "r1"})


def ellipsoid(n: int, half_axes: NDArray[np.float64] = HALF_AXES) -> Shape:
    points = directions(*lattice(n)) * half_axes
    poles = np.array([[0, 1, 0], [0, -1, 0]]) * half_axes
    return Shape(
        colatitude=colatitudes(n),
        azimuth=azimuths(n),
        position=points.astype("f4"),
        displacement=(0.1 * points).astype("f4"),
        poles=poles.astype("f4"),
        stage=0.25,
        parameters={"te": 0.04},
        descriptors={"roughness": 0.01},
        weights={"ab": 0.75, "cd": 0.25},
        nearest=0.5,
        exact=False,
        converged=True,
        table="abc",
        units={"roughness": "1"},
    )


def polyhedron_volume(n: int) -> float:
    """Volume of the unit sphere's mesh, summed over its rings: independent of any triangle list."""
    theta = np.concatenate([[0.0], colatitudes(n), [np.pi]])
    y, area = np.cos(theta), n * np.sin(np.pi / n) * np.sin(theta) ** 2  # a regular 2n-gon at each height
    mixed = n * np.sin(np.pi / n) * np.sin(theta[1:]) * np.sin(theta[:-1])
    return float(np.sum((y[:-1] - y[1:]) * (area[:-1] + area[1:] + mixed) / 3))


def points(data: bytes) -> tuple[dict, np.ndarray]:
    magic, version, n, length = struct.unpack_from("<4sIII", data)
    assert (magic, version, length % 4) == (MAGIC, 1, 0)
    found = np.frombuffer(data, "<f4", offset=16 + length).reshape(-1, 3)
    assert len(found) == 2 * n * n + 2
    return json.loads(data[16 : 16 + length]), found
