"""The solvers' hot loops before and after: python -m benchmarks.loops BEFORE [--rounds 7].

BEFORE is a checkout to compare with; how is said in `benchmarks.turns`. Loops alone, where what is around them has
become another physics: steps of a march without contact, a shell's tangents, a rod bundle's steps without fracture.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import numpy as np

#: As in `benchmarks.turns`, which the tree before need not have.
Use = Callable[[], list[np.ndarray]]


def implicit() -> Use:
    """Forces and tangents of quadratic elements: three sweeps over an octant."""
    from solver.dehydration.implicit import build_model, build_quadratic_mesh, graded_layers
    from solver.dehydration.params import DehydrationParams

    fruit = DehydrationParams()
    model = build_model(fruit, build_quadratic_mesh(fruit, 8, graded_layers(4, 0.8), "octant"), 1000.0)
    zero = np.zeros((len(model.mesh.connectivity), 8))
    return lambda: [model.sweep(model.mesh.positions, model.stretch(0.0), zero).data for _ in range(3)]


def meridional() -> Use:
    """The onset of a long fruit, on its meridian."""
    from solver.dehydration import SOLVER, onset

    fruit = SOLVER.parse({"te": 0.04, "gamma": 20.0}, preset="jujube1")
    return lambda: [np.array([onset(fruit).s_cr])]


def march() -> Use:
    """Fifty explicit steps of 7,776 elements, without contact."""
    from solver.dehydration import kernel

    try:
        fresh: Any = importlib.import_module("solver.dehydration.fresh.mesh")
    except ModuleNotFoundError:
        fresh = importlib.import_module("solver.dehydration.mesh")
    sphere = fresh.cubed_sphere(12)
    radii = np.concatenate([0.4 + 0.6 * np.array([0, 0.25, 0.45, 0.62, 0.76, 0.87, 0.95, 1]), [1.02, 1.04]])
    base, layer = sphere.quads[:, [0, 3, 1, 2]] * len(radii), np.arange(len(radii) - 1)
    skin = np.tile(layer >= 7, len(base))
    mu = np.where(skin, 10.0, 1.0)
    layout = kernel.build_layout(
        positions=(sphere.directions[:, None] * radii[:, None]).reshape(-1, 3),
        connectivity=(base[:, None, :, None] + layer[:, None, None] + np.array([0, 1])).reshape(-1, 8),
        is_exocarp=skin,
        mu=mu,
        kappa=30.0 * mu,
        fixed=np.tile(np.arange(len(radii)) == 0, len(sphere.directions)),
    )

    def use() -> list[np.ndarray]:
        state, velocity = kernel.new_state(layout)
        kernel.march(layout, state, velocity, 50, theta=(0.99, 0.99), damping=0.02, one_point=False)
        return [kernel.positions(state)]

    return use


def decay() -> Use:
    """Two days of rot on an orange, preview."""
    from solver.contract import Need
    from solver.decay import SOLVER

    fruit = SOLVER.parse({}, preset="orange")
    need = Need(stages=(2.0,), quality="preview", fields=("rot", "mould"))
    return lambda: [SOLVER.solve(fruit, need)["rot"].values]


def wood() -> Use:
    """A bundle of 19 rods that swings for a millisecond, explicitly, without fracture."""
    from solver.contract import Need
    from solver.wood import SOLVER

    bundle = SOLVER.parse({"rods": 19, "vertices": 24, "fracture": "none"}, preset="fig-4.1")
    need = Need(stages=(1e-3,), quality="preview", fields=("rod_position",))
    return lambda: [SOLVER.solve(bundle, need)["rod_position"].values]


def growth() -> Use:
    """A growing shell's tangents, 3,025 vertices, ten times."""
    from solver import shell

    i, j = (part.ravel() for part in np.meshgrid(np.arange(55), np.arange(55), indexing="ij"))
    x = np.stack([i + 0.5 * j, np.sqrt(0.75) * j, 0.3 * np.sin(0.4 * i)], -1)
    at = np.arange(55 * 55).reshape(55, 55)
    a, b, c, d = (part.ravel() for part in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    triangles = np.concatenate([np.stack([a, b, d], -1), np.stack([b, c, d], -1)])
    mesh, g = shell.topology(triangles, len(x)), shell.metric(x, triangles)
    pattern, hinges = shell.pattern(mesh), shell.hinge_stiffness(g, mesh, 0.01)

    def use() -> list[np.ndarray]:
        for _ in range(10):
            blocks = np.zeros((pattern.blocks, 3, 3))
            shell.membrane_tangent(1.05 * x, triangles, g, 1.0, pattern.of_triangles, blocks)
            shell.bending_tangent(1.05 * x, mesh.hinges, hinges, pattern.of_hinges, blocks)
        return [blocks]

    return use


USES = (implicit, meridional, march, decay, wood, growth)


if __name__ == "__main__":
    from benchmarks.turns import main

    main("loops", __file__, __doc__, USES)
