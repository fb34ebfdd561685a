"""Before buckling: radii of the common sphere octant against its radial reference, ours and the peers' in one run.

CPU seconds are those of one solution: ours from parameters to state, meshing included, the second one in its process;
the peers' their Newton iteration alone, without start, meshing, set-up and compilation (CalculiX: its whole process).
"cpu_process" is everything. Error: largest of the radius at the nodes. The explicit march is nearly incompressible at
its own kappa, so it is held to the reference at that kappa, and to the closed form.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any

from .peers import PEERS, Peer, find, solve
from .record import Record, Row, worker

THETAS = (0.95, 0.9)
#: Elements per edge of the cubed sphere and core layers; the octant has half of n per edge of its patches. The error is
#: that of n from a quarter as many layers on: (8, 2), (8, 3) and (8, 5) are off by 2.7e-5, 2.8e-5 and 2.8e-5.
IMPLICIT = ((4, 1), (6, 2), (6, 4), (8, 2), (12, 3), (16, 4))
EXPLICIT = (8, 12, 18, 26)
MERIDIONAL = (2.0, 4.0, 6.0, 9.0)
#: The march buckles at s = 0.08, as the fruit does. Newton's iteration goes on along the smooth branch, an equilibrium
#: that is no longer stable: there a mesh's unevenness is amplified, and errors need not fall with every refinement.
EXPLICIT_THETAS = (0.95,)
SHIPPED = {"meridional": "6 per wavelength", "implicit": "n6 layers4", "explicit": "n26"}


def implicit(theta: float, n: int, layers: int) -> Row:
    """Solve with the quadratic implicit solver."""
    from ..sphere_ours import implicit as run

    found = run(theta, n, layers)
    return {**_flat(found), "element": "Q2/P1d"}


def meridional(theta: float, per_wavelength: float) -> Row:
    """Solve in the meridional plane."""
    from solver.dehydration.bifurcation import base_state

    from ..sphere_ours import FRUIT, KAPPA_RATIO, errors, timed

    def run() -> Any:
        return base_state(FRUIT, 1 - theta, per_wavelength=per_wavelength, kappa_ratio=KAPPA_RATIO)

    (_, cold), (state, warm) = timed(run), timed(run)
    mesh = state.meridian.mesh
    found = {"cold": cold, "warm": warm, **errors(mesh.position, state.moved, theta, KAPPA_RATIO)}
    return {**_flat(found), "unknowns": int(state.meridian.free.sum()), "element": "Q2/P1d, r and y"}


def explicit(theta: float, n: int) -> Row:
    """March from the fresh shape and settle, as a run of the default quality does, on a mesh of n elements an edge."""
    from dataclasses import replace

    from solver.contract import Context
    from solver.dehydration.kernel import positions
    from solver.dehydration.path import Path, State
    from solver.dehydration.settings import choose

    from ..sphere_ours import FRUIT, errors, timed

    class Kept(Path):
        """A path that keeps all nodes of the settled state, not only those of the surface."""

        def _settle(self, state: Any, *rest: Any) -> State:
            found = super()._settle(state, *rest)
            self.nodes = positions(state)
            return found

    usual = choose(FRUIT, "default")
    # coarser elements have a longer critical step: shrinkage and decay per unit of time are kept
    paced = {name: getattr(usual, name) * usual.n / n for name in ("pace", "damping", "swing_damping")}
    settings = replace(usual, n=n, start=0.0, **paced)
    smooth = FRUIT.model_copy(update={"imperfection": 0.0})

    def run() -> Kept:
        path = Kept(smooth, settings, Context())
        path.stage(1 - theta, 1 - theta)
        return path

    (_, cold), (path, warm) = timed(run), timed(run)
    mesh = path.mesh
    found = {"cold": cold, "warm": warm, **errors(mesh.positions, path.nodes, theta, settings.kappa_ratio)}
    more = {"unknowns": 3 * int((~mesh.fixed).sum()), "element": "Q1/P0", "kappa_ratio": settings.kappa_ratio}
    return {**_flat(found), **more}


def _flat(found: Row) -> Row:
    rest = {name: value for name, value in found.items() if name not in ("cold", "warm")}
    return {"cpu": found["warm"]["cpu"], "cpu_cold": found["cold"]["cpu"], **rest}


def measure(
    record: Record, *, thetas: Iterable[float] = THETAS, peers: bool = True, short: bool = False, limit: float = 120.0
) -> None:
    """Run everything anew, one after the other, so that its seconds compare; a peer that is missing is named."""
    missing = {}
    places: list[tuple[Peer, str]] = []
    for peer in PEERS if peers else ():
        place, reason = find(peer)
        if place is None:
            missing[peer.name] = reason
            print(f"{peer.name}: left out, {reason}")
        else:
            places.append((peer, place))
    record.rows("spheres").clear()
    for theta in thetas:
        for code, mesh, run in _plan(theta, places, short, limit):
            _show(record.row("spheres", {"theta": theta, "code": code, "mesh": mesh}, run, again=True))
    record.save("spheres", missing_peers=missing)


def _plan(
    theta: float, places: Iterable[tuple[Peer, str]], short: bool, limit: float
) -> Iterator[tuple[str, str, Callable[[], Row]]]:
    """Yield code, mesh and run, ours first; the short plan leaves out our finest meshes."""

    def ours(code: str, **arguments: float) -> Callable[[], Row]:
        return lambda: worker(f"spheres:{code}", theta=theta, limit=limit, **arguments)

    for fineness in MERIDIONAL:
        yield "meridional", f"{fineness:g} per wavelength", ours("meridional", per_wavelength=fineness)
    for n, layers in IMPLICIT[:-1] if short else IMPLICIT:
        yield "implicit", f"n{n} layers{layers}", ours("implicit", n=n, layers=layers)
    marched = EXPLICIT[:-1] if short else EXPLICIT
    for n in marched if theta in EXPLICIT_THETAS else ():
        yield "explicit", f"n{n}", ours("explicit", n=n)
    for peer, place in places:
        for size in peer.meshes:
            yield peer.name, "-".join(map(str, size)), partial(solve, peer, place, theta, size, limit)


def ratios(rows: Iterable[Row]) -> list[Row]:
    """Return, for each peer's run, its CPU seconds over those of our cheapest run that is at least as accurate."""
    good = [row for row in rows if "failed" not in row]
    found = []
    for row in good:
        if row["code"] not in {peer.name for peer in PEERS}:
            continue
        line = {name: row[name] for name in ("theta", "code", "mesh", "cpu", "error_radial_reference")}
        for ours in ("implicit", "meridional"):
            as_good = [
                other
                for other in good
                if other["code"] == ours
                and other["theta"] == row["theta"]
                and other["error_radial_reference"] <= row["error_radial_reference"]
            ]
            cheapest = min(as_good, key=lambda other: other["cpu"], default=None)
            line[f"over_{ours}"] = row["cpu"] / cheapest["cpu"] if cheapest else None
            line[f"{ours}_mesh"] = cheapest["mesh"] if cheapest else None
        found.append(line)
    return found


def _show(row: Row) -> None:
    head = f"theta {row['theta']:g} {row['code']:11} {row['mesh']:17}"
    if "failed" in row:
        print(f"{head} {row['failed']}", flush=True)
        return
    print(
        f"{head} {row['unknowns']:7d} unknowns {row['cpu']:8.3f} CPU s ({row['cpu_process']:6.2f} in all)  "
        f"error {row['error_radial_reference']:.1e} (closed form {row['error_closed_form']:.1e})",
        flush=True,
    )
