"""What others' checkers say of the files that scenes, look-ups and runs are written as.

    python -m benchmarks.scenes.validators --gltf FOLDER --blender PYTHON

FOLDER is where `npm install gltf-validator` was run (Khronos' glTF validator, which needs node), PYTHON one that has
bpy. GLBs go through Khronos' validator, USD files through `UsdUtils.ComplianceChecker`, or the validators that took its
place; usd-core's wheel is built without MaterialX, so that its complaints about MaterialX's own node names are counted
apart, and so is a `metersPerUnit` that is left out because nobody knows how large a growth is. Without --gltf or
--blender these rows are left out. The orange is rendered by Cycles from its GLB and from its USD with one camera and
light; the difference is the mean over the fruit's pixels, over their mean brightness.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from benchmarks.figures import ROOT, Sheet

_ASK = """
const validator = require("gltf-validator");
const data = require("fs").readFileSync(process.argv[1]);
validator.validateBytes(new Uint8Array(data), { maxIssues: 0 }).then((found) => {
  const kinds = {};
  for (const one of found.issues.messages) kinds[one.code] = (kinds[one.code] ?? 0) + 1;
  console.log(JSON.stringify({ ...found.issues, messages: undefined, kinds, version: found.validatorVersion }));
});
"""
_RENDER = ROOT / "tests" / "service" / "blender" / "render.py"
_ORANGE = "solve decay --preset orange --quality preview --stages 0,6 --out orange.h5"
_TWIG = "solve wood --preset twig --quality preview --stages 0.01,0.02 --out twig.h5"
_MUSHROOM = "solve growth --preset mushroom --quality preview --stages 0.25,0.5 --out mushroom.h5"
_MADE = (
    (_ORANGE, _TWIG, _MUSHROOM),
    (
        ("a bowl, compressed", "scene {bowl} --out bowl.glb"),
        ("a bowl", "scene {bowl} --plain --out plain.glb"),
        ("a bowl", "scene {bowl} --out bowl.usdc"),
        ("a bowl that dries", "scene drying.toml --out drying.glb"),
        ("a bowl that dries", "scene drying.toml --out drying.usdc"),
        ("a raisin", "query --preset raisin --stages 0.25 --out raisin.glb"),
        ("an orange over six days, with pictures", "export orange.h5 --textures 256 --out film.glb"),
        ("an orange on day 6", "export orange.h5 --stage 6 --out orange.glb"),
        ("an orange on day 6", "export orange.h5 --stage 6 --out orange.usdc"),
        ("an orange over six days, with pictures", "export orange.h5 --textures 256 --out film.usdz"),
        ("a mushroom that grows", "export mushroom.h5 --out mushroom.usdc"),
        ("a twig that breaks", "export twig.h5 --out twig.usdc"),
    ),
)


def _wizen(folder: Path, words: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "service.cli", *words.split()],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    if done.returncode:
        sys.exit(f"wizen {words}: {done.stderr[-600:]}")


def khronos(file: Path, folder: Path) -> dict[str, Any]:
    """Return numbers of errors, warnings, infos and hints, and how often which."""
    done = subprocess.run(["node", "-e", _ASK, str(file)], cwd=folder, capture_output=True, text=True, check=True)
    said: dict[str, Any] = json.loads(done.stdout)
    return said


def usd(file: Path) -> dict[str, Any]:
    """Return what USD's own rules find, MaterialX's node names apart."""
    from pxr import Usd, UsdUtils

    if hasattr(UsdUtils, "ComplianceChecker"):
        checker = UsdUtils.ComplianceChecker()
        checker.CheckCompliance(str(file))
        found = [*checker.GetErrors(), *checker.GetFailedChecks()]
        by = "UsdUtils.ComplianceChecker"
    else:
        from pxr import UsdValidation

        registry = UsdValidation.ValidationRegistry()
        context = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators())
        found = [error.GetMessage() for error in context.Validate(Usd.Stage.Open(str(file)))]
        by = "UsdValidation"
    ours = [text.replace(str(file.parent), "") for text in found if "ND_" not in text]
    sizeless = sum("metersPerUnit" in text for text in ours)
    more = {"materialx": len(found) - len(ours), "sizeless": sizeless, "by": by}
    return {"numErrors": len(ours) - sizeless, "found": ours, **more}


def rendered(python: str, folder: Path, *files: Path) -> float:
    """Return by how much two files differ in Cycles, over the fruit's brightness."""
    subprocess.run([python, str(_RENDER), str(folder), *map(str, files)], check=True, capture_output=True)
    one, other = (np.asarray(Image.open(f"{file}.png").convert("RGB"), float) / 255 for file in files)
    fruit = one.std(axis=-1) > 0.02
    if not 0.2 < fruit.mean() < 0.7:
        sys.exit("the picture shows no fruit")
    return float(np.abs(one - other)[fruit].sum() / one[fruit].sum())


def main() -> None:
    """Make the files, ask the checkers, and keep what they say."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--gltf", type=Path, help="folder with node_modules/gltf-validator")
    parser.add_argument("--blender", help="a Python that has bpy")
    asked = parser.parse_args()
    sheet = Sheet("scenes-validators", ["what", "file", "size", "checked by", "errors", "warnings", "else"])
    bowl = ROOT / "examples" / "scenes" / "bowl.toml"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        moving = bowl.read_text().replace("stage = 0.3", "curve = [[0, 0.0], [1, 0.15], [2, 0.3]]", 1)
        (folder / "drying.toml").write_text(moving)
        for words in _MADE[0]:
            _wizen(folder, words)
        for what, words in _MADE[1]:
            file = folder / words.split()[-1]
            is_gltf = file.suffix == ".glb"
            if is_gltf and asked.gltf is None:
                continue
            _wizen(folder, words.format(bowl=bowl))
            said = khronos(file, asked.gltf) if is_gltf else usd(file)
            by = f"Khronos {said['version']}" if is_gltf else said["by"]
            kinds = ", ".join(f"{n} {code}" for code, n in said.get("kinds", {}).items())
            more = kinds or ", ".join(
                f"{said[name]} {text}"
                for name, text in (("materialx", "MaterialX names"), ("sizeless", "without metersPerUnit"))
                if said.get(name)
            )
            cells = [what, file.suffix, f"{file.stat().st_size / 1e6:.2f} MB", by, said["numErrors"]]
            sheet.add([*cells, said.get("numWarnings", ""), more], what=what, file=file.name, **said)
        if asked.blender:
            off = rendered(asked.blender, folder, folder / "orange.glb", folder / "orange.usdc")
            cells = ["an orange, rendered", ".glb beside .usdc", "", "Cycles (bpy)", f"{100 * off:.2f} % apart", "", ""]
            sheet.add(cells, what="rendered", apart=off)
    sheet.keep()


if __name__ == "__main__":
    main()
