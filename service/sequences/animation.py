"""Binary glTF of all stages: morph targets where only the shape changes, otherwise a mesh per stage.

Where triangles stay and no colour changes, stage 0 is the mesh and every further one a morph target (positions and
normals), with weights that fade from stage to stage. Otherwise each stage is a node of its own, and an animation of
scales, 1 for the stage that is shown and 0 for the others, switches between them: what glTF says of a node of scale 0
is that it need not be drawn. Vertex colours (COLOR_0) are linear light; so are fields, as attributes `_NAME`.
With `textures`, colours and roughness are baked to pictures on the fruit's texture coordinates instead.
"""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from sweeps.pictures.colours import looks

from ..errors import UnfitFormat
from ..formats.about import GENERATOR
from ..formats.gltf import CLAY, FLOAT, INDICES, UINT, USHORT, VERTICES, Buffer, bounds, pack, skin
from .options import Options
from .skins import looked, matter
from .standing import Extra, cards, stems

if TYPE_CHECKING:
    from .view import Sequence, Surface

__all__ = ["animation"]

Json = dict[str, Any]

#: The largest 16-bit index is reserved by WebGL as a restart mark.
_SHORT = 0xFFFF


def animation(sequence: Sequence, options: Options) -> bytes:
    """Return a sequence as a GLB file; a single stage has no animation.

    Raises:
        UnfitFormat: textures of a surface without colours, or whose triangles change.
        Unavailable: textures of a surface without texture coordinates need a package that is not installed.

    """
    if options.full and not options.textures and not (sequence.coloured and sequence.kept and sequence.seam):
        options = options.model_copy(update={"full": False, "threads": options.grown})
    if options.pixels:
        sequence = sequence.unwrapped()
        if not sequence.coloured:
            raise UnfitFormat("textures need colours, and this result has none.", advice="Leave textures out.")
    file = _File(sequence, options)
    if sequence.kept and not sequence.coloured and len(sequence) > 1:
        file.morph()
    else:
        file.switch()
    return file.bytes()


class _File:
    def __init__(self, sequence: Sequence, options: Options) -> None:
        self.sequence, self.options = sequence, options
        self.buffer = Buffer()
        self.nodes: list[Json] = []
        self.meshes: list[Json] = []
        self.images: list[Json] = []
        self.animations: list[Json] = []
        self.materials: list[Json] = []
        self.rough: dict[float, int] = {}
        self.extra: dict[str, int] = {}
        self.extensions: set[str] = set()
        self.sides: Json = {"doubleSided": True} if sequence.is_open else {}
        seam = sequence.seam
        self.copies = slice(None) if seam is None else seam.copies
        self.uv = None if seam is None else self.buffer.add(seam.uv.astype("f4"), FLOAT, "VEC2", VERTICES)
        self.shared = self._parts(seam.triangles, len(seam.uv)) if seam is not None else None

    @property
    def _name(self) -> str:
        return str(self.sequence.about["solver"]) or "result"

    @property
    def _times(self) -> np.ndarray:
        return np.arange(len(self.sequence) + 1) * self.options.step / self.options.fps

    def _indices(self, triangles: np.ndarray, count: int) -> int:
        small = count < _SHORT
        array = triangles.ravel().astype("<u2" if small else "<u4")
        return self.buffer.add(array, USHORT if small else UINT, "SCALAR", INDICES)

    def _parts(self, triangles: np.ndarray, count: int, material: np.ndarray | None = None) -> list[int]:
        """Return the indices of each material's triangles; material (f,): of triangles that are one stage's alone."""
        parts = self.sequence.materials
        if len(parts) == 1:
            return [self._indices(triangles, count)]
        if material is not None:
            return [self._indices(triangles[material == number], count) for number in np.unique(material)]
        return [self._indices(triangles[of], count) for _, of in parts]

    def _attributes(self, surface: Surface) -> Json:
        seam = surface.seam
        copies = self.copies if seam is None else seam.copies
        points = surface.vertices[copies]
        found: Json = {
            "POSITION": self.buffer.add(points, FLOAT, "VEC3", VERTICES, bounds(points)),
            "NORMAL": self.buffer.add(surface.normals()[copies], FLOAT, "VEC3", VERTICES),
        }
        if seam is not None:
            found["TEXCOORD_0"] = self.buffer.add(seam.uv.astype("f4"), FLOAT, "VEC2", VERTICES)
        elif self.uv is not None:
            found["TEXCOORD_0"] = self.uv
        if surface.colour is not None and not self.options.pixels:
            found["COLOR_0"] = self.buffer.add(np.clip(surface.colour, 0, 1)[copies], FLOAT, "VEC3", VERTICES)
        for name, values in surface.fields.items():
            word = "_" + re.sub("[^A-Z0-9_]", "_", name.upper())
            found[word] = self.buffer.add(values[copies], FLOAT, "SCALAR", VERTICES)
        return found

    def _primitives(self, surface: Surface) -> list[Json]:
        """Return a primitive for each material, which all have the same vertices."""
        if self.shared is None or not self.sequence.kept:
            own = surface.seam
            triangles, rows = (surface.triangles, surface.vertices) if own is None else (own.triangles, own.uv)
            indices = self._parts(triangles, len(rows), surface.material)
            if self.sequence.kept:
                self.shared = indices
        else:
            indices = self.shared
        first = self._textured(surface) if self.options.pixels else self._plain(surface)
        attributes = self._attributes(surface)
        found = [{"attributes": attributes, "indices": at, "material": first + i} for i, at in enumerate(indices)]
        return found + self._extras(surface)

    def _plain(self, surface: Surface) -> int:
        """Return the first of a stage's materials, one of each name, as rough as the stage is on the mean.

        glTF has no roughness for vertices; pictures have it for each place (`textures`, `full`).
        """
        rough = 0.6 if surface.roughness is None else round(float(surface.roughness.mean()), 2)
        if rough not in self.rough:
            self.rough[rough] = len(self.materials)
            names = [name or "skin" for name, _ in self.sequence.materials]
            if surface.colour is None:
                worn = self.sequence.worn() or (None if looks(self.sequence.run).shades else CLAY)
                self.materials += [{**skin(name, worn), **self.sides} for name in names]
            else:
                pbr = {"metallicFactor": 0.0, "roughnessFactor": rough}
                self.materials += [{"name": name, **self.sides, "pbrMetallicRoughness": pbr} for name in names]
        return self.rough[rough]

    def _extras(self, surface: Surface) -> list[Json]:
        """Return stem, calyx and threads as primitives of materials of their own, seen from both sides."""
        found = stems(self.sequence, surface, self.options)
        threads = cards(self.sequence, surface, self.options)
        return [self._extra(one) for one in (*found, *((threads,) if threads is not None else ()))]

    def _extra(self, one: Extra) -> Json:
        if one.name not in self.extra:
            self.extra[one.name] = len(self.materials)
            rough = {"metallicFactor": 0.0, "roughnessFactor": one.roughness}
            self.materials.append({"name": one.name, "doubleSided": True, "pbrMetallicRoughness": rough})
        attributes = {
            "POSITION": self.buffer.add(one.vertices, FLOAT, "VEC3", VERTICES, bounds(one.vertices)),
            "NORMAL": self.buffer.add(one.normals, FLOAT, "VEC3", VERTICES),
            "COLOR_0": self.buffer.add(one.colour, FLOAT, "VEC3", VERTICES),
        }
        indices = self._indices(one.triangles, len(one.vertices))
        return {"attributes": attributes, "indices": indices, "material": self.extra[one.name]}

    def morph(self) -> None:
        """Add one mesh with a target per further stage, and weights that fade from each to the next."""
        surfaces = iter(self.sequence)
        first = next(surfaces)
        # fields belong to stages, and a target has none
        primitives = self._primitives(first._replace(fields={}))
        base, straight = first.vertices[self.copies], first.normals()[self.copies]
        targets: list[Json] = []
        for surface in surfaces:
            moved, turned = surface.vertices[self.copies] - base, surface.normals()[self.copies] - straight
            targets.append(
                {
                    "POSITION": self.buffer.add(moved, FLOAT, "VEC3", VERTICES, bounds(moved)),
                    "NORMAL": self.buffer.add(turned, FLOAT, "VEC3", VERTICES),
                }
            )
        count = len(targets)
        for primitive in primitives:
            primitive["targets"] = targets
        names = [f"{stage:g}" for stage in self.sequence.stages[1:]]
        self.meshes.append(
            {
                "name": self._name,
                "primitives": primitives,
                "weights": [0.0] * count,
                "extras": {"targetNames": names},
            }
        )
        self.nodes.append({"mesh": 0, "name": self._name, "extras": self.sequence.about})
        weights = np.eye(count + 1, dtype=np.float32)[:, 1:]
        times = self._times[:-1].astype(np.float32)
        self._animate([(0, "weights", times, weights.ravel(), "SCALAR")], "LINEAR")

    def switch(self) -> None:
        """Add a mesh and a node per stage, and scales that show one at a time."""
        count = len(self.sequence)
        root: Json = {"name": self._name, "extras": self.sequence.about}
        self.nodes.append(root)
        if count > 1:
            root["children"] = list(range(1, count + 1))
        channels = []
        for number, surface in enumerate(self.sequence):
            name = f"{self._name} {surface.stage:g}"
            self.meshes.append({"name": name, "primitives": self._primitives(surface)})
            if count == 1:
                root["mesh"] = 0
                return
            self.nodes.append({"mesh": number, "name": name, "scale": [float(number == 0)] * 3})
            keys = sorted({0, number, number + 1})
            shown = np.array([[float(key == number)] * 3 for key in keys], np.float32)
            if number + 1 == count:
                shown[-1] = 1  # the last stage stays
            channels.append((number + 1, "scale", self._times[keys].astype(np.float32), shown, "VEC3"))
        self._animate(channels, "STEP")

    def _animate(self, channels: list[tuple[int, str, np.ndarray, np.ndarray, str]], way: str) -> None:
        samplers: list[Json] = []
        targets: list[Json] = []
        for node, path, times, values, kind in channels:
            at = self.buffer.add(times, FLOAT, "SCALAR", None, bounds(times[:, None]))
            samplers.append({"input": at, "output": self.buffer.add(values, FLOAT, kind), "interpolation": way})
            targets.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": path}})
        self.animations.append({"name": "stages", "samplers": samplers, "channels": targets})

    def _textured(self, surface: Surface) -> int:
        """Add a stage's colours and roughness as pictures, a material of each name, and return the first's number."""
        look = looked(self.sequence, surface, self.options.pixels, self.options.full)
        base = {"index": self._image(look.colour)}
        pbr: Json = {"baseColorTexture": base, "metallicFactor": 0.0, "roughnessFactor": 0.6}
        more: Json = {}
        if look.roughness is not None:
            rough = np.zeros((*look.roughness.shape, 3), np.uint8)  # green is roughness, blue is metal
            rough[..., 1] = look.roughness
            pbr |= {"metallicRoughnessTexture": {"index": self._image(rough)}, "roughnessFactor": 1.0}
        if look.normal is not None:
            more["normalTexture"] = {"index": self._image(look.normal)}
        said = matter(self.sequence) if self.options.full else None
        if said is not None and said.sheen > 0 and surface.stage == self.sequence.stages[0]:
            # down is on fresh skin alone, and a number is for all of it
            self.extensions.add("KHR_materials_sheen")
            sheen = {"sheenColorFactor": [0.5 * said.sheen] * 3, "sheenRoughnessFactor": 0.5}
            more["extensions"] = {"KHR_materials_sheen": sheen}
        first = len(self.materials)
        for name, _ in self.sequence.materials:
            named = {"name": f"{name or 'skin'} {surface.stage:g}", **self.sides}
            self.materials.append({**named, "pbrMetallicRoughness": pbr, **more})
        return first

    def _image(self, pixels: np.ndarray) -> int:
        from PIL import Image

        out = io.BytesIO()
        Image.fromarray(pixels).save(out, "PNG")
        self.images.append({"bufferView": self.buffer.raw(out.getvalue()), "mimeType": "image/png"})
        return len(self.images) - 1

    def bytes(self) -> bytes:
        """Return the whole file."""
        document: Json = {
            "asset": {"version": "2.0", "generator": GENERATOR},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": self.materials,
        }
        if self.images:
            document["images"] = self.images
            document["samplers"] = [{"wrapS": 10497, "wrapT": 33071}]  # around in azimuth, not across the poles
            document["textures"] = [{"source": i, "sampler": 0} for i in range(len(self.images))]
        if self.extensions:
            document["extensionsUsed"] = sorted(self.extensions)
        if self.animations:
            document["animations"] = self.animations
        return pack(document, self.buffer)
