"""The common case in NGSolve: second order hexahedra, discontinuous linear pressure, condensed, sparse Cholesky.

The sphere is curved by a mesh deformation that puts every point at the radius interpolated between its corners.
"""

import netgen.meshing as netgen
import ngsolve
import numpy as np
from case import KAPPA_RATIO, LINEAR, MU_CORE, MU_SKIN, OUTSIDE, STONE, TOLERANCE, Answer, hexahedra
from ngsolve import (
    CF,
    H1,
    L2,
    BilinearForm,
    Det,
    Grad,
    GridFunction,
    Id,
    InnerProduct,
    Trace,
    Variation,
    VectorH1,
    dx,
    sqrt,
    x,
    y,
    z,
)  # fmt: skip

FACES = ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
MOST_STEPS = 30


def build(sizes: tuple[int, int, int]) -> tuple[ngsolve.Mesh, np.ndarray]:
    points, cells, core = hexahedra(sizes, 1)
    mesh = netgen.Mesh(dim=3)
    numbers = [mesh.Add(netgen.MeshPoint(netgen.Pnt(*point))) for point in points]
    names = ("stone", "outer", "plane0", "plane1", "plane2")
    for k, name in enumerate(names, 1):
        mesh.Add(netgen.FaceDescriptor(bc=k, domin=1, domout=0, surfnr=k))
        mesh.SetBCName(k - 1, name)
    mesh.SetMaterial(1, "core")
    mesh.SetMaterial(2, "skin")
    radius = np.linalg.norm(points, axis=1)
    on = [np.abs(radius - STONE) < 1e-9, np.abs(radius - OUTSIDE) < 1e-9]
    on += [np.abs(points[:, axis]) < 1e-12 for axis in range(3)]
    for cell, is_core in zip(cells[:, LINEAR], core, strict=True):
        mesh.Add(netgen.Element3D(1 if is_core else 2, [numbers[i] for i in cell]))
        for face in FACES:
            corners = cell[list(face)]
            tag = next((k for k, chosen in enumerate(on, 1) if chosen[corners].all()), None)
            if tag is not None:
                mesh.Add(netgen.Element2D(tag, [numbers[i] for i in corners]))
    return ngsolve.Mesh(mesh), points


def main() -> None:
    ngsolve.SetNumThreads(1)
    answer = Answer()
    mesh, points = build(answer.sizes)
    radius = GridFunction(H1(mesh, order=1))
    radius.vec.FV().NumPy()[: len(points)] = np.linalg.norm(points, axis=1)
    place = CF((x, y, z))
    curved = GridFunction(VectorH1(mesh, order=2))
    curved.Set(place / sqrt(x * x + y * y + z * z) * radius - place, dual=False)
    mesh.SetDeformation(curved)
    moves = VectorH1(mesh, order=2, dirichlet="stone", dirichletx="plane0", dirichlety="plane1", dirichletz="plane2")
    space = moves * L2(mesh, order=1)
    (u, p), _ = space.TnT()
    theta, mu = (
        mesh.MaterialCF({"core": answer.theta, "skin": 1.0}),
        mesh.MaterialCF({"core": MU_CORE, "skin": MU_SKIN}),
    )
    elastic = (Id(3) + Grad(u)) / theta
    ratio = Det(elastic)
    shear = mu / 2 * (ratio ** (-2 / 3) * Trace(elastic.trans * elastic) - 3)
    density = theta**3 * (shear + p * (ratio - 1) - p * p / (2 * KAPPA_RATIO * mu))
    form = BilinearForm(space, symmetric=False, condense=True)
    form += Variation(density.Compile() * dx(bonus_intorder=2))
    found = GridFunction(space)
    residual, step = found.vec.CreateVector(), found.vec.CreateVector()
    first = None
    answer.start()
    newton = 0
    while newton < MOST_STEPS:
        newton += 1
        form.Apply(found.vec, residual)
        form.AssembleLinearization(found.vec)
        inverse = form.mat.Inverse(space.FreeDofs(True), inverse="sparsecholesky")
        residual.data += form.harmonic_extension_trans * residual
        step.data = inverse * residual
        step.data += form.harmonic_extension * step
        step.data += form.inner_solve * residual
        found.vec.data -= step
        size = abs(InnerProduct(step, residual)) ** 0.5
        first = first or size
        if size < TOLERANCE * first:
            break
    answer.stop()
    if size >= TOLERANCE * first:
        raise SystemExit("Newton's iteration did not converge")
    mesh.UnsetDeformation()
    moved = np.stack([part.vec.FV().NumPy()[: mesh.nv] for part in found.components[0].components], axis=1)
    answer.give(
        points, moved, newton=newton, unknowns=moves.ndof, version=ngsolve.__version__, element="Q2/P1d",
    )  # fmt: skip


main()
