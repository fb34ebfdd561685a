"""The common case in CalculiX: C3D8 (B-bar), shrinkage as thermal expansion, its default solver and residual test."""

import os
import re
import resource
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from case import KAPPA_RATIO, LINEAR, MU_CORE, MU_SKIN, STONE, Answer, hexahedra

EXPANSION = 0.01


def deck(points: np.ndarray, cells: np.ndarray, core: np.ndarray, theta: float) -> str:
    lines = ["*NODE,NSET=ALL", *("%d,%.14g,%.14g,%.14g" % (i, *point) for i, point in enumerate(points, 1))]  # noqa: UP031
    for name, chosen in (("CORE", core), ("SKIN", ~core)):
        lines.append(f"*ELEMENT,TYPE=C3D8,ELSET={name}")
        lines += [",".join(map(str, [i + 1, *(cells[i] + 1)])) for i in np.flatnonzero(chosen)]
    stone = np.abs(np.linalg.norm(points, axis=1) - STONE) < 1e-9
    sets = {"STONE": stone} | {f"PLANE{d + 1}": (np.abs(points[:, d]) < 1e-10) & ~stone for d in range(3)}
    for name, chosen in sets.items():
        lines += [f"*NSET,NSET={name}", *(f"{i + 1}," for i in np.flatnonzero(chosen))]
    for name, mu, expansion in (("CORE", MU_CORE, EXPANSION), ("SKIN", MU_SKIN, 0.0)):
        lines += [f"*MATERIAL,NAME=M{name}", "*HYPERELASTIC,NEO HOOKE", f"{mu / 2},{2 / (KAPPA_RATIO * mu):.10g}"]
        lines += ["*EXPANSION,ZERO=0.", f"{expansion}", f"*SOLID SECTION,ELSET={name},MATERIAL=M{name}"]
    lines += ["*INITIAL CONDITIONS,TYPE=TEMPERATURE", "ALL,0.", "*BOUNDARY", "STONE,1,3"]
    lines += [f"PLANE{d},{d}" for d in (1, 2, 3)]
    lines += ["*STEP,NLGEOM,INC=200", "*STATIC,DIRECT", "1.,1.", "*TEMPERATURE", f"ALL,{(theta - 1) / EXPANSION}"]
    lines += ["*NODE PRINT,NSET=ALL", "U", "*END STEP"]
    return "\n".join(lines) + "\n"


def displacements(text: str, count: int) -> np.ndarray:
    moved = np.full((count, 3), np.nan)
    for line in text.splitlines():
        words = line.split()
        if len(words) == 4 and words[0].isdigit():
            moved[int(words[0]) - 1] = [float(word) for word in words[1:]]
    return moved


def main() -> None:
    answer = Answer()
    points, cells, core = hexahedra(answer.sizes, 1)
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "sphere.inp").write_text(deck(points, cells[:, LINEAR], core, answer.theta))
        answer.start()
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            [answer.program or "ccx", "-i", "sphere"], cwd=folder, capture_output=True, text=True,
            env={**os.environ, "CCX_NPROC_EQUATION_SOLVER": "1"},
        )  # fmt: skip
        answer.stop()
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        # the solver is another process; its user time is the work, reading and writing included
        answer.cpu = after.ru_utime - before.ru_utime
        if "Job finished" not in done.stdout or "*ERROR" in done.stdout:
            raise SystemExit(done.stdout.strip()[-200:])
        moved = displacements(Path(folder, "sphere.dat").read_text(), len(points))
    version = re.search(r"Version ([\w.]+)", done.stdout)
    answer.give(
        points, moved, newton=len(re.findall(r"iteration +\d+\n", done.stdout)), unknowns=points.size,
        version=version[1] if version else "", element="C3D8",
    )  # fmt: skip


main()
