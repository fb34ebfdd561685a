"""PyElastica beside our rods, in one run: python -m benchmarks.wood.peer PYTHON_WITH_PYELASTICA.

Free rods, no bonds: CPU time of a vertex and step, and the tip of a cantilever against the elastica. PyElastica's rods
shear and twist besides; ours are timed with and without twist.
"""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import numpy as np
from scipy.integrate import solve_bvp

from benchmarks.figures import Sheet
from solver.contract import Need
from solver.wood import SOLVER

from .__main__ import per_step

#: One rod: length, radius [m], modulus [Pa], density [kg/m3], elements; end load over EI / L^2.
_ROD = {"length": 0.15, "radius": 0.002, "modulus": 1e10, "density": 600.0, "load": 1.0}
_ELEMENTS = (10, 20, 40)
_ROUNDS = 3
_PEER = """
import importlib.metadata, json, sys, time, numpy as np, elastica as ea
g = json.loads(sys.argv[1])
class Sim(ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Damping): pass
L, r, E, rho = g["length"], g["radius"], g["modulus"], g["density"]
EI = E * np.pi * r**4 / 4
def build(rods, n, load, damping):
    s, made = Sim(), []
    for i in range(rods):
        rod = ea.CosseratRod.straight_rod(n, np.array([0.0, 2.5 * r * i, 0.0]), np.array([1.0, 0, 0]),
            np.array([0.0, 0, 1.0]), L, r, rho, youngs_modulus=E, shear_modulus=E / 2.6)
        s.append(rod); made.append(rod)
        s.constrain(rod).using(ea.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,))
        s.add_forcing_to(rod).using(ea.EndpointForces, np.zeros(3), np.array([0, 0, -load]), ramp_up_time=0.01)
        if damping:
            s.dampen(rod).using(ea.AnalyticalLinearDamper, uniform_damping_constant=damping, time_step=g["step"])
    s.finalize()
    return s, made
out = {"version": importlib.metadata.version("pyelastica")}
s, made = build(100, 29, 0.0, 0.0)
st, t = ea.PositionVerlet(), 0.0
for _ in range(3): t = st.step(s, t, 1e-7)
best = 9.0
for _ in range(4):
    c = time.process_time()
    for _ in range(100): t = st.step(s, t, 1e-7)
    best = min(best, (time.process_time() - c) / 100)
out["ns"] = best / 3000 * 1e9
out["tips"] = []
for n in g["elements"]:
    # its elements turn about themselves: the radius bounds the step as well as their length
    g["step"] = 0.5 * min(L / n, r) / (E / rho) ** 0.5
    s, made = build(1, n, g["load"] * EI / L**2, 150.0)
    st, t = ea.PositionVerlet(), 0.0
    c = time.process_time()
    for _ in range(int(0.12 / g["step"])): t = st.step(s, t, g["step"])
    out["tips"].append([float(made[0].position_collection[0, -1]), float(made[0].position_collection[2, -1]),
        time.process_time() - c])
print(json.dumps(out))
"""


def _exact(load: float) -> np.ndarray:
    """Return the tip (2,) over the length: Euler's elastica under `load` P L^2 / EI."""
    s = np.linspace(0, 1, 201)
    found = solve_bvp(
        lambda s, y: np.array([y[1], -load * np.cos(y[0])]), lambda a, b: np.array([a[0], b[1]]), s, np.zeros((2, 201))
    )
    fine = np.linspace(0, 1, 20_001)
    angle = found.sol(fine)[0]
    return np.array([np.trapezoid(np.cos(angle), fine), -np.trapezoid(np.sin(angle), fine)])


def _ours(elements: int) -> float:
    rod = np.pi * _ROD["radius"] ** 4 / 4 * _ROD["modulus"]
    values: dict[str, Any] = {
        "rods": 1,
        "vertices": elements + 1,
        "unevenness": 0.0,
        "length": _ROD["length"],
        "radius": _ROD["radius"],
        "stiffness": _ROD["modulus"],
        "tip_load": (0.0, 0.0, -_ROD["load"] * rod / _ROD["length"] ** 2),
        "mode": "static",
        "fracture": "none",
        "grain": {"stiffness": 0.0, "strength": 0.0},
    }
    tip = SOLVER.solve(SOLVER.parse(values), Need(stages=(1.0,))).tip_position.values[0]
    return _off(tip[[0, 2]] / _ROD["length"])


def _off(tip: np.ndarray) -> float:
    """Return the tip's error over its deflection."""
    exact = _exact(_ROD["load"])
    return float(np.linalg.norm(tip - exact) / np.linalg.norm(exact - [1.0, 0.0]))


def _peer(python: str, elements: tuple[int, ...]) -> dict[str, Any]:
    asked = json.dumps({**_ROD, "elements": elements})
    said = subprocess.run([python, "-c", _PEER, asked], check=True, capture_output=True, text=True).stdout
    found: dict[str, Any] = json.loads(said.splitlines()[-1])
    return found


def speeds(python: str) -> None:
    """Time PyElastica and ours in turn: whatever else the machine does falls on all of them."""
    sheet = Sheet(
        "wood-peer", ("100 rods of 30 vertices", "CPU ns per vertex and step, run by run", "over ours, median"), "wood"
    )
    ways: dict[str, dict[str, Any]] = {"ours, twist": {"twist": True}, "ours": {}}
    ns: dict[str, list[float]] = {name: [] for name in ("PyElastica", *ways)}
    for _ in range(_ROUNDS):
        peer = _peer(python, ())
        ns["PyElastica"].append(peer["ns"])
        for name, extra in ways.items():
            vertices, _, seconds, _ = per_step(rods=100, vertices=30, reach=0.0, bend=0.005, **extra)
            ns[name].append(seconds / vertices * 1e9)
    for name, found in ns.items():
        ratio = float(np.median(np.divide(found, ns["ours"])))
        sheet.add(
            (name, ", ".join(f"{one:.0f}" for one in found), f"{ratio:.1f}"), code=name, ns=found, over_ours=ratio
        )
    sheet.keep(peer=peer["version"])


def tips(python: str) -> None:
    """Tell how far both codes' cantilevers are off the elastica."""
    head = ("elements", "error of the tip, PyElastica", "ours (`static`)", "CPU s of PyElastica, damped to rest")
    sheet, peer = Sheet("wood-peer-tip", head, "wood"), _peer(python, _ELEMENTS)
    for elements, (x, z, cpu) in zip(_ELEMENTS, peer["tips"], strict=True):
        off, ours = _off(np.array([x, z]) / _ROD["length"]), _ours(elements)
        sheet.add(
            (elements, f"{off:.1e}", f"{ours:.1e}", f"{cpu:.1f}"), elements=elements, peer=off, ours=ours, cpu_peer=cpu
        )
    sheet.keep(peer=peer["version"], load=_ROD["load"])


if __name__ == "__main__":
    speeds(sys.argv[1])
    tips(sys.argv[1])
