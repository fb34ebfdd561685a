"""What a quality means: mesh and error of a step; and what a run is expected to cost."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from ..contract import Cost, Need, Quality
from .environment import opened, reference_radius
from .fields.rates import units
from .names import BODY, FIELDS, FLESH, MOULD, ROT, VECTORS, completed
from .params import DecayParams
from .surfaces.seeds import seeds
from .surfaces.surface import extent

__all__ = ["Settings", "cells_of", "choose", "expected_cost", "moved", "nodes", "stepped"]


@dataclass(frozen=True)
class Settings:
    """cells: of the geodesic sphere. tolerance: relative L2 error of a step. longest: step [day].

    layers: shells of the body. balance, smooth: out-of-balance force of body and of skin over the forces in them.
    skin: cells of the skin's own mesh. within: points of the flesh that has fields of its own, about; 0: none.
    imported: points of a mesh of the user's own, which stands for the sphere.
    """

    cells: int
    tolerance: float
    longest: float
    layers: int
    balance: float
    smooth: float
    skin: int
    imported: int = 0
    within: int = 0

    @property
    def vertices(self) -> int:
        """Number of points on the surface."""
        return self.imported or 10 * self.cells**2 + 2


_MESHES: dict[Quality, tuple[int, float]] = {"preview": (32, 1e-4), "default": (96, 3e-5), "fine": (192, 1e-5)}
_BODIES: dict[Quality, tuple[int, float, float, int]] = {
    "preview": (6, 1e-3, 1e-3, 16),
    "default": (8, 1e-4, 1e-3, 32),
    "fine": (16, 1e-5, 1e-4, 32),
}
#: Cells and shells of each fruit of a heap, which is seen from farther away than one alone.
_HEAPS: dict[Quality, tuple[int, int]] = {"preview": (16, 4), "default": (32, 6), "fine": (64, 8)}
#: Points of flesh that has fields of its own.
_WITHIN: dict[Quality, int] = {"preview": 12_000, "default": 50_000, "fine": 200_000}
#: Longest step, in units of the quicker organism's own time.
_LONGEST = 4.0
#: Measured on one busy core: seconds per step and vertex with both organisms, and a typical step in model time.
_SECONDS, _STEP = 4e-7, 0.2
#: Seconds per settled body and tetrahedron.
_BODY_SECONDS = 2e-5
#: The same of a heap, whose bodies start from where they lay.
_HEAP_SECONDS = 1e-5
#: Seconds per wrinkled skin and vertex.
_SKIN_SECONDS = 4e-4
#: Working memory per vertex, mesh and states of both organisms.
_BYTES = 1000


def cells_of(quality: Quality) -> int:
    """Return the cells of a quality's geodesic sphere."""
    return _MESHES[quality][0]


def choose(params: DecayParams, quality: Quality) -> Settings:
    """Return the settings of a quality; they follow from parameters and quality alone."""
    cells, tolerance = _MESHES[quality]
    layers, balance, smooth, skin = _BODIES[quality]
    if params.heap is not None:
        cells, layers = _HEAPS[quality]
    return Settings(
        cells,
        tolerance,
        _LONGEST / max(_clock(params), 0.1),
        layers,
        balance,
        smooth,
        skin,
        len(params.mesh.points) if params.mesh else 0,
        _WITHIN[quality] if params.within else 0,
    )


def moved(params: DecayParams, wanted: Collection[str]) -> bool:
    """Return whether the wanted fields ask for a body that moves."""
    return params.body in ("quasi-static", "paper") and not BODY.isdisjoint(wanted)


def nodes(params: DecayParams, need: Need) -> tuple[float, ...]:
    """Return the days of the march whose shapes later ones are settled from, up to the last stage; none without one."""
    if params.march is None or not moved(params, need.fields):
        return ()
    return tuple(k * params.march for k in range(int(need.stages[-1] / params.march + 1e-9) + 1))


def stepped(params: DecayParams, wanted: Collection[str]) -> bool:
    """Return whether rot has to be stepped: it is wanted, or bears on the body that moves or on the water lost."""
    wounded = bool(params.wound_map) or params.wound_photo is not None or bool(params.cuts) or len(seeds(params)) > 0
    bears = moved(params, wanted) and params.flesh.heeds_rot and wounded
    # broken skin loses more water
    dries = wounded and opened(params) > params.transpiration
    if params.oven is not None:
        return True
    # the water of flesh with fields of its own is stepped in any case
    dries |= params.within is not None
    bears |= dries and ("water_lost" in wanted or (params.body != "none" and not BODY.isdisjoint(wanted)))
    return bears or not {*ROT, *MOULD, *FLESH, "budget_error"}.isdisjoint(wanted)


def expected_cost(params: DecayParams, need: Need) -> Cost:
    """Return what a run is expected to take."""
    settings, need = choose(params, need.quality), completed(params, need)
    wanted = set(need.fields)
    organisms = 2 if MOULD & wanted else 1 if stepped(params, wanted) else 0
    steps = need.stages[-1] * _clock(params) / _STEP + len(need.stages)
    assert need.resolution is not None  # settled
    width = 8 if need.dtype == "float64" else 4
    values = sum((3 if f in VECTORS else 1) for f in FIELDS if f in wanted) * 2 * need.resolution**2
    points = settings.vertices + settings.within
    seconds = 1e-5 * points + steps * (settings.vertices * organisms / 2 + settings.within) * _SECONDS
    if moved(params, wanted):
        count = len(need.stages) + len(nodes(params, need))
        seconds += count * 20 * settings.layers**3 * _BODY_SECONDS
        seconds += count * 10 * settings.skin**2 * _SKIN_SECONDS * (params.skin is not None)
    if params.heap is not None:
        return _heaped(params, need, settings, steps)
    values += sum(3 if f == "flesh_position" else 1 for f in FLESH if f in wanted) * settings.within
    return Cost(seconds, len(need.stages) * (values * width + 200) + points * _BYTES)


def _heaped(params: DecayParams, need: Need, settings: Settings, steps: float) -> Cost:
    """Return what a heap is expected to take: its fruits' fields, and at each look its bodies."""
    assert params.heap is not None
    fruits, wanted = params.heap.count, set(need.fields)
    points = fruits * settings.vertices
    looks = len(need.stages) + need.stages[-1] / params.heap.step
    seconds = 2.0 + steps * points * _SECONDS
    seconds += looks * fruits * 20 * settings.layers**3 * _HEAP_SECONDS * moved(params, wanted)
    width = 8 if need.dtype == "float64" else 4
    values = sum(3 if f == "mesh_position" else 1 for f in (*FIELDS, "mesh_position") if f in wanted) * points
    return Cost(seconds, len(need.stages) * (values * width + 200) + points * _BYTES)


def _clock(params: DecayParams) -> float:
    """Return the units of the quicker organism's time in a day, at its best."""
    radius = 1e3 * reference_radius(params, extent(params))
    return max(units(colony, params, radius) for colony in (params.rot, params.mould))
