"""Results as files: the suffix of `--out` says how. Files appear whole or not at all.

Higher floors add formats (`sweeps.formats`); nothing here knows of meshes for other programs.
"""

from __future__ import annotations

import io
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from solver.contract import Solver, Worn, dryness
from solver.lattice import closed_lattice
from store import seal, shards
from store.shape import Shape
from store.surfaces import apart, spectra

from .errors import InvalidOption
from .formats import Encoder, Made, added, told

if TYPE_CHECKING:
    from .pictures.sheet import Panel

__all__ = ["check_suffix", "fields_for", "of_result", "panels", "save", "suffixes", "triangles"]

#: Whole numbers of a stage that say how its run went, not what the surface is like.
_WENT = ("converged", "iterations")
#: Pictures of meshes leave out what is farther from the middle than this, over the radius that they show.
_BEYOND = 1.6


def _npz(made: Made) -> bytes:
    """Return a run's variables by name; of looked-up shapes arrays whose first axis are the stages, and as `about` what
    other files say of each, as JSON texts.
    """
    out = io.BytesIO()
    if made.run is not None:
        arrays: dict[str, Any] = {str(name): made.run[name].values for name in made.run.variables}
        np.savez_compressed(out, **arrays)
        return out.getvalue()
    first = made.shapes[0]
    found: dict[str, Any] = {"stage": np.array([shape.stage for shape in made.shapes])}
    if first.poles is not None:  # a part is no closed mesh
        # along its diagonals crossings are counted; the poles are the last two points
        found["triangles"] = closed_lattice(len(first.colatitude)).astype(np.int32)
        found["volume"] = np.array([np.nan if shape.volume is None else shape.volume for shape in made.shapes])
    found |= {"colatitude": first.colatitude, "azimuth": first.azimuth}
    for name in ("position", "poles"):
        stages = [getattr(shape, name) for shape in made.shapes]
        if all(values is not None for values in stages):
            found[name] = np.stack(stages)
    found["about"] = np.array([json.dumps(told(shape, made), sort_keys=True) for shape in made.shapes])
    np.savez_compressed(out, **found)
    return out.getvalue()


def _png(made: Made) -> bytes:
    if made.cut is not None and made.run is not None and "," in made.cut:
        from . import opened

        return opened.picture(made.run, opened.parsed(made.cut), title=made.title, symbol=made.stage_symbol)
    if made.cut is not None and made.run is not None:
        from .pictures import section

        return section.picture(made.run, section.plane(made.cut), title=made.title, symbol=made.stage_symbol)
    from .pictures.sheet import sheet

    stages = [shape.stage for shape in made.shapes] if made.shapes or made.run is None else made.run["stage"].values
    labels = [f"{made.stage_symbol} = {float(stage):g}" for stage in stages]
    return sheet([panels(made)], title=made.title, column_labels=labels, pixels=360)


def panels(made: Made) -> list[Panel]:
    """Return what is to be written as panels of a picture, one for each stage, in the colours of a run."""
    from .pictures import colours, standing
    from .pictures.sheet import Panel

    if made.run is not None and "mesh_position" in made.run and "position" not in made.run:
        return triangles(made.run)
    skins = [None if made.run is None else colours.of_run(made.run, i) for i in range(len(made.shapes))]
    places = [(shape.position, shape.poles) for shape in made.shapes]
    fur = [None] * len(skins) if made.run is None else standing.on_lattices(made.run, places)
    return [
        Panel(shape.position, shape.poles, worn=_worn(made, shape.stage))
        if skin is None
        else Panel(shape.position, shape.poles, colour=skin.colour, roughness=skin.roughness, more=more)
        for shape, skin, more in zip(made.shapes, skins, fur, strict=True)
        if shape.position is not None
    ]


def _worn(made: Made, stage: float) -> Worn | None:
    """Return the skin of a surface that has no colours of its own."""
    from .pictures import colours

    if made.run is not None:
        return colours.worn(made.run, stage)
    return None if made.shade is None else made.shade.worn(dryness(stage, made.reach))


def triangles(run: xr.Dataset) -> list[Panel]:
    """Return the meshes of a run's stages as panels, moved and scaled alike so that all together fill the picture.

    A run whose attribute `view` names a middle and a radius shows that part of space instead.
    """
    from solver import meshes

    from .pictures import colours, standing
    from .pictures.sheet import Panel

    frames = [meshes.frame(run, i) for i in range(run.sizes["stage"])]
    points = np.concatenate([frame.vertices for frame in frames])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    size = float(np.linalg.norm(points - middle, axis=1).max()) or 1.0
    if "view" in run.attrs:
        *middle, size = np.asarray(run.attrs["view"], float)
    up = str(run.attrs.get("up", "y"))
    found = []
    grown = standing.on_meshes(run, frames)
    for index, (frame, more) in enumerate(zip(frames, grown, strict=True)):
        skin = colours.painted(run, index, frame.fields)
        paint, rough = (None, None) if skin is None else (skin.colour, skin.roughness)
        place = (frame.vertices - np.asarray(middle)) / size
        away = np.linalg.norm(place, axis=1, keepdims=True)
        # what is far outside would only stretch the shadow
        seen = frame.triangles[(away[frame.triangles, 0] < _BEYOND).all(axis=1)]
        if more is not None:
            more = more._replace(vertices=(more.vertices - np.asarray(middle)) / size)
        place *= np.minimum(1, _BEYOND / np.maximum(away, 1e-12))
        found.append(Panel(place, None, "", paint, seen, up, roughness=rough, more=more))
    return found


def _json(made: Made) -> bytes:
    return (json.dumps(made.document, indent=2, allow_nan=False) + "\n").encode()


def _csv(made: Made) -> bytes:
    from . import curves

    assert made.run is not None
    return curves.as_csv(made.run)


def _svg(made: Made) -> bytes:
    from . import curves

    assert made.run is not None
    return curves.as_svg(made.run)


#: What is made of numbers by stage.
_CURVES = {".csv": Encoder((), _csv, runs=True), ".svg": Encoder((), _svg, runs=True)}
_OURS = {
    ".json": Encoder((), _json),
    ".npz": Encoder(("position",), _npz),
    ".png": Encoder(("position",), _png),
}


def suffixes(run: bool) -> dict[str, Encoder | None]:
    """Return what can be written, by suffix; `.h5` (no encoder) holds whole runs only."""
    known: dict[str, Encoder | None] = {".h5": None, **_CURVES} if run else {}
    more = {s: encoder for s, encoder in added().items() if s not in _OURS and (run or not encoder.runs)}
    return {**known, **_OURS, **more}


def check_suffix(path: Path, run: bool, stages: int) -> None:
    """Refuse, before any work, a file that could not be written after it.

    Raises:
        InvalidOption: unknown suffix, several stages for a format of one, a directory in the way.

    """
    known = suffixes(run)
    if path.suffix.lower() not in known:
        raise InvalidOption(
            f"--out {path}: cannot write {path.suffix or 'no suffix'!r}.", f"Known: {', '.join(known)}."
        )
    encoder = known[path.suffix.lower()]
    if encoder is not None and encoder.single and stages > 1 and not (run and encoder.whole):
        raise InvalidOption(
            f"--out {path}: {path.suffix} holds one stage, not {stages}.",
            "Give one stage with --stages, or write .npz or .png.",
        )
    if path.is_dir():
        raise InvalidOption(f"--out {path} is a directory.", "Name a file in it.")
    if not path.absolute().parent.is_dir():
        raise InvalidOption(f"--out {path}: there is no directory {path.parent}.", "Create it first.")


def fields_for(
    path: Path | None, run: bool, solver: Solver | None = None, asked: Sequence[str] = ()
) -> tuple[str, ...]:
    """Return the fields that writing `path` needs, of a table's shapes or of a solver; none if nothing is written.

    Where the mesh that was solved is among the fields `asked` for, it is what is written.

    Raises:
        InvalidOption: the format holds the fruit's lattice only, and the solver has none.

    """
    encoder = suffixes(run).get(path.suffix.lower()) if path is not None else None
    if encoder is None:
        return ()
    known = ("position",) if solver is None else solver.fields
    if ("position" in known and "mesh_position" not in asked) or "position" not in encoder.fields:
        return encoder.fields
    if encoder.single and encoder.whole is None:
        raise InvalidOption(
            f"--out {path}: a run on a mesh of its own is not written as {path.suffix if path else ''} at once.",
            f"Write .h5, then: wizen export FILE.h5 --out FILE{encoder.later}.",
        )
    # what gives the mesh its colours comes along
    coloured = tuple(name for name in solver.looks.layers if name in known) if solver else ()
    return (*("mesh_position" if name == "position" else name for name in encoder.fields), *coloured)


def save(path: Path, made: Made) -> None:
    """Write a result.

    Raises:
        StorageFull: the disk is full; nothing half-written stays.
        InvalidOption: the format holds the fruit's lattice only, and the run has a mesh of its own.

    """
    encoder = suffixes(made.run is not None)[path.suffix.lower()]
    whole = encoder.whole if encoder is not None and made.run is not None else None
    if encoder is not None and encoder.single and "position" in encoder.fields and not made.shapes and whole is None:
        raise InvalidOption(
            f"--out {path}: a run on a mesh of its own is not written as {path.suffix} at once.",
            f"Write .h5, then: wizen export FILE.h5 --out FILE{encoder.later}.",
        )
    if encoder is None:
        assert made.run is not None
        shards.write(path, made.run, made.key)
    elif whole is not None and made.run is not None and len(made.shapes) != 1:
        seal.publish(path, whole(made.run))
    else:
        seal.publish(path, encoder.encode(made))


def of_result(result: xr.Dataset, params: Mapping[str, float], index: int) -> Shape:
    """Return one stage of a run with the field `position` as a shape; its poles come from the spectrum, and its
    `crossings` are counted with them: a run's own `lattice_crossings` are of the lattice closed by its rings' means.

    What was relaxed from a table is no stored run of it; how near one lies is not known here.
    """
    is_relaxed = result.attrs.get("path") == "relaxed"
    position = result["position"].isel(stage=index).values
    poles = spectra.poles(spectra.spectrum(position))
    numbers = {
        str(name): float(variable[index])
        for name, variable in result.data_vars.items()
        if variable.dims == ("stage",) and variable.dtype.kind in "fiu" and name not in _WENT
    }
    return Shape(
        colatitude=result["colatitude"].values,
        azimuth=result["azimuth"].values,
        position=position,
        displacement=result["displacement"].isel(stage=index).values if "displacement" in result else None,
        poles=poles,
        stage=float(result["stage"][index]),
        parameters=params,
        descriptors=numbers,
        weights={},
        nearest=math.nan if is_relaxed else 0.0,
        exact=not is_relaxed,
        converged=bool(result["converged"][index]),
        crossings=apart.crossings(position, poles),
        table="",
        tier="relaxed" if is_relaxed else "run",
    )
