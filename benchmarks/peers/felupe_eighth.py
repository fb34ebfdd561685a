"""A given eighth of a core/shell fruit in FElupe, dried past its onset: FElupe's elements and Newton's method.

Trilinear hexahedra with mean dilatation (Q1/P0), Pardiso where it is installed. The mesh, with its imperfection, comes
from a file; nothing else of ours takes part: no march, no scaled masses, no contact. Past the onset the smooth branch
is an equilibrium as well, and Newton's method alone stays on it: a viscous force, implicit in time, lets go of it (as
Eq. 12 of Liu et al. 2014 does) and is gone in the states that are handed back, whose tangents are looked at.
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import felupe
import numpy as np
from felupe.mechanics import Assemble, Results
from felupe_sphere import shrinkable_body, spsolve
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import eigsh

KAPPA_RATIO, TOLERANCE = 1000.0, 1e-8
#: Viscosity times a step's rate [mu / r1^2] while the load rises and while it rests, the largest move [r1] of a step
#: at which a state has come to rest, and steps at most.
RISING, RESTING, REST, MOST = 2.0, 0.5, 2e-5, 400


class Viscous:
    """A force against the way since the last step, by the volume of flesh that goes it."""

    def __init__(self, field: felupe.FieldContainer, mass: np.ndarray) -> None:
        self.field, self.mass, self.rate = field, mass, RISING
        self.before = field[0].values.copy()
        self.results = Results()
        self.assemble = Assemble(vector=self._vector, matrix=self._matrix)

    def _vector(self, field: felupe.FieldContainer | None = None, **_: Any) -> csr_array:
        way = (self.field if field is None else field)[0].values - self.before
        return csr_array((self.rate * self.mass * way.ravel())[:, None])

    def _matrix(self, **_: Any) -> csr_array:
        return diags_array(self.rate * self.mass).tocsr()


class Fruit:
    """The eighth under its load; `field` is moved from state to state."""

    def __init__(self, points: np.ndarray, cells: np.ndarray, core: np.ndarray, fixed: np.ndarray, gamma: float):
        def container(chosen: np.ndarray) -> felupe.FieldContainer:
            mesh = felupe.Mesh(points, chosen, "hexahedron")
            return felupe.FieldContainer([felupe.Field(felupe.RegionHexahedron(mesh), dim=3)])

        self.points, self.field, base = points, container(cells), shrinkable_body()
        self.moduli = 1.0, gamma
        self.parts = [
            type("Part", (base,), {"J0": 1.0})(felupe.NeoHooke(mu=mu), container(cells[part]), bulk=KAPPA_RATIO * mu)
            for mu, part in zip(self.moduli, (core, ~core), strict=True)
        ]
        volumes = self.field.region.dV.sum(axis=0)
        mass = np.repeat(np.bincount(cells.ravel(), np.repeat(volumes / 8, 8), len(points)), 3)
        self.viscous = Viscous(self.field, mass)
        bounds = {"held": felupe.Boundary(self.field[0], mask=fixed)}
        for axis, name in enumerate("xyz"):
            skip = tuple(other != axis for other in range(3))
            bounds[name] = felupe.Boundary(self.field[0], mask=np.abs(points[:, axis]) < 1e-10, skip=skip)
        self.held, self.free = felupe.dof.partition(self.field, bounds)
        self.nowhere = felupe.dof.apply(self.field, bounds, self.held)
        self.newton = self.steps = 0
        self.haste = 1.0

    def load(self, theta: float) -> None:
        """Let the core rest at theta: theta^3 W(F / theta) has moduli of theta^3 mu and kappa / theta^3."""
        body = self.parts[0]
        body.J0 = theta**3
        body.umat, body.bulk = felupe.NeoHooke(mu=body.J0), KAPPA_RATIO / body.J0
        body.results.state.p[:] = body.bulk * (body.results.state.J - body.J0)

    def put(self, nodes: np.ndarray) -> None:
        """Start from these nodes (n, 3), and from the volumes and pressures that they make."""
        self.field[0].values[:] = nodes - self.points
        for part in self.parts:
            part.field.link(self.field)
            part.restore({**part.checkpoint(), **self.field.checkpoint()}, restore_state=False)

    def solved(self, *more: Viscous) -> float:
        """Balance forces; return the largest way that a node went."""
        done = felupe.newtonraphson(
            x0=self.field, items=[*self.parts, *more], dof0=self.held, dof1=self.free, ext0=self.nowhere,
            solver=spsolve, tol=TOLERANCE, verbose=0, maxiter=16,
        )  # fmt: skip
        # what comes back is another field
        way = float(np.abs(done.x[0].values - self.field[0].values).max())
        self.field, self.newton, self.steps = done.x, self.newton + int(done.iterations), self.steps + 1
        return way

    def step(self, rate: float) -> float:
        """Go on in time, for less where Newton's method fails; return the largest way over how long that was."""
        saved = [part.checkpoint() for part in self.parts]
        self.viscous.before = self.field[0].values.copy()
        while True:
            self.viscous.rate = rate / self.haste
            try:
                way = self.solved(self.viscous) / self.haste
            except ValueError:
                self.haste /= 4
                if self.haste < 1e-6:
                    raise
                for part, kept in zip(self.parts, saved, strict=True):
                    part.field.link(self.field)
                    part.restore(kept)
            else:
                self.haste = min(1.0, 2 * self.haste)
                return way

    @property
    def energy(self) -> float:
        """Strain energy [mu r1^3]."""
        total = 0.0
        for mu, part in zip(self.moduli, self.parts, strict=True):
            f = part.results.kinematics[0]
            j = np.linalg.det(np.moveaxis(f, (0, 1), (-2, -1)))
            first = (f**2).sum(axis=(0, 1)) * j ** (-2 / 3)
            state = part.results.state
            total += float((part.J0 * mu / 2 * (first - 3) * part.field.region.dV).sum())
            total += float((KAPPA_RATIO * mu / part.J0 / 2 * (state.J - part.J0) ** 2 * part.V).sum())
        return total

    @property
    def least(self) -> float:
        """Least eigenvalue of the tangent over the mass [mu / r1^2]: positive where the state is stable."""
        whole = sum(part.assemble.matrix() for part in self.parts).tocsr()[self.free][:, self.free]
        mass = diags_array(self.viscous.mass[self.free]).tocsc()
        found = eigsh(whole.tocsc(), k=1, M=mass, sigma=-10.0, which="LM", return_eigenvectors=False)
        return float(found[0])


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--mesh", type=Path, required=True, help="npz: points, cells (VTK's order), core, fixed, gamma")
    parser.add_argument("--stages", required=True, help="shrinkages, rising, with commas")
    parser.add_argument("--start", type=Path, help="npz: nodes (stages, n, 3) to start stages from, and no march")
    parser.add_argument("--step", type=float, default=0.0025)
    parser.add_argument("--out", type=Path, required=True, help="npz: nodes (stages, n, 3)")
    asked = parser.parse_args()
    with np.load(asked.mesh) as given:
        fruit = Fruit(given["points"], given["cells"], given["core"], given["fixed"], float(given["gamma"]))
    wall, cpu, s, nodes, rows = time.perf_counter(), time.process_time(), 0.0, [], []
    starts = None if asked.start is None else np.load(asked.start)["nodes"]
    for k, stage in enumerate(map(float, asked.stages.split(","))):
        if starts is None:
            for at in np.linspace(s, stage, max(1, round((stage - s) / asked.step)) + 1)[1:]:
                fruit.load(1 - at)
                fruit.step(RISING)
        else:
            fruit.put(starts[k])
            fruit.load(1 - stage)
        s, rests = stage, 0
        while fruit.step(RESTING) > REST and rests < MOST:
            rests += 1
        way = fruit.solved()
        nodes.append(fruit.points + fruit.field[0].values)
        rows.append({"s": s, "energy": fruit.energy, "least": fruit.least, "rests": rests, "way": way})
        np.savez(asked.out, nodes=nodes)
    print(json.dumps({
        "cpu": time.process_time() - cpu, "wall": time.perf_counter() - wall, "newton": fruit.newton,
        "steps": fruit.steps, "unknowns": len(fruit.free), "version": felupe.__version__, "element": "Q1/P0",
        "stages": rows,
    }))  # fmt: skip


if __name__ == "__main__":
    main()
