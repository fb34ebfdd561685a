"""A heap of fruits through time: each decays by itself, and at every look they meet, infect and dampen each other.

Looks are `heap.step` apart, whatever stages are asked for. A stage between two looks is settled from the last one's
shape, so that it depends on no other stage.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...arrays import Floats
from ...contract import Context, InvalidInput, Need
from ..body.flesh import Booked
from ..climate import warmth
from ..environment import ACTIVITY, air, saturation
from ..fields.stepping import Reached, march
from ..fields.system import System
from ..names import BODY, MOULD
from ..params import DecayParams, Wound
from ..settings import Settings, choose, moved
from ..surfaces.shape import volume_of
from ..surfaces.surface import extent, geodesic
from .air import between
from .bodies import TOUCHING, Bodies, Shaped, headroom, overlap, stiff
from .infection import Exposure
from .kinds import lives, sorted_out
from .lying import Lying, lie, separate
from .one import One
from .touching import Pairs, paired

__all__ = ["HeapRun"]

#: Radius of the place where two fruits touch, and of what grows there first [r1].
_PATCH = 0.15
#: Gap that what is rotten still bridges, with threads and juice [r1]: rot sinks in where it starts. A choice.
_BRIDGED = 0.15
#: Room above a stem that nothing is near [r1].
_OPEN = 10.0


class HeapRun:
    """The fruits of a heap, each with its organisms, as one mesh.

    Raises:
        InvalidInput: it asks for what only a single fruit has, or the fruits do not fit into their bowl.

    """

    def __init__(self, params: DecayParams, need: Need, settings: Settings) -> None:
        assert params.heap is not None
        wanted = set(need.fields)
        if "displacement" in wanted or need.region is not None:
            raise InvalidInput(
                "a heap has no lattice of colatitudes.", advice="Ask for fields without a region, and no displacement."
            )
        self._params, self._need, self._settings, self._heap = params, need, settings, params.heap
        self.wanted = wanted
        self._with_mould = bool(wanted & MOULD)
        sound = {"wounds": (), "wound_map": (), "wound_photo": None, "seeds": "wounds"}
        self._single = params.model_copy(update={"heap": None, **sound})
        self._lot = lot = sorted_out(params, self._single, settings.cells)
        self._lying: Lying = lie(params, lot)
        self._settings = replace(settings, longest=min(choose(one, need.quality).longest for one in lot.params))
        start = stiff(self._lying, lot)
        self._shaped = Shaped(start, None, (), np.ones(len(start)))
        self._bodies = Bodies(params, self._lying, lot, settings) if moved(params, wanted) else None
        self.systems = [
            System(self._fruit(b, start), settings.cells, self._with_mould, lot.surfaces[k])
            for b, k in enumerate(lot.kind.tolist())
        ]
        self._exposure = Exposure(params)
        self._damp: Floats = np.zeros(len(start))
        # of which kind each fruit's organism is, once it has any
        self._species = np.where(np.isin(np.arange(len(start)), self._opened), lot.kind, -1)
        first, size = lot.extents[0], self._lying.size
        area = np.array([one.area for one in lot.extents])[lot.kind]
        self._r1 = float((params.weight * 1e-6 / extent(self._single).volume) ** (1 / 3))
        self._area = area * self._r1**2 * size**2
        large, wide = (
            np.array([getattr(one, x) / getattr(first, x) for one in lot.extents]) for x in ("volume", "area")
        )
        self._share, self._skin = (_shared(x) for x in (large[lot.kind] * size**3, wide[lot.kind] * size**2))
        self._room = np.full(len(start), np.inf)

    def _fruit(self, b: int, start: Floats) -> DecayParams:
        """Return the parameters of one fruit alone."""
        params, heap = self._params, self._heap
        single: DecayParams = self._lot.params[self._lot.kind[b]]
        update: dict[str, Any] = {
            "weight": single.weight * float(self._lying.size[b] / self._lot.scales[b]) ** 3,
            "seed": int(separate(params, 2 + b).integers(2**31)),
        }
        if b in heap.infected:
            update |= {name: getattr(params, name) for name in ("wounds", "wound_map", "wound_photo")}
        if params.seeds == "contacts":
            update["wounds"] = tuple(self._touched(b, start))
        return single.model_copy(update=update)

    @property
    def _opened(self) -> list[int]:
        """Which fruits something enters on day 0."""
        everywhere = self._params.seeds == "contacts"
        return list(range(self._heap.count)) if everywhere else list(self._heap.infected)

    def _touched(self, b: int, start: Floats) -> Iterator[Wound]:
        yield Wound(colatitude=0)
        for (i, j), way, gap in self._contacts(start):
            if b in (i, j) and gap <= TOUCHING:
                ray = self._ray(b, way if b == i else -way)
                yield Wound.model_validate({"position": tuple(ray.tolist())})

    def _ray(self, b: int, way: Floats) -> Floats:
        """Return a direction in the heap as one in a fruit's own frame."""
        return np.asarray(way @ self._lying.turn[b])

    def _contacts(self, points: Floats) -> list[tuple[tuple[int, int], Floats, float]]:
        pairs: Pairs = paired(points)
        return [
            ((int(i), int(j)), way, float((points[j] @ way).min() - (points[i] @ way).max()))
            for (i, j), way in zip(pairs.body, pairs.way, strict=True)
        ]

    def rows(self, context: Context) -> Iterator[dict[str, Any]]:
        """Yield the wanted stages in turn.

        Raises:
            SolverError: as a single fruit's.

        """
        begun = time.perf_counter()
        last, step = self._need.stages[-1], self._heap.step
        looks = {k * step for k in range(int(last / step + 1e-9) + 1)}
        days = tuple(sorted(looks | set(self._need.stages)))
        quiet = Context(cancelled=lambda: _asks(context))
        paths = [
            march(system, days, self._settings.tolerance, self._settings.longest, quiet) for system in self.systems
        ]
        seen = 0.0
        for day in days:
            context.check_cancelled()
            reached = [next(path) for path in paths]
            shaped = self._settle(reached, context)
            if day in self._need.stages:
                row = self._row(day, reached, shaped)
                row["seconds"] = time.perf_counter() - begun
                yield row
            if day in looks:
                self._shaped = shaped
                self._look(day, day - seen, reached, shaped.points)
                seen = day
            context.report(day / max(last, 1e-9), f"day {day:.2f} of {len(self.systems)} fruits")

    def _settle(self, reached: Sequence[Reached], context: Context) -> Shaped:
        if self._bodies is None:
            return self._shaped
        states = [
            self._bodies.state(b, at.state.water, system.rot.share(at.state.rot))
            for b, (at, system) in enumerate(zip(reached, self.systems, strict=True))
        ]
        before = self._shaped if self._shaped.found is not None else None
        return self._bodies.settled(states, before, context.check_cancelled)

    def _look(self, day: float, since: float, reached: Sequence[Reached], points: Floats) -> None:
        """Let fruits that touch infect each other, and all of them dampen the air between them."""
        params = self._params
        celsius, humidity = air(params, day)
        rots = [system.rot.share(at.state.rot) for at, system in zip(reached, self.systems, strict=True)]
        for pair, way, gap in self._contacts(points):
            if gap > _BRIDGED:
                continue
            rays = [self._ray(pair[0], way), self._ray(pair[1], -way)]
            seen = [
                float(rots[b][self.systems[b].skin.near(ray, _PATCH)].max()) for b, ray in zip(pair, rays, strict=True)
            ]
            for one in (0, 1):
                here, there = pair[one], pair[1 - one]
                if self._feeds(here, there) and self._exposure.sees(
                    here, there, seen[one], seen[1 - one], since * self._warm(there, float(celsius))
                ):
                    self._taken(here, there)
                    self.systems[here].caught(day, rays[one], _PATCH)
        full = float(saturation(celsius))
        skins = np.array([s.conductance(at.state.rot) for s, at in zip(self.systems, reached, strict=True)])
        found = between(
            points.mean(axis=1) * self._r1,
            self._lying.size * self._r1,
            1e-6 * self._area * skins,
            float(celsius),
            (ACTIVITY * full, float(humidity) / 100 * full, full),
            self._heap.still,
        )
        self._damp = found.damp
        for system, dries, damp in zip(self.systems, found.dries, found.damp, strict=True):
            system.dries, system.damp = float(dries), float(damp)

    def _feeds(self, here: int, there: int) -> bool:
        """Return whether a fruit is food for what rots another: of its hosts, and not another's already."""
        species, own = int(self._species[there]), int(self._species[here])
        return species >= 0 and own in (-1, species) and lives(self._lot, species, int(self._lot.kind[here]))

    def _warm(self, b: int, celsius: float) -> float:
        """Return how fast what lives on a fruit grows at a temperature, over its best."""
        params = self.systems[b].params
        return float(warmth(params.rot, celsius)) if params.climate == "cardinal" else 1.0

    def _taken(self, here: int, there: int) -> None:
        """Let what rots one fruit live on another."""
        if self._species[here] != self._species[there]:
            self._species[here] = self._species[there]
            if self._species[here] != self._lot.kind[here]:
                theirs = self.systems[there].params
                self.systems[here].taken_by(theirs.rot, theirs.mould)

    def _row(self, day: float, reached: Sequence[Reached], shaped: Shaped) -> dict[str, Any]:
        need, wanted, share = self._need, self.wanted, self._share
        fruits = [One(system, at) for system, at in zip(self.systems, reached, strict=True)]
        worst = max(max(fruit.budget) for fruit in fruits)
        error = max(at.error for at in reached)
        sound = error <= 1 and worst <= 1e-10
        row: dict[str, Any] = {
            "stage": day,
            "residual": error * self._settings.tolerance,
            "converged": sound,
            "iterations": sum(at.steps for at in reached),
        }
        points = shaped.points.astype(need.dtype)
        booked = shaped.booked or [Booked(1 - f.water, f.water, 0.0, 0.0) for f in fruits]
        sums = np.array(booked)
        mass, water, juice, respired = share @ sums
        lot, size = self._lot, self._lying.size
        each = [lot.surfaces[k] for k in lot.kind]
        volume = sum(volume_of(p, surface) for p, surface in zip(points.astype(float), each, strict=True))
        fresh = sum(
            volume_of(surface.points, surface) * float(np.sum(size[lot.kind == k] ** 3))
            for k, surface in enumerate(lot.surfaces)
        )
        found: dict[str, Any] = {
            "mass": mass,
            "water_lost": water,
            "juice_lost": juice,
            "respired": respired,
            "volume": volume,
            "density": mass * fresh / volume,
            "least_jacobian": shaped.found.least_jacobian if shaped.found else 1.0,
            "budget_error": worst,
            "mesh_position": points.reshape(-1, 3),
        }
        means = [fruit.means() for fruit in fruits]
        found |= {name: float(self._skin @ [m[name] for m in means]) for name in means[0]}
        maps = [fruit.maps() for fruit in fruits]
        found |= {name: np.concatenate([m[name] for m in maps]).astype(need.dtype) for name in maps[0]}
        row |= {name: value for name, value in found.items() if name in wanted}
        row["fruit_rotten"] = np.array([m["rotten_share"] for m in means])
        row["fruit_mass"] = sums[:, 0]
        row["fruit_damp"] = self._damp.copy()
        if lot.names:
            row |= dict(zip(("fruit_water_lost", "fruit_juice_lost", "fruit_respired"), sums.T[1:], strict=True))
            row["fruit_species"] = self._species.astype(np.int32)
            row |= self._vertexwise(sums[:, 1])
            self._room = np.minimum(self._room, headroom(points.astype(float), self._lying, self._poles[0]))
        if wanted & BODY:
            row["overlap"] = max(overlap(points.astype(float), self._lying), 0.0)
        if shaped.found is not None:
            row["body_residual"], row["body_steps"] = shaped.found.residual, shaped.found.steps
        return row

    @property
    def kept(self) -> dict[str, Any]:
        """Triangles of all fruits, and which fruit a vertex is of, as variables."""
        count, surface = len(self.systems), self._lot.surfaces[0]
        size = len(surface.points)
        faces = surface.faces[None] + size * np.arange(count)[:, None, None]
        data: dict[str, Any] = {"fruit": (("vertex",), np.repeat(np.arange(count, dtype=np.int32), size))}
        if "triangle" in self.wanted:
            data["triangle"] = (("face", "corner"), faces.reshape(-1, 3).astype(np.int32))
        return data | (self._dressed(size) if self._lot.names else {})

    def _vertexwise(self, lost: Floats) -> dict[str, Any]:
        """Return what the looks of a stage need at each vertex: its fruit's kind, what lives there, and water lost."""
        living = np.where(self._species >= 0, self._species, self._lot.kind)
        values = {"kind": self._lot.kind, "living": living, "lost": lost}
        size = len(self._lot.surfaces[0].points)
        return {name: np.repeat(each, size).astype(np.float32) for name, each in values.items()}

    @property
    def _poles(self) -> tuple[int, int]:
        """Numbers of the vertices at a fruit's stem and at its other end."""
        rays, _ = geodesic(self._settings.cells)
        return int(np.argmax(rays[:, 1])), int(np.argmin(rays[:, 1]))

    def _dressed(self, size: int) -> dict[str, Any]:
        """Return what the looks of several kinds are made of, as variables.

        Of each vertex its place on the fresh fruit in its own frame; of each fruit the vertices at its poles, its kind
        and size, and how long a stem has room.
        """
        lot, sizes = self._lot, self._lying.size
        fresh = np.concatenate([s * lot.surfaces[k].points for s, k in zip(sizes, lot.kind, strict=True)])
        first = size * np.arange(len(sizes))
        return {
            "fresh_position": (("vertex", "component"), fresh.astype(self._need.dtype)),
            "pole_vertex": (("fruit_number", "pole"), first[:, None] + np.array(self._poles)),
            "fruit_kind": (("fruit_number",), lot.kind.astype(np.int32)),
            "fruit_size": (("fruit_number",), sizes),
            "fruit_headroom": (("fruit_number",), np.minimum(self._room, _OPEN)),
        }


def _shared(parts: Floats) -> Floats:
    whole: Floats = parts / np.sum(parts)
    return whole


def _asks(context: Context) -> bool:
    context.check_cancelled()
    return False
