"""Each user of `solver.linalg` before and after: python -m benchmarks.linalg BEFORE [--rounds 15].

BEFORE is a checkout to compare with; how is said in `benchmarks.turns`. The trees' modules bear different names, which
`_named` knows.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import sparse

#: A use: what is done once outside of the clock returns what is timed, which returns arrays to compare.
Use = Callable[[], list[np.ndarray]]


def _named(*names: str) -> Any:
    """Import the first module of that name that this tree has."""
    for name in names:
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError:
            continue
    raise ModuleNotFoundError(names[0])


def shell_matrix() -> tuple[Any, Any, np.ndarray, np.ndarray]:
    """Return mesh, pattern, places and blocks of a growing shell's tangent, 3,025 vertices."""
    from solver import shell
    from solver.growth import shapes

    x, triangles = shapes.sphere(3000) if hasattr(shapes, "sphere") else _sheet(55)
    mesh, g = shell.topology(triangles, len(x)), shell.metric(x, triangles)
    pattern = shell.pattern(mesh)
    blocks = np.zeros((pattern.blocks, 3, 3))
    shell.membrane_tangent(1.05 * x, triangles, g, 1.0, pattern.of_triangles, blocks)
    shell.bending_tangent(1.05 * x, mesh.hinges, shell.hinge_stiffness(g, mesh, 0.01), pattern.of_hinges, blocks)
    blocks[pattern.diagonal] += 1e-3 * np.eye(3)
    return mesh, pattern, x, blocks


def _sheet(n: int) -> tuple[np.ndarray, np.ndarray]:
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    points = np.stack([i + 0.5 * j, np.sqrt(0.75) * j, 0.3 * np.sin(0.4 * i)], -1)
    at = np.arange(n * n).reshape(n, n)
    a, b, c, d = (part.ravel() for part in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    return points, np.concatenate([np.stack([a, b, d], -1), np.stack([b, c, d], -1)])


def shell_factor() -> Use:
    """Order, factors and ten solves of a growing shell's inverse, 3,025 vertices."""
    inverse = importlib.import_module("solver.shell.inverse")
    mesh, pattern, x, blocks = shell_matrix()
    normals = np.tile([0.0, 0.0, 1.0], (len(x), 1))
    held, right = np.zeros(len(x), bool), np.random.default_rng(0).normal(size=x.shape)

    def use() -> list[np.ndarray]:
        work = inverse.inverse_of(inverse.fronts_of(mesh, x), pattern, blocks, normals, held)
        while True:
            try:
                next(work)
            except StopIteration as done:
                factored = done.value
                break
        return [factored.apply(right) for _ in range(10)]

    return use


def shell_pattern() -> Use:
    """The pattern of the same shell, as after each remeshing."""
    from solver import shell

    mesh = shell_matrix()[0]

    def use() -> list[np.ndarray]:
        found = [shell.pattern(mesh) for _ in range(5)]
        return [found[0].indices, found[0].of_hinges]

    return use


def implicit() -> Use:
    """A factor and five solves of the smooth state's tangent: the implicit road, the full onset."""
    from solver.dehydration.implicit import build_model, build_quadratic_mesh, graded_layers
    from solver.dehydration.params import DehydrationParams

    fruit = DehydrationParams()
    model = build_model(fruit, build_quadratic_mesh(fruit, 10, graded_layers(4, 0.8), "octant"), 1000.0)
    zero = np.zeros((len(model.mesh.connectivity), 8))
    data = model.sweep(model.mesh.positions, model.stretch(0.0), zero).data
    right = model.free_part(np.random.default_rng(0).normal(size=model.mesh.positions.shape)).ravel()

    def use() -> list[np.ndarray]:
        factor = model.factor(data)
        return [factor.solve(right) for _ in range(5)]

    return use


def implicit_model() -> Use:
    """Pattern and order of elimination of the same model."""
    from solver.dehydration.implicit import build_model, build_quadratic_mesh, graded_layers
    from solver.dehydration.params import DehydrationParams

    fruit = DehydrationParams()
    mesh = build_quadratic_mesh(fruit, 10, graded_layers(4, 0.8), "octant")
    return lambda: [build_model(fruit, mesh, 1000.0).pattern.blocks]


def meridional() -> Use:
    """A band of 400 columns of quadrilaterals: twenty factors and solves."""
    banded = _named("solver.linalg.banded", "solver.dehydration.bifurcation.banded", "solver.dehydration.onset.banded")
    levels, columns = 13, 401
    node = np.arange(columns * levels).reshape(columns, levels)
    cells = np.stack(
        [node[a : columns - 2 + a : 2, b : levels - 2 + b : 2].ravel() for a in range(3) for b in range(3)], -1
    )
    unknowns = (2 * cells[:, :, None] + np.arange(2)).reshape(len(cells), 18)
    form = np.random.default_rng(0).normal(size=(18, 18))
    pattern = banded.pattern(unknowns, 2 * node.size)
    entries = pattern.assemble(np.broadcast_to(form @ form.T + np.eye(18), (len(cells), 18, 18)))
    right = np.ones(2 * node.size)

    def use() -> list[np.ndarray]:
        return [pattern.factor(entries).solve(right) for _ in range(20)]

    return use


def wood_matrix() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return places, pattern, coupled pairs and blocks of a bundle: 61 rods of 20 vertices, tied to their neighbours.

    The matrix is made here: how bonds couple vertices has changed.
    """
    i, j = (part.ravel() for part in np.meshgrid(np.arange(-4, 5), np.arange(-4, 5)))
    ring = np.stack([i + 0.5 * j, np.sqrt(0.75) * j], -1)[np.abs(i + j) <= 4]
    x = np.concatenate([np.stack([np.full(len(ring), 2.0 * z), *ring.T], -1) for z in range(20)])
    x[:, 0] += np.tile(np.random.default_rng(1).uniform(-0.5, 0.5, len(ring)), 20)
    pairs = np.argwhere(np.triu(np.linalg.norm(x[:, None] - x[None], axis=-1) < 2.1, 1))
    graph = sparse.coo_array((np.ones(len(pairs)), pairs.T), shape=(len(x), len(x))).tocsr()
    graph = sparse.csr_array(graph + graph.T + sparse.eye_array(len(x)))
    graph.sort_indices()
    indptr, indices = graph.indptr.astype(np.int64), graph.indices.astype(np.int64)
    row = np.repeat(np.arange(len(x)), np.diff(indptr))
    way = x[indices] - x[row]
    blocks = -np.einsum("ni,nj->nij", way, way) / np.maximum((way**2).sum(1), 1e-9)[:, None, None]
    own = np.zeros((len(x), 3, 3))
    np.add.at(own, row, -blocks)
    blocks[row == indices] = own + 0.1 * np.eye(3)
    return x, indptr, indices, np.column_stack([row, indices])[row <= indices], blocks


def wood_static() -> Use:
    """Order, three factors and solves of a bundle's stiffness."""
    multifrontal = _named("solver.linalg.multifrontal", "solver.multifrontal")
    x, indptr, indices, pairs, blocks = wood_matrix()
    right = np.random.default_rng(0).normal(size=3 * len(x))

    def order() -> Any:
        if multifrontal.__name__ == "solver.multifrontal":
            return importlib.import_module("solver.wood.dissection").dissected(x, indptr, indices)
        leaf = importlib.import_module("solver.wood.stepping.static")._LEAF
        return multifrontal.analyse(pairs, x[pairs].mean(axis=1), indptr, indices, leaf_size=leaf, thin=True)

    def use() -> list[np.ndarray]:
        found = order()
        return [multifrontal.factorise(found, blocks).solve(right) for _ in range(3)]

    return use


def decay_body() -> Use:
    """Conjugate gradients on a fruit's flesh of ten shells, to 1e-8."""
    from solver.dehydration.params import DehydrationParams

    body, solid = importlib.import_module("solver.decay.body.material"), _named("solver.decay.body.solid")
    krylov = _named("solver.linalg.krylov", "solver.decay.body.sparse")
    solve = getattr(krylov, "conjugate_gradients", None) or krylov.solve
    filled = solid.fill(DehydrationParams(), 10)
    one = np.ones(len(filled.tets))
    pattern = body.blocks(filled.tets, len(filled.points))
    rows = [getattr(pattern, a, None) for a in ("indptr", "indices", "diagonal")]
    if rows[0] is None:
        rows = [pattern.start, pattern.near, pattern.own]
    a = np.zeros((len(rows[1]), 3, 3))
    inverse = body.inverse_edges(filled.points, filled.tets)
    body.hessian(filled.points, filled.tets, inverse, filled.volume, one, 20 * one, pattern.slot, a, True)
    a[rows[2]] += 1e-3 * np.eye(3)
    right = np.random.default_rng(0).normal(size=filled.points.shape)
    return lambda: [solve(*rows, a, right, 1e-8, 2000)[0]]


USES = (shell_factor, shell_pattern, implicit, implicit_model, meridional, wood_static, decay_body)


if __name__ == "__main__":
    from benchmarks.turns import main

    main("linalg", __file__, __doc__, USES)
