"""The fruit's fresh surface as tables of shapes want it: exact, and on a lattice cheaply."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from .arrays import Array
from .contract import Fresh, Surface
from .fruit import Fruit
from .lattice import azimuths, colatitudes

__all__ = ["SURFACE", "FreshFruit"]


class FreshFruit(Fresh):
    """A fruit at rest, in units of r1."""

    def __init__(self, radii: tuple[float, ...], stone: tuple[float, ...], te: float) -> None:
        self._radii, self._stone, self._te = radii, stone, te

    @cached_property
    def _fruit(self) -> Fruit:
        # made where it is needed: for a lattice that is not, and it takes longer than all else here
        fruit: Any = Fruit.model_construct
        found: Fruit = fruit(radii=self._radii, stone=self._stone, exocarp_thickness=self._te)
        return found

    def points(self, colatitude: Array, azimuth: Array) -> Array:
        """Return points (..., 3) of the outer surface."""
        return self._fruit.surface(colatitude, azimuth)

    def planes(
        self, n: int, rows: slice, columns: slice | Array, components: tuple[int, ...], kind: np.dtype[Any]
    ) -> Iterator[Array]:
        """Yield the components on a part of the lattice, each broadcasting to (height, width).

        Only the generatrix and the azimuth's sine and cosine are evaluated, each once; the surface is their product.
        """
        x, y, x_along_ray, y_along_ray = (values[rows] for values in _generatrix(self._radii, n))
        cosine, sine = (values[columns] for values in _circle(n, self._radii[7] / self._radii[3], kind.str))
        te = self._te
        if self._radii[7] == self._radii[3]:
            across: Array = (x + te * x_along_ray)[:, None].astype(kind)
            along: Array = (y + te * y_along_ray)[:, None].astype(kind)
        else:
            flat = (x**2).astype(kind)[:, None] * (cosine**2 + sine**2)
            stretch = 1 + kind.type(te) / np.sqrt(flat + (y**2).astype(kind)[:, None])
            across, along = stretch * x.astype(kind)[:, None], stretch * y.astype(kind)[:, None]
        for component in components:
            yield along if component == 1 else across * (sine if component else cosine)

    def poles(self) -> Array:
        """Return the two poles (2, 3)."""
        inner, distance = _ends(self._radii)
        return inner * (1 + self._te / distance)

    def core(self, rays: Array) -> Array | None:
        """Return how far the stone reaches along unit rays; None without one."""
        return self._fruit.stone_distance(rays) if self._fruit.has_stone else None


@lru_cache(maxsize=64)
def _generatrix(radii: tuple[float, ...], n: int) -> tuple[Array, Array, Array, Array]:
    """Return x and y (n,) of the sarcocarp, and the unit vectors of their rays."""
    # the fruit that these radii come from has been validated
    fruit: Any = Fruit.model_construct
    x, y = fruit(radii=radii).generatrix(colatitudes(n))
    distance = np.hypot(x, y)
    return x, y, x / distance, y / distance


@lru_cache(maxsize=64)
def _ends(radii: tuple[float, ...]) -> tuple[Array, Array]:
    """Return the sarcocarp's poles (2, 3) and their distances (2, 1) from the centre."""
    fruit: Any = Fruit.model_construct
    inner = fruit(radii=radii).sarcocarp(np.array([0.0, np.pi]), np.zeros(2))
    return inner, np.linalg.norm(inner, axis=-1, keepdims=True)


@lru_cache(maxsize=64)
def _circle(n: int, squash: float, kind: str) -> tuple[Array, Array]:
    """Return x and z (2n,) of the equator's ellipse whose x axis is 1."""
    phi = azimuths(n)
    return np.cos(phi).astype(kind), (squash * np.sin(phi)).astype(kind)


@lru_cache(maxsize=256)
def _check(radii: tuple[float, ...], stone: tuple[float, ...]) -> None:
    """Refuse impossible fruits. The exocarp lies outside of all that could collide, and its bounds are a box."""
    Fruit.parse({"radii": radii, "stone": stone})


def _of(values: Mapping[str, Any]) -> FreshFruit:
    radii, stone, te = tuple(values["radii"]), tuple(values["stone"]), values["exocarp_thickness"]
    _check(radii, stone)
    return FreshFruit(radii, stone, te)


SURFACE = Surface(("radii", "stone", "exocarp_thickness"), _of)
