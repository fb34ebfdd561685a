"""A clip opened in Blender: python -m benchmarks.wood.blender.clip PYTHON_WITH_BPY [PARAMS.toml].

`wizen solve` stores a run with its surface, `wizen export` makes a GLB of it, and a Python in which `bpy` is installed
opens that: how many meshes and frames there are, and how many bodies and pieces of wood are shown in the middle of
every stage. Bodies are told from wood by the file's colours. Beside it the run's own number of fragments; those that
are one vertex have no surface.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from benchmarks.decay.stills import wizen
from benchmarks.figures import ROOT, Sheet

_STAGES = (0.0, 0.015, 0.03, 0.045, 0.06)
_HEAD = ("stage [ms]", "frame", "meshes shown", "vertices", "bodies", "pieces of wood", "fragments of the run")


def written(params: Path, folder: Path) -> tuple[Path, Path]:
    """Return a stored run and its clip, made by the command line."""
    run, clip = folder / "run.h5", folder / "run.glb"
    stages = ",".join(map(str, _STAGES))
    wizen("solve", "wood", "--params", str(params), "--quality", "preview", "--stages", stages, "--out", str(run))
    wizen("export", str(run), "--out", str(clip))
    return run, clip


def opened(clip: Path, python: str) -> dict[str, Any]:
    """Return what Blender finds in a clip."""
    script = Path(__file__).with_name("inside.py")
    done = subprocess.run(
        [python, str(script), str(clip), str(len(_STAGES))],
        capture_output=True, text=True, check=True, cwd=clip.parent,
        env={"HOME": str(clip.parent), "PATH": "/usr/bin:/bin"},
    )  # fmt: skip
    found: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return found


def main(python: str, params: str = "examples/wood/splinter.toml") -> None:
    """Print a row for every stage."""
    sheet = Sheet("wood-clip", _HEAD, "wood")
    with tempfile.TemporaryDirectory() as name:
        run, clip = written(ROOT / params, Path(name))
        with h5py.File(run) as file:
            fragments = np.asarray(file["fragments"]).astype(int).ravel().tolist()
        size, seen = clip.stat().st_size, opened(clip, python)
    for stage, pieces, one in zip(_STAGES, fragments, seen["stages"], strict=True):
        sheet.add(
            (f"{1e3 * stage:g}", one["frame"], one["meshes"], one["vertices"], len(one["bodies"]), len(one["wood"]),
             pieces),
            stage=stage, fragments=pieces, **one,
        )  # fmt: skip
    sheet.keep(**{key: seen[key] for key in ("blender", "meshes", "frames")}, bytes=size, clip_of=params)


if __name__ == "__main__":
    main(*sys.argv[1:])
