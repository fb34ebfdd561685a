"""A heap of fruits through time: each decays by itself, and at every look they meet, infect and dampen each other.

Looks are `heap.step` apart, whatever stages are asked for. A stage between two looks is settled from the last one's
shape, so that it depends on no other stage.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ...arrays import Floats
from ...contract import Context, InvalidInput, Need
from ..body.flesh import Booked
from ..climate import warmth
from ..environment import ACTIVITY, air, saturation
from ..fields.stepping import Reached, march
from ..fields.system import System, laid
from ..names import BODY, MOULD
from ..params import DecayParams, Wound
from ..settings import Settings, moved
from ..surfaces.surface import Surface, extent
from .air import between
from .bodies import TOUCHING, Bodies, Shaped, overlap, stiff
from .infection import Exposure
from .lying import Lying, lie, separate
from .touching import Pairs, paired

__all__ = ["HeapRun"]

#: Radius of the place where two fruits touch, and of what grows there first [r1].
_PATCH = 0.15
#: Gap that what is rotten still bridges, with threads and juice [r1]: rot sinks in where it starts. A choice.
_BRIDGED = 0.15
#: Map value from which a place counts as rotten or mouldy.
_SEEN = 0.1


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
        self._surface: Surface = laid(self._single, settings.cells)
        self._lying: Lying = lie(params)
        start = stiff(self._lying, self._surface)
        self._shaped = Shaped(start, None, (), np.ones(len(start)))
        self._bodies = Bodies(params, self._lying, self._surface, settings) if moved(params, wanted) else None
        self.systems = [
            System(self._fruit(b, start), settings.cells, self._with_mould, self._surface) for b in range(len(start))
        ]
        self._exposure = Exposure(params)
        self._damp: Floats = np.zeros(len(start))
        own = extent(self._single)
        self._r1 = float((params.weight * 1e-6 / own.volume) ** (1 / 3))
        self._area = own.area * self._r1**2 * self._lying.size**2
        self._share = self._lying.size**3 / np.sum(self._lying.size**3)
        self._skin = self._lying.size**2 / np.sum(self._lying.size**2)

    def _fruit(self, b: int, start: Floats) -> DecayParams:
        """Return the parameters of one fruit alone."""
        params, heap = self._params, self._heap
        update: dict[str, Any] = {
            "weight": params.weight * float(self._lying.size[b]) ** 3,
            "seed": int(separate(params, 2 + b).integers(2**31)),
        }
        if b in heap.infected:
            update |= {name: getattr(params, name) for name in ("wounds", "wound_map", "wound_photo")}
        if params.seeds == "contacts":
            update["wounds"] = tuple(self._touched(b, start))
        return self._single.model_copy(update=update)

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
            self._bodies.state(at.state.water, system.rot.share(at.state.rot))
            for at, system in zip(reached, self.systems, strict=True)
        ]
        before = self._shaped if self._shaped.found is not None else None
        return self._bodies.settled(states, before, context.check_cancelled)

    def _look(self, day: float, since: float, reached: Sequence[Reached], points: Floats) -> None:
        """Let fruits that touch infect each other, and all of them dampen the air between them."""
        params = self._params
        celsius, humidity = air(params, day)
        days = since * (float(warmth(params.rot, celsius)) if params.climate == "cardinal" else 1.0)
        rots = [system.rot.share(at.state.rot) for at, system in zip(reached, self.systems, strict=True)]
        for pair, way, gap in self._contacts(points):
            if gap > _BRIDGED:
                continue
            rays = [self._ray(pair[0], way), self._ray(pair[1], -way)]
            seen = [float(rots[b][self.systems[b].near(ray, _PATCH)].max()) for b, ray in zip(pair, rays, strict=True)]
            for one in (0, 1):
                if self._exposure.sees(pair[one], pair[1 - one], seen[one], seen[1 - one], days):
                    self.systems[pair[one]].caught(day, rays[one], _PATCH)
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

    def _row(self, day: float, reached: Sequence[Reached], shaped: Shaped) -> dict[str, Any]:
        need, wanted, share = self._need, self.wanted, self._share
        fruits = [_Fruit(system, at) for system, at in zip(self.systems, reached, strict=True)]
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
        volume = sum(_volume(p, self._surface) for p in points.astype(float))
        fresh = _volume(self._surface.points, self._surface) * float(np.sum(self._lying.size**3))
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
        if wanted & BODY:
            row["overlap"] = max(overlap(points.astype(float), self._lying), 0.0)
        if shaped.found is not None:
            row["body_residual"], row["body_steps"] = shaped.found.residual, shaped.found.steps
        return row

    @property
    def kept(self) -> dict[str, Any]:
        """Triangles of all fruits, and which fruit a vertex is of, as variables."""
        count, size = len(self.systems), len(self._surface.points)
        faces = self._surface.faces[None] + size * np.arange(count)[:, None, None]
        data: dict[str, Any] = {"fruit": (("vertex",), np.repeat(np.arange(count, dtype=np.int32), size))}
        if "triangle" in self.wanted:
            data["triangle"] = (("face", "corner"), faces.reshape(-1, 3).astype(np.int32))
        return data


class _Fruit:
    """One fruit's stage, in numbers."""

    def __init__(self, system: System, reached: Reached) -> None:
        self._system, self._state = system, reached.state
        self._rot = system.rot.share(reached.state.rot)
        layers = zip((system.rot, system.mould), reached.state[:2], strict=True)
        self.budget = [layer.budget_error(s) for layer, s in layers if layer is not None and s is not None]
        self.water = reached.state.water

    def maps(self) -> dict[str, Floats]:
        found = {"rot": self._rot, "substrate": self._state.rot.n}
        if self._system.mould is not None and self._state.mould is not None:
            mould, state = self._system.mould, self._state.mould
            found |= {
                "mould": mould.share(state),
                "mould_active": np.minimum(state.u / mould.rates.theta, 1.0),
                "nutrient": state.n,
            }
        return found

    def means(self) -> dict[str, float]:
        mean, maps = self._system.surface.mean, self.maps()
        found = {"rotten_share": mean(self._rot >= _SEEN), "mean_rot": mean(self._rot)}
        if "mould" in maps:
            found |= {
                "mouldy_share": mean(maps["mould"] >= _SEEN),
                "mean_mould": mean(maps["mould"]),
                "mean_nutrient": mean(maps["nutrient"]),
            }
        return found


def _asks(context: Context) -> bool:
    context.check_cancelled()
    return False


def _volume(points: Floats, surface: Surface) -> float:
    a, b, c = (points[surface.faces[:, k]] for k in range(3))
    return abs(float(np.sum(a * np.cross(b, c)))) / 6
