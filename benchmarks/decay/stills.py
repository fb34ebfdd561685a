"""Stills of each preset at four ages, rendered by Blender's Cycles from the exported USD and GLB, as one contact sheet.

    python -m benchmarks.decay.stills SHEET.png PYTHON_WITH_BPY [folder] [preset ...]

Each fruit is solved by `wizen solve` (body and skin) and written by `wizen export --full`: a USDZ for each age, as
Blender shows one picture of a file whose pictures change, and one GLB. The other Python, which has `bpy`, renders.
Rows are presets, columns ages; the last age comes once more, from the GLB.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from service import cli

#: Ages [day] by preset: fresh, seen, spread, at its end.
AGES = {
    "apple": (0, 8, 14, 22),
    "apple-neofabraea": (0, 8, 16, 30),
    "orange": (0, 5, 9, 14),
    "peach": (0, 2, 3, 6),
    "pear": (0, 8, 14, 22),
    "tomato": (0, 1, 2, 5),
}
#: What is not as the preset has it: a room in which the green mould thrives.
_SET = {"orange": ("--set", "humidity=85")}
_PIXELS, _SAMPLES = 180, 10
#: Wounds that the camera sees.
_WOUNDS = 'wounds=[{"colatitude":60,"azimuth":70},{"colatitude":110,"azimuth":140}]'


def solved(preset: str, folder: Path) -> list[Path]:
    """Return a USDZ for each of a preset's ages, and its GLB, written by the command line."""
    run = folder / f"{preset}.h5"
    usd = [folder / f"{preset}-{age}.usdz" for age in AGES[preset]]
    glb = folder / f"{preset}.glb"
    said = ["--set", "body=quasi-static", "--set", "skin={}", "--set", _WOUNDS, *_SET.get(preset, ())]
    if not run.exists():
        stages = ",".join(map(str, AGES[preset]))
        wizen("solve", "decay", "--preset", preset, *said, "--stages", stages, "--out", str(run))
    for age, path in zip(AGES[preset], usd, strict=True):
        if not path.exists():
            wizen("export", str(run), "--full", "--stage", str(age), "--out", str(path))
    if not glb.exists():
        wizen("export", str(run), "--full", "--out", str(glb))
    return [*usd, glb]


def wizen(*words: str) -> None:
    """Run the command in this process: what it imports and compiles is there the next time."""
    before, sys.argv = sys.argv, ["wizen", *words]
    try:
        cli.main()
    except SystemExit as ended:
        if ended.code:
            raise
    finally:
        sys.argv = before


def rendered(sources: list[Path], preset: str, python: str, folder: Path) -> list[Path]:
    """Return pictures of files, rendered in another Python."""
    stem = folder / f"{preset}-still"
    script = Path(__file__).with_name("_cycles.py")
    said = [str(stem), str(_PIXELS), str(_SAMPLES), str(len(AGES[preset]))]
    subprocess.run([python, str(script), *said, *map(str, sources)], check=True)
    return [stem.with_name(f"{stem.name}-{k}.png") for k in range(len(sources))]


def main(out: str, python: str, folder: str = "stills", *presets: str) -> None:
    where = Path(folder)
    where.mkdir(parents=True, exist_ok=True)
    rows = []
    for preset in presets or tuple(AGES):
        pictures = rendered(solved(preset, where), preset, python, where)
        rows.append(np.hstack([np.asarray(Image.open(path).convert("RGB")) for path in pictures]))
    Image.fromarray(np.vstack(rows)).save(out, optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
