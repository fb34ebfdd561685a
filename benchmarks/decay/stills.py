"""Stills of each preset at four ages, rendered by Blender's Cycles from the exported USD and GLB, as one contact sheet.

    python -m benchmarks.decay.stills SHEET.png PYTHON_WITH_BPY [folder] [preset ...]

Each fruit is solved and written by `wizen solve` (preview quality, body and skin) and rendered by the other Python, in
which `bpy` is installed. Rows are presets, columns ages; the last age comes once more, from the GLB.
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
    "orange": (0, 4, 7, 12),
    "peach": (0, 2, 3, 6),
    "pear": (0, 8, 14, 22),
    "tomato": (0, 1, 2, 5),
}
_PIXELS, _SAMPLES, _SHOWN = 160, 12, 132
#: Wounds that the camera sees.
_WOUNDS = 'wounds=[{"colatitude":60,"azimuth":70},{"colatitude":110,"azimuth":140}]'


def solved(preset: str, folder: Path) -> tuple[Path, Path]:
    """Return USD and GLB of a preset's ages, written by the command line."""
    run, usd, glb = (folder / f"{preset}.{suffix}" for suffix in ("h5", "usdc", "glb"))
    stages = ",".join(map(str, AGES[preset]))
    said = ["--set", "body=quasi-static", "--set", "skin={}", "--set", _WOUNDS, "--quality", "preview"]
    if usd.exists() and glb.exists():
        return usd, glb  # to look at them in another light
    wizen("solve", "decay", "--preset", preset, *said, "--stages", stages, "--out", str(run))
    for path in (usd, glb):
        wizen("export", str(run), "--out", str(path))
    return usd, glb


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


def rendered(source: Path, ages: int, python: str, folder: Path) -> list[Path]:
    """Return pictures of the stages of a file, rendered in another Python."""
    stem = folder / f"{source.stem}-{source.suffix[1:]}"
    script = Path(__file__).with_name("_cycles.py")
    subprocess.run([python, script, source, stem, str(ages), str(_PIXELS), str(_SAMPLES)], check=True)
    found = [stem.with_name(f"{stem.name}-{k}.png") for k in range(ages)]
    return found[-1:] if source.suffix == ".glb" else found


def main(out: str, python: str, folder: str = "stills", *presets: str) -> None:
    where = Path(folder)
    where.mkdir(parents=True, exist_ok=True)
    rows = []
    for preset in presets or tuple(AGES):
        usd, glb = solved(preset, where)
        ages = len(AGES[preset])
        pictures = [*rendered(usd, ages, python, where), *rendered(glb, ages, python, where)]
        rows.append(np.hstack([np.asarray(Image.open(path).convert("RGB")) for path in pictures]))
    Image.fromarray(np.vstack(rows)).resize((5 * _SHOWN, len(rows) * _SHOWN)).save(out, optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
