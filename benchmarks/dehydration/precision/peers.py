"""Other finite-element codes on the common sphere, each run by its script in its own environment, where there is one.

A peer is looked for, in this order: at the path in `WIZEN_PEER_<NAME>` (a Python interpreter; for CalculiX the
program), in `$WIZEN_PEERS/<name>/bin/python` (`out/peers` unless set), and on the path of the system.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .record import ROOT, Row, answer, child

Size = tuple[int, int, int]
#: na, nc, ne of `peers/case.py`; the quadratic ones are those of our own implicit solver.
LINEAR: tuple[Size, ...] = ((4, 5, 1), (6, 7, 2), (9, 10, 2), (12, 14, 3))
QUADRATIC: tuple[Size, ...] = ((2, 3, 1), (3, 4, 1), (4, 5, 1), (6, 6, 1))


@dataclass(frozen=True)
class Peer:
    """One code: what its interpreter must import, or that it is a program, and how it is installed."""

    name: str
    imports: str
    meshes: tuple[Size, ...]
    install: str
    program: str = ""


PEERS = (
    Peer("felupe", "felupe", LINEAR, "pip install 'felupe[all]' pypardiso"),
    Peer("calculix", "numpy", LINEAR, "apt-get install calculix-ccx", program="ccx"),
    Peer("ngsolve", "ngsolve", QUADRATIC, "pip install ngsolve"),
    Peer("dolfinx", "dolfinx", QUADRATIC, "apt-get install python3-dolfinx python3-scipy g++ pkg-config"),
)


def find(peer: Peer) -> tuple[str | None, str]:
    """Return the peer's interpreter or program, or why there is none."""
    named = os.environ.get(f"WIZEN_PEER_{peer.name.upper()}", "")
    if peer.program:
        place = shutil.which(named or peer.program)
        return place, "" if place else f"no {named or peer.program} found ({peer.install})"
    folder = Path(os.environ.get("WIZEN_PEERS", ROOT / "out" / "peers"))
    # the system's own interpreter, not the one of this environment
    outside = os.pathsep.join(
        part for part in os.environ.get("PATH", os.defpath).split(os.pathsep) if Path(part) != Path(sys.prefix, "bin")
    )
    likely = [named] if named else [str(folder / peer.name / "bin" / "python"), shutil.which("python3", path=outside)]
    likely += [] if named else [shutil.which("python3", path=os.defpath)]
    for place in likely:
        if place and Path(place).exists() and not child([place, "-c", f"import {peer.imports}"], limit=60.0)[2]:
            return place, ""
    return None, f"no interpreter that imports {peer.imports} ({peer.install})"


def solve(peer: Peer, place: str, theta: float, size: Size, limit: float) -> Row:
    """Run one mesh and compare its nodes with the references, here."""
    from ..sphere_ours import KAPPA_RATIO, errors

    script = ROOT / "benchmarks" / "peers" / f"{peer.name}_sphere.py"
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "nodes.npz")
        interpreter, program = (sys.executable, ["--program", place]) if peer.program else (place, [])
        command = [interpreter, str(script), "--theta", str(theta), "--mesh", ",".join(map(str, size))]
        row = answer([*command, "--out", str(out), *program], limit=limit)
        if "failed" in row:
            return row
        with np.load(out) as nodes:
            return {**row, **errors(nodes["fresh"], nodes["deformed"], theta, KAPPA_RATIO)}
