"""What a sheet is made of from place to place: ribs that resist bending, and colours; both ride on the material."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from ..arrays import Floats
from ..contract import Context, InvalidInput
from .shapes import Ground
from .tooling.places import Everywhere, Place, share

if TYPE_CHECKING:
    from .state import State

__all__ = [
    "BARE",
    "Bed",
    "Colour",
    "Rib",
    "Thickness",
    "coloured",
    "grown_further",
    "matter",
    "softer",
    "springs",
    "thickened",
    "thickest",
    "thickness_map",
]

#: Mean edges of a mesh to a wavelength of its folds at least.
_SHOWN = 5.0

Channel = Annotated[float, Field(ge=0, le=1)]

#: What a map may make of the thickness, over the sheet's.
_THINNEST, _THICKEST = 0.05, 20.0

#: Colour of a surface that says none, linear light.
BARE = (0.42, 0.50, 0.20)


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Rib(_Model):
    """A part that resists bending more than the sheet: a vein, a midrib; or less: a joint."""

    where: Place = Field(description="Share of each vertex of the start shape, of the logarithm of `stiffness`")
    stiffness: float = Field(30.0, ge=1e-3, le=1e4, description="Bending stiffness over that of the sheet [1]")


class Thickness(_Model):
    """A part that is thicker than the sheet, a vein, or thinner, a rim: its membrane, bending and weight follow."""

    where: Place = Field(description="Share of each vertex of the start shape: 0 the sheet's thickness, 1 `times` it")
    times: float = Field(ge=0.05, le=20, description="Thickness over that of the sheet [1]")


class Bed(_Model):
    """An elastic bed: springs along the start shape's normals, on ground as uneven as the sheet.

    A plate of stiffness D on springs K per area folds, where it is compressed one way, at N = 2 (K D)^(1/2) with the
    wavelength 2 pi (D / K)^(1/4) (Hetenyi 1946; of films on soft ground Bowden et al. 1998).
    """

    wavelength: float = Field(
        gt=0,
        le=100,
        description="How long folds are that compression one way makes, 2 pi (D / K)^(1/4) [start shape's unit]",
    )
    regularity: float = Field(
        1.0,
        ge=0,
        le=1,
        description="1 less the standard deviation, from place to place, of the logarithm of the wavelength",
    )
    where: Place = Field(Everywhere(), description="Share of each vertex, of the springs' stiffness")


class Colour(_Model):
    """A coat of colour over those before it."""

    colour: tuple[Channel, Channel, Channel] = Field(description="Red, green and blue of linear light, 0 to 1 [1]")
    where: Place = Field(Everywhere(), description="Share of each vertex of the start shape")
    grown: float = Field(
        1.0,
        ge=1,
        le=1e6,
        description="Growth of area by which it has come in whole; 1: it is there from the start [1]",
    )


def matter(ribs: Sequence[Rib], colours: Sequence[Colour], ground: Ground, seed: int) -> dict[str, Floats]:
    """Return what rides on the material of a start shape, for `State.matter`; nothing where nothing is asked for.

    stiff: (n,) logarithm of the bending stiffness over the sheet's. coats: (n, k) shares of the colours. grown: (n,)
    logarithm of the growth of area, where a colour asks for it.

    Raises:
        InvalidInput: a place that the shape does not have.

    """
    found: dict[str, Floats] = {}
    if ribs:
        shares = [np.log(rib.stiffness) * share(rib.where, ground, seed + k) for k, rib in enumerate(ribs)]
        found["stiff"] = np.sum(shares, axis=0)
    if colours:
        found["coats"] = np.stack([share(c.where, ground, seed + k) for k, c in enumerate(colours)], -1)
        if any(c.grown > 1 for c in colours):
            found["grown"] = np.zeros(len(ground.mesh.x))
    return found


def thickness_map(parts: Sequence[Thickness], ground: Ground, seed: int) -> Floats:
    """Return the thickness (n,) of each vertex over the sheet's [1]: the product of 1 + share (times - 1).

    Raises:
        InvalidInput: a place that the shape does not have, values of another mesh, a map that leaves 0.05 to 20.

    """
    shares = [1 + (part.times - 1) * share(part.where, ground, seed + k) for k, part in enumerate(parts)]
    found: Floats = np.prod(shares, axis=0)
    if found.min() < _THINNEST or found.max() > _THICKEST:
        raise InvalidInput(
            f"thicknesses: together they make the sheet {found.min():.3g} to {found.max():.3g} times as thick.",
            advice=f"Keep their product between {_THINNEST:g} and {_THICKEST:g}, or change `thickness`.",
        )
    return found


def thickened(state: State, rate: Floats | None, dt: float) -> State:
    """Return a state whose thickness grew for dt at logarithmic rates (n,), as far as a map may make it; None: none."""
    if rate is None or not rate.any():
        return state
    before = state.matter.get("thick", np.ones(len(state.x)))
    # where nothing thickens it keeps its numbers
    now = np.where(rate != 0, np.clip(before * np.exp(dt * rate), _THINNEST, _THICKEST), before)
    return replace(state, matter=state.matter | {"thick": now})


def thickest(state: State, thickness: float) -> float:
    """Return the largest thickness of a sheet, that of most being `thickness` [start shape's unit]."""
    return thickness * float(state.matter["thick"].max()) if "thick" in state.matter else thickness


def softer(state: State, flexural: float) -> float:
    """Return the lesser of a stretched edge's force and a folded one's [mu], where the sheet is as thick as its mean.

    flexural: rigidity of the sheet where its thickness is 1 over `thickness` [mu l^2].
    """
    if "thick" not in state.matter:
        return min(1.0, flexural / state.length**2)
    mean = float(state.matter["thick"].mean())
    return min(mean, mean**3 * flexural / state.length**2)


def springs(bed: Bed, flexural: float, ground: Ground, seed: int) -> tuple[Floats, Floats]:
    """Return the stiffness K [mu / l^2] (n,) of springs by which a plate of flexural rigidity D folds as asked.

    And the logarithm (n,) of what its rigidity is over D: where the wavelength differs from place to place both change,
    so that all places begin to fold at the same compression.

    Raises:
        InvalidInput: folds too short for the mesh to show, a place that the shape does not have.

    """
    x, (i, j) = ground.mesh.x, ground.mesh.triangles[:, :2].T
    length = float(np.linalg.norm(x[i] - x[j], axis=1).mean())
    if bed.wavelength < _SHOWN * length:
        raise InvalidInput(
            f"bed: folds of wavelength {bed.wavelength:g} are too short for edges of {length:.3g}.",
            advice=f"Ask for {1.01 * _SHOWN * length:.2g} or more, for a finer quality, or give a finer mesh.",
        )
    # waves about twice as long as the folds, in all directions, of variance 1 together
    generator = Context.generator(seed)
    waves = generator.normal(size=(64, 3)) * (np.pi / bed.wavelength)
    noise = np.cos(x @ waves.T + generator.uniform(0, 2 * np.pi, 64)).sum(axis=1) / np.sqrt(32)
    longer = (1 - bed.regularity) * noise
    stiff = flexural * (2 * np.pi / bed.wavelength) ** 4 * np.exp(-2 * longer)
    return share(bed.where, ground, seed) * stiff, 2 * longer


def grown_further(state: State, g: Floats) -> dict[str, Floats]:
    """Return what rides on the material after rest metrics grew from the state's to g (f, 3)."""
    if "grown" not in state.matter:
        return state.matter
    # compiled code, which parameters must not load
    from .. import shell

    triangles, n = state.mesh.triangles, len(state.x)
    areas = shell.areas(state.g)
    more = np.repeat(areas * np.log(shell.areas(g) / areas), 3)
    weights = np.bincount(triangles.ravel(), np.repeat(areas, 3), n)
    mean = np.bincount(triangles.ravel(), more, n) / np.maximum(weights, 1e-300)
    return state.matter | {"grown": state.matter["grown"] + mean}


def coloured(state: State, colours: Sequence[Colour]) -> Floats:
    """Return the colours (n, 3) of a state's vertices, linear light: the coats over each other, the last on top."""
    found = np.broadcast_to(np.array(BARE), (len(state.x), 3)).copy()
    for k, coat in enumerate(colours):
        cover = state.matter["coats"][:, k]
        if coat.grown > 1:
            cover = cover * np.clip(state.matter["grown"] / np.log(coat.grown), 0, 1)
        found += cover[:, None] * (np.array(coat.colour) - found)
    return found
