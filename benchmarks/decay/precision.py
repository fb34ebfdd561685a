"""Error over time on one three-field colony: ours, the paper's way (explicit Euler on a grid), and py-pde.

    python -m benchmarks.decay.precision FILE.png [python with py-pde]

A round colony of rot (the apple's rates, even nutrient) spreads for two days; about its middle everything depends on
the distance alone, so a method of lines in one dimension (scipy's LSODA, conservative cells) is the reference for all.
In the plane: a square [-1.2, 1.2]^2, triangulated for us, a grid for the others. On the unit sphere: the geodesic mesh
for us; for the paper's way its flat map, with the colony's middle 40 degrees from the pole. Seconds are CPU time of one
thread, the least of five runs or of half a second of them, compilation and meshing left out. Euler's step is 0.9 of its
bound, py-pde's too; ours are as few as leave an error within an eighth of that of small steps, which is the mesh's.
Said as well: seconds over ours, which are interpolated to the same error.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from benchmarks.figures import Sheet
from solver.decay import SOLVER, DecayParams
from solver.decay.fields.layer import Layer, State
from solver.decay.fields.rates import Rates, daily
from solver.decay.surfaces.surface import geodesic, triangulated

Array = NDArray[np.float64]
DAYS, HALF, WIDE, TILT = 2.0, 1.2, 0.35, np.radians(40.0)
_RUNS, _AT_LEAST = 5, 0.5


def colony(r: Array, rates: Rates) -> Array:
    return rates.cap * np.clip(1 - (r / WIDE) ** 2, 0, None) ** 2


def reference(rates: Rates, round_: bool) -> tuple[Array, Array]:
    """Return distances and u + v at the end; round_: on the unit sphere rather than in the plane."""
    count = 900
    h = HALF / count
    r, edge = (np.arange(count) + 0.5) * h, np.arange(1, count) * h
    ring, rim = (np.sin(r), np.sin(edge)) if round_ else (r, edge)

    def slope(_: float, y: Array) -> Array:
        u, _v, n = y.reshape(count, 3).T
        x = np.clip(u, 0, rates.cap)
        phi = rates.mobility * x**2 * (0.5 - x / (3 * rates.cap))
        flux = rim * (n[1:] + n[:-1]) / 2 * np.diff(phi) / h
        feed = rates.feed * rim * np.diff(n) / h
        f = rates.consume * n * u / (1 + rates.half * n)
        a = rates.wither * u / ((1 + u / rates.a1) * (1 + n / rates.a2))

        def out(q: Array) -> Array:
            return np.diff(q, prepend=0.0, append=0.0) / (ring * h)

        return np.stack([out(flux) + rates.theta * f - a, a, out(feed) - f], axis=1).ravel()

    start = np.stack([colony(r, rates), 0 * r, 1 + 0 * r], axis=1).ravel()
    # unknowns of one place side by side: the Jacobian has a band of five on either side
    end = solve_ivp(slope, (0, DAYS), start, "LSODA", rtol=1e-6, atol=1e-9, lband=5, uband=5).y[:, -1]
    u, v, _ = end.reshape(count, 3).T
    return r, u + v


def gap(ours: Array, area: Array | float, r: Array, exact: tuple[Array, Array]) -> float:
    there = np.interp(r, *exact, right=0.0)
    return float(np.sqrt(np.sum(area * (ours - there) ** 2) / np.sum(area * there**2)))


def surface_of(n: int, round_: bool) -> tuple[Any, Array]:
    if round_:
        points, faces = geodesic(n)
        surface = triangulated(points, faces)
        return surface, np.arccos(np.clip(points @ [np.sin(TILT), np.cos(TILT), 0], -1, 1))
    x, y = np.meshgrid(*[np.linspace(-HALF, HALF, n)] * 2, indexing="ij")
    points = np.stack([x, 0 * x, y], axis=-1).reshape(-1, 3)
    at = np.arange(n * n).reshape(n, n)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[:-1, 1:], at[1:, 1:]
    faces = np.concatenate([np.stack([p.ravel() for p in t], axis=-1) for t in ((a, c, b), (b, c, d))])
    return triangulated(points, faces), np.hypot(x, y).ravel()


def least(run: Callable[[], Any]) -> tuple[Any, float]:
    """Return what a run gives, and the least of the CPU seconds that it takes."""
    took: list[float] = []
    while len(took) < _RUNS or sum(took) < _AT_LEAST:
        begun = time.process_time()
        found = run()
        took.append(time.process_time() - begun)
    return found, min(took)


def ours(rates: Rates, n: int, steps: int, round_: bool, exact: tuple[Array, Array]) -> dict[str, Any]:
    surface, r = surface_of(n, round_)
    one = np.ones(len(r))
    layer = Layer(surface, rates, one, one)
    state = State(colony(r, rates), 0 * one, one, 0.0)
    layer.advance(state, 1e-6)
    start = state

    def run() -> State:
        state = start
        for _ in range(steps):
            state = layer.advance(state, DAYS / steps)
        return state

    state, seconds = least(run)
    error = gap(state.u + state.v, surface.area, r, exact)
    return {"code": "ours", "points": len(r), "steps": steps, "seconds": seconds, "error": error}


@njit(cache=True)
def _euler(u: Array, v: Array, n: Array, h: float, dt: float, steps: int, k: Array) -> None:
    rows, columns = u.shape
    phi, change, fed = np.zeros_like(u), np.zeros_like(u), np.zeros_like(u)
    for _ in range(steps):
        for i in range(rows):
            for j in range(columns):
                x = min(max(u[i, j], 0.0), k[1])
                phi[i, j] = k[0] * x * x * (0.5 - x / (3 * k[1]))
        for i in range(1, rows - 1):
            for j in range(1, columns - 1):
                p, m = phi[i, j], n[i, j]
                flow = (m + n[i - 1, j]) * (phi[i - 1, j] - p) + (m + n[i + 1, j]) * (phi[i + 1, j] - p)
                flow += (m + n[i, j - 1]) * (phi[i, j - 1] - p) + (m + n[i, j + 1]) * (phi[i, j + 1] - p)
                change[i, j] = flow / (2 * h * h)
                fed[i, j] = (n[i - 1, j] + n[i + 1, j] + n[i, j - 1] + n[i, j + 1] - 4 * m) / (h * h)
        for i in range(rows):
            for j in range(columns):
                f = k[2] * n[i, j] * u[i, j] / (1 + k[3] * n[i, j])
                a = k[4] * u[i, j] / ((1 + u[i, j] / k[5]) * (1 + n[i, j] / k[6]))
                u[i, j] += dt * (change[i, j] + k[7] * f - a)
                v[i, j] += dt * a
                n[i, j] += dt * (k[8] * fed[i, j] - f)


def euler(rates: Rates, count: int, round_: bool, exact: tuple[Array, Array]) -> dict[str, Any]:
    """The paper's way: the map is flat, whatever lies under it."""
    if round_:
        h = np.pi / count
        theta, phi = np.meshgrid((np.arange(count) + 0.5) * h, (np.arange(2 * count) + 0.5) * h - np.pi, indexing="ij")
        near = np.cos(TILT) * np.cos(theta) + np.sin(TILT) * np.sin(theta) * np.cos(phi)
        r, area = np.arccos(np.clip(near, -1, 1)), np.sin(theta)
    else:
        h = 2 * HALF / count
        x = (np.arange(count) + 0.5) * h - HALF
        r, area = np.hypot(*np.meshgrid(x, x, indexing="ij")), np.ones((count, count))
    u = colony(r, rates)
    v, n = np.zeros_like(u), np.ones_like(u)
    k = np.array([getattr(rates, q) for q in Rates._fields])
    _euler(u.copy(), v.copy(), n.copy(), h, 1e-9, 1, k)
    steps = int(np.ceil(DAYS / (0.9 * h * h / (4 * rates.fastest))))
    start = u, v, n

    def run() -> tuple[Array, Array]:
        u, v, n = (field.copy() for field in start)
        _euler(u, v, n, h, DAYS / steps, steps, k)
        return u, v

    (u, v), seconds = least(run)
    return {
        "code": "Euler on a map" if round_ else "Euler on a grid",
        "points": u.size,
        "steps": steps,
        "seconds": seconds,
        "error": gap(u + v, area, r, exact),
    }


PEER = """
import json, sys, time, numpy as np, pde
g = json.loads(sys.argv[1]); k = g["rates"]; N = g["count"]; H = g["half"]
x = "(u*heaviside(u,0)*heaviside(cap-u,0)+cap*heaviside(u-cap,1))"
phi = f"(mobility*{x}**2*(0.5-{x}/(3*cap)))"
f, a = "(consume*n*u/(1+half*n))", "(wither*u/((1+u/a1)*(1+n/a2)))"
# div(n grad phi) by second-order Laplacians: (lap(n phi) + n lap(phi) - phi lap(n)) / 2
du = f"0.5*(laplace(n*{phi}) + n*laplace({phi}) - {phi}*laplace(n)) + theta*{f} - {a}"
rhs = {"u": du, "v": a, "n": f"feed*laplace(n) - {f}"}
grid = pde.CartesianGrid([[-H, H], [-H, H]], [N, N], periodic=False)
r = np.hypot(grid.cell_coords[..., 0], grid.cell_coords[..., 1])
u = k["cap"] * np.clip(1 - (r / g["wide"])**2, 0, None)**2
st = pde.FieldCollection([pde.ScalarField(grid, q) for q in (u, 0.0, 1.0)], labels=["u", "v", "n"])
eq = pde.PDE(rhs, consts=k, bc={"derivative": 0})
solver = pde.EulerSolver(eq, backend="numba")
step = solver.make_stepper(st, g["dt"])
step(st.copy(), 0.0, 2 * g["dt"])  # compiled before the clock runs
took = []
while len(took) < g["runs"] or sum(took) < g["at_least"]:
    out = st.copy()
    t = time.process_time(); step(out, 0.0, g["days"]); took.append(time.process_time() - t)
density = (out[0].data + out[1].data).tolist()
print(json.dumps({"seconds": min(took), "version": pde.__version__, "density": density}))
"""


def peer(python: str, rates: Rates, count: int, exact: tuple[Array, Array]) -> dict[str, Any]:
    h = 2 * HALF / count
    steps = int(np.ceil(DAYS / (0.9 * h * h / (4 * rates.fastest))))
    given = {"rates": rates._asdict(), "count": count, "half": HALF, "wide": WIDE, "days": DAYS, "dt": DAYS / steps}
    given |= {"runs": _RUNS, "at_least": _AT_LEAST}
    said = subprocess.run([python, "-c", PEER, json.dumps(given)], capture_output=True, text=True, check=True)
    found = json.loads(said.stdout.splitlines()[-1])
    x = (np.arange(count) + 0.5) * h - HALF
    r = np.hypot(*np.meshgrid(x, x, indexing="ij"))
    seconds = found["seconds"]
    error = gap(np.array(found["density"]), 1.0, r, exact)
    return {"code": f"py-pde {found['version']}", "points": r.size, "steps": steps, "seconds": seconds, "error": error}


def _over(row: dict[str, Any], mine: list[dict[str, Any]]) -> float | None:
    """Return a row's seconds over ours at its error, between ours in logarithms; None for ours and beyond them."""
    errors, seconds = (np.log([one[name] for one in mine])[::-1] for name in ("error", "seconds"))
    here = np.log(row["error"])
    if row["code"] == "ours" or not errors[0] <= here <= errors[-1]:
        return None
    return float(row["seconds"] / np.exp(np.interp(here, errors, seconds)))


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    figure, panels = plt.subplots(1, 2, figsize=(10, 4.2), sharey=True)
    for panel, where in zip(panels, ("plane", "sphere"), strict=True):
        mine = [row for row in rows if row["where"] == where]
        for name, mark in zip(dict.fromkeys(row["code"] for row in mine), ("o-", "s--", "^:"), strict=False):
            line = [row for row in mine if row["code"] == name]
            panel.loglog([row["seconds"] for row in line], [row["error"] for row in line], mark, label=name)
            for row in line:
                panel.annotate(
                    f"{row['points']:,}", (row["seconds"], row["error"]), (4, 4), textcoords="offset points", fontsize=7
                )
        panel.set(xlabel="CPU seconds", title=f"a colony on a {where}, {DAYS:g} days")
        panel.grid(which="both", alpha=0.2)
        panel.legend(frameon=False)
    panels[0].set_ylabel("relative L2 error of u + v")
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main(path: Path, python: str | None) -> None:
    params = SOLVER.parse({}, "apple-paper")
    assert isinstance(params, DecayParams)
    rates = daily(params.rot, params, 1.0)
    rows = []
    for where in ("plane", "sphere"):
        round_ = where == "sphere"
        exact = reference(rates, round_)
        meshes = ((16, 3), (32, 4), (64, 8), (128, 16)) if round_ else ((33, 3), (65, 4), (129, 8), (257, 16))
        found = []
        for (n, steps), count in zip(meshes, (32, 64, 128, 256), strict=True):
            # in turn, so that other work on the machine falls on all
            found += [ours(rates, n, steps, round_, exact), euler(rates, count, round_, exact)]
            if python and not round_ and count in (64, 128):
                found.append(peer(python, rates, count, exact))
        order = list(dict.fromkeys(row["code"] for row in found))
        rows += [{"where": where, **row} for row in sorted(found, key=lambda row: order.index(row["code"]))]
    head = ("on a", "code", "points", "steps", "CPU s", "error", "over ours at that error")
    sheet = Sheet("decay-precision", head, "decay")
    for row in rows:
        over = _over(row, [one for one in rows if (one["where"], one["code"]) == (row["where"], "ours")])
        cells = (row["where"], row["code"], row["points"], row["steps"], f"{row['seconds']:.4f}", f"{row['error']:.1e}")
        sheet.add((*cells, f"{over:.1f}" if over else ""), **row, over=over)
    sheet.keep()
    draw(rows, path)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else None)
