"""Any solver's result as a sequence of triangle meshes: what every writer of this package reads.

A result holds either the fruit's lattice (`position` or `displacement` on colatitude x azimuth; topology and texture
coordinates of `service.formats.mesh`) or meshes (`solver.meshes`).
Fields without a shape are shown on the fresh fruit if it keeps its shape, and refused if it moves. Lengths are in the
result's own unit; y is up, and a result whose attribute `up` is z is turned about x. Nothing else is turned, or scaled
but by `Sequence.scale`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.arrays import Array, Singles, Words32
from solver.contract import Fur, Worn
from store.surfaces import spectra
from sweeps.pictures import colours
from sweeps.pictures.fur import Feet, Threads, feet, grown

from ..errors import InvalidQuery, UnfitFormat, Wrong
from ..formats import mesh
from . import charts
from .bake import baked
from .seam import Seam

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Seam", "Sequence", "Surface", "of_run"]


class Surface(NamedTuple):
    """One stage: vertices (v, 3), triangles (f, 3) counter-clockwise from outside, fields of the vertices (v).

    colour: (v, 3), linear light. roughness: (v). Both None where nothing says what the surface looks like. fur: what
    stands on it, None where nothing does.
    """

    stage: float
    vertices: Singles
    triangles: Words32
    fields: Mapping[str, Singles]
    colour: Singles | None = None
    roughness: Singles | None = None
    fur: Fur | None = None
    #: Texture coordinates and materials of its own, where triangles change from stage to stage; else the sequence's.
    seam: Seam | None = None
    material: Array | None = None
    #: Which of the fields are weights in groups.
    groups: tuple[str, ...] = ()

    def normals(self) -> Singles:
        """Return outward unit normals (v, 3), weighted by area; (0, 1, 0) where no triangle has any."""
        a, b, c = (self.vertices[self.triangles[:, k]].astype(float) for k in range(3))
        areas = np.cross(b - a, c - a)
        total = np.zeros(self.vertices.shape)
        for axis in range(3):
            for corner in range(3):
                total[:, axis] += np.bincount(self.triangles[:, corner], areas[:, axis], len(total))
        length = np.linalg.norm(total, axis=1, keepdims=True)
        return np.where(length > 1e-30, total / np.maximum(length, 1e-30), [0.0, 1.0, 0.0]).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Sequence:
    """Stages of a result, made one at a time. `kept`: all have the same triangles.

    colour: `auto` (the solver's own looks where the result has fields for them), `none`, or a field's name.
    unit: metres per unit of length, 0 where nobody knows. observe: told the share that is done.
    """

    run: xr.Dataset
    indices: tuple[int, ...]
    kept: bool
    lattice: int = 0
    colour: str = "auto"
    scale: float = 1.0
    observe: Callable[[float], None] = field(default=lambda share: None)

    def __len__(self) -> int:
        return len(self.indices)

    def __iter__(self) -> Iterator[Surface]:
        for done, index in enumerate(self.indices):
            yield self._surface(index)
            self.observe((done + 1) / len(self))

    @property
    def stages(self) -> tuple[float, ...]:
        """The values on the solver's stage axis."""
        return tuple(float(self.run["stage"][i]) for i in self.indices)

    @property
    def samples(self) -> int:
        """Vertices of all stages together: what a file's size goes with."""
        if self.lattice:
            return len(self) * (2 * self.lattice**2 + 2)
        if self.kept:
            return len(self) * self.run.sizes["vertex"]
        return int(self.run["vertex_count"].values[list(self.indices)].sum())

    @cached_property
    def stays(self) -> bool:
        """Whether all stages have the same triangles, also where those might have changed: none was cut."""
        if self.kept:
            return True
        bare = iter(replace(self, colour="none", observe=lambda share: None))
        first = next(bare)
        return all(
            len(other.vertices) == len(first.vertices) and np.array_equal(other.triangles, first.triangles)
            for other in bare
        )

    @cached_property
    def seam(self) -> Seam | None:
        """Texture coordinates, where the surface has some."""
        n = self.lattice
        if n:
            return Seam(mesh.texture(n), mesh.seam(n), mesh.seam_triangles(n))
        # where triangles change each surface has its own
        return charts.own(self.run) if self.kept else None

    @cached_property
    def is_open(self) -> bool:
        """Whether its first or last surface has a rim, as a leaf's, so that both sides are seen; a lattice has none."""
        ends = () if self.lattice else {self.indices[0], self.indices[-1]}
        return any(mesh.is_open(one.vertices, one.triangles) for one in map(self._bare, ends))

    @property
    def materials(self) -> tuple[tuple[str, NDArray[np.intp]], ...]:
        """The mesh's own materials: names, and the triangles of each, of all stages where those change.

        One without a name where it has none.
        """
        if "face_material" not in self.run:
            return (("", np.arange(self.run.sizes.get("face", 0))),) if not self.lattice else (("", np.empty(0, int)),)
        names, owned = json.loads(self.run.attrs["materials"]), self.run["face_material"].values
        return tuple((name, np.flatnonzero(owned == i)) for i, name in enumerate(names) if (owned == i).any())

    def named(self, surface: Surface) -> tuple[tuple[str, ...], Array]:
        """Return the names of the mesh's own materials, none where it has none, and which one each triangle has (f)."""
        if "face_material" not in self.run:
            return (), np.zeros(len(surface.triangles), int)
        owned = self.run["face_material"].values if surface.material is None else surface.material
        return tuple(json.loads(self.run.attrs["materials"])), np.asarray(owned)

    def threads(self, surface: Surface, most: int) -> Threads | None:
        """Return the threads, at most so many, of a stage's surface; None where none grow, or triangles change."""
        if surface.fur is None or not self.kept or not most:
            return None
        fur = surface.fur._replace(
            length=surface.fur.length * self.scale,
            width=surface.fur.width * self.scale,
            head=surface.fur.head * self.scale,
        )
        return grown(self._feet(fur, most), surface.vertices.astype(float), surface.normals().astype(float), fur)

    def _feet(self, fur: Fur, most: int) -> Feet:
        if most not in self._stood:
            first = self._bare(0)
            self._stood[most] = feet(first.vertices, first.triangles, fur.peak, most)
        return self._stood[most]

    @cached_property
    def _stood(self) -> dict[int, Feet]:
        return {}

    def unwrapped(self, instead: str = "Leave textures out: colours are those of the vertices.") -> Sequence:
        """Return the sequence with texture coordinates: its own, or else such as xatlas lays out.

        instead: what to do where its triangles change.

        Raises:
            UnfitFormat: its triangles change.
            Unavailable: it has none, and xatlas is not installed.

        """
        if self.seam is not None:
            return self
        if not self.kept:
            raise UnfitFormat(
                "textures need triangles that stay, and those of such a run may change from stage to stage.",
                advice=instead,
            )
        return replace(self, run=charts.laid(self.run))

    def baked(self, values: Array, size: int) -> Array:
        """Return a field of the vertices (v) or (v, c) as a picture (size, size) or (size, size, c), top row first."""
        n = self.lattice
        if n:
            # the poles are no samples of their own
            return baked(values[: 2 * n * n].reshape(n, 2 * n, *values.shape[1:]), size)
        assert self.seam is not None
        if size not in self._texels:
            self._texels[size] = charts.texels(self.seam, size)
        return charts.drawn(self.seam, self._texels[size], values, size)

    def worn(self, stage: float | None = None) -> Worn | None:
        """Return the skin of a surface without colours at a stage, or at its stages' mean; None where none is known."""
        return colours.worn(self.run, float(np.mean(self.stages)) if stage is None else stage)

    @cached_property
    def fresh(self) -> Singles:
        """Places (v, 3) that skin keeps, in the result's unit: as the solver says, or the run's first stage."""
        said = colours.looks(self.run).fresh
        return np.asarray(self.run[said].values, "f4") if said in self.run else self._bare(0).vertices

    def grained(self, size: int) -> Mapping[str, Array]:
        """Return what the solver knows of the texels of a picture (size, size) that is finer than its fields."""
        if size not in self._grains:
            known, fresh = colours.looks(self.run).grain, self.fresh
            reach = float(np.ptp(fresh, axis=0).max())
            found: Mapping[str, Array] = {}
            if known is not None:
                still = self._bare(0).fields
                layers = {n: self.baked(still[n], size).ravel() for n in colours.looks(self.run).layers if n in still}
                found = known(self.baked(fresh, size).reshape(-1, 3), np.pi * reach / size, self.params, layers)
            self._grains[size] = {name: values.reshape(size, size) for name, values in found.items()}
        return self._grains[size]

    @cached_property
    def _grains(self) -> dict[int, Mapping[str, Array]]:
        return {}

    def index_of(self, surface: Surface) -> int:
        """Return which of the run's stages a surface is of."""
        return min(self.indices, key=lambda i: abs(float(self.run["stage"][i]) - surface.stage))

    @cached_property
    def _texels(self) -> dict[int, charts.Texels]:
        return {}

    @cached_property
    def params(self) -> Mapping[str, Any]:
        """The solver's parameters."""
        found: Mapping[str, Any] = json.loads(self.run.attrs.get("params", "{}"))
        return found

    @property
    def about(self) -> dict[str, Any]:
        """What every file says of itself, as plain values."""
        stage = self.run["stage"].attrs
        return {
            "solver": str(self.run.attrs.get("solver", "")),
            # a mesh of one's own is what the file is made of, and no parameter to be read
            "params": {name: value for name, value in self.params.items() if name != "mesh"},
            # what was relaxed comes from a table
            **({"start": start} if (start := json.loads(self.run.attrs.get("need", "{}")).get("start")) else {}),
            "stages": {"values": list(self.stages), "units": stage.get("units", "1"), "of": stage.get("long_name", "")},
            "units": {"length": self.length, **({"metres": self.unit} if self.unit else {})},
        }

    @property
    def unit(self) -> float:
        """Metres per unit of length in the file; 0 where nobody knows."""
        said = self.run.attrs.get("metres_per_unit")
        return float(self._metres if said is None else said) / self.scale

    @cached_property
    def _metres(self) -> float:
        from solver import registry

        name = str(self.run.attrs.get("solver", ""))
        known = registry.get(name).metres(self.params) if name in registry.names() else None
        return known or 0.0

    @property
    def length(self) -> str:
        """The unit of length in words."""
        named = str(self.run.attrs.get("unit_of_length", "the solver's own"))
        base = "r1" if self.lattice else f"{self.unit * self.scale:g} m" if self.unit else named
        return base if self.scale == 1 else f"{base} / {self.scale:g}"

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the scalar fields of the vertices."""
        return tuple(self._bare(self.indices[0]).fields)

    def at(self, position: int) -> Sequence:
        """Return the sequence of one of the stages alone."""
        return replace(self, indices=(self.indices[position],))

    @cached_property
    def _range(self) -> tuple[float, float]:
        """The least and the largest value of the field that gives the colours."""
        found = [self._bare(i).fields[self.colour] for i in self.indices]
        return float(min(f.min() for f in found)), float(max(f.max() for f in found))

    @property
    def coloured(self) -> bool:
        """Whether surfaces come with colours."""
        return self._surface(self.indices[0]).colour is not None

    def _surface(self, index: int) -> Surface:
        bare = self._bare(index)
        if self.scale != 1:
            bare = bare._replace(vertices=bare.vertices * np.float32(self.scale))
        if self.colour == "none":
            return bare
        if self.colour == "auto":
            skin = colours.painted(self.run, index, bare.fields)
            if skin is None:
                return bare
            fur = colours.furred(self.run, bare.fields)
            return bare._replace(colour=skin.colour.astype("f4"), roughness=skin.roughness.astype("f4"), fur=fur)
        if self.colour not in bare.fields:
            known = ", ".join(bare.fields) or "none in this result"
            raise InvalidQuery.of([Wrong("colour", f"there is no field {self.colour[:40]!r}", f"Fields: {known}.")])
        return bare._replace(colour=colours.by_field(bare.fields[self.colour], *self._range).astype("f4"))

    def _bare(self, index: int) -> Surface:
        stage = float(self.run["stage"][index])
        if not self.lattice:
            from solver import meshes  # brings xarray, which those who look up shapes do without

            found = meshes.frame(self.run, index)
            fields = {n: np.asarray(v, "f4") for n, v in found.fields.items() if np.ndim(v) == 1}
            grouped = charts.groups(self.run, index, fields)
            fields |= grouped
            vertices, triangles = np.asarray(found.vertices, "f4"), np.asarray(found.triangles, "u4")
            if self.run.attrs.get("up") == "z":
                vertices = vertices[:, [0, 2, 1]] * np.array([1, 1, -1], "f4")
            if self.kept:
                return Surface(stage, vertices, triangles, fields, groups=tuple(grouped))
            seam, material = charts.own(self.run, index), charts.materials(self.run, index)
            rest: Any = {"seam": seam, "material": material, "groups": tuple(grouped)}
            return Surface(stage, vertices, triangles, fields, **rest)
        position = _positions(self.run, index)
        vertices = mesh.vertices(position, spectra.poles(spectra.spectrum(position)))
        fields = {name: _flat(values) for name, values in lattice_fields(self.run, index, self.scale).items()}
        return Surface(stage, vertices, mesh.triangles(self.lattice), fields)


def of_run(run: xr.Dataset) -> Sequence:
    """Return a result as a sequence of meshes.

    Raises:
        UnfitFormat: it holds neither a whole lattice with positions nor meshes.

    """
    indices = tuple(range(run.sizes.get("stage", 0)))
    if "mesh_position" in run and indices:
        return Sequence(run, indices, kept="stage" in run["mesh_position"].dims)
    region = json.loads(run.attrs.get("need", "{}")).get("region")
    if region is None and {"colatitude", "azimuth"} <= set(run.dims):
        return Sequence(run, indices, True, run.sizes["colatitude"])
    raise UnfitFormat(
        "this result holds no whole surface.",
        advice="Solve again with the field 'position' (or the solver's mesh) and no region; netCDF holds the rest.",
    )


def lattice_fields(run: xr.Dataset, index: int, scale: float = 1.0) -> dict[str, Array]:
    """Return the scalar fields (n, 2n) of one stage on the lattice; vectors as name_x, name_y, name_z: lengths, which
    are scaled as points are.
    """
    found: dict[str, Array] = {}
    for name, variable in run.data_vars.items():
        if variable.dims == ("stage", "colatitude", "azimuth"):
            found[str(name)] = variable.values[index]
        elif name == "displacement":
            moved = variable.values[index] * variable.dtype.type(scale)
            found |= {f"{name}_{axis}": moved[..., k] for k, axis in enumerate("xyz")}
    return found


def _positions(run: xr.Dataset, index: int) -> Array:
    from sweeps.surfaced import positions

    found = positions(run, index)
    if found is None:
        raise UnfitFormat(
            "this result holds fields of a surface that moves, and not where it is.",
            advice="Solve again with the field 'position': `wizen solve` keeps it, a plan names it under [need].",
        )
    return found


def _flat(values: Array) -> Singles:
    """Return a field (n, 2n) at the closed mesh's vertices; a pole has the mean of its row."""
    return np.concatenate([values.ravel(), [values[0].mean(), values[-1].mean()]]).astype("f4")
