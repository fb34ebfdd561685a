"""The common case in dolfinx (written for 0.5): hex27, discontinuous linear pressure, MUMPS.

Compilation of the forms is not counted: dolfinx keeps it between runs.
"""

import basix.ufl_wrapper  # noqa: F401
import dolfinx
import numpy as np
import ufl
from case import KAPPA_RATIO, MU_CORE, MU_SKIN, QUADRATIC, STONE, TOLERANCE, Answer, hexahedra
from dolfinx import cpp, fem, mesh, nls
from mpi4py import MPI
from petsc4py import PETSc


def main() -> None:
    answer = Answer()
    points, cells, core = hexahedra(answer.sizes, 2)
    order = np.array(cpp.io.perm_vtk(mesh.CellType.hexahedron, 27))
    vector = ufl.VectorElement("Lagrange", ufl.hexahedron, 2)
    domain = mesh.create_mesh(MPI.COMM_WORLD, cells[:, QUADRATIC][:, order].astype(np.int64), points, ufl.Mesh(vector))
    space = fem.FunctionSpace(domain, ufl.MixedElement([vector, ufl.FiniteElement("DPC", ufl.hexahedron, 1)]))
    unknown = fem.Function(space)
    u, p = ufl.split(unknown)
    piecewise = fem.FunctionSpace(domain, ("DG", 0))
    theta, mu = fem.Function(piecewise), fem.Function(piecewise)
    is_core = core[np.array(domain.topology.original_cell_index)]
    theta.x.array[: len(is_core)] = np.where(is_core, answer.theta, 1.0)
    mu.x.array[: len(is_core)] = np.where(is_core, MU_CORE, MU_SKIN)
    elastic = (ufl.Identity(3) + ufl.grad(u)) / theta
    ratio = ufl.det(elastic)
    shear = mu / 2 * (ratio ** (-2.0 / 3) * ufl.tr(elastic.T * elastic) - 3)
    density = theta**3 * (shear + p * (ratio - 1) - p * p / (2 * KAPPA_RATIO * mu))
    residual = ufl.derivative(density * ufl.dx(metadata={"quadrature_degree": 6}), unknown)

    whole, _ = space.sub(0).collapse()
    stone = mesh.locate_entities_boundary(domain, 2, lambda x: np.isclose(np.linalg.norm(x, axis=0), STONE, atol=1e-6))
    held = fem.locate_dofs_topological((space.sub(0), whole), 2, stone)
    conditions = [fem.dirichletbc(fem.Function(whole), held, space.sub(0))]
    for axis in range(3):
        part = space.sub(0).sub(axis)
        line, _ = part.collapse()
        plane = mesh.locate_entities_boundary(domain, 2, lambda x, axis=axis: np.isclose(x[axis], 0, atol=1e-9))
        held = fem.locate_dofs_topological((part, line), 2, plane)
        conditions.append(fem.dirichletbc(fem.Function(line), held, part))

    newton = nls.petsc.NewtonSolver(MPI.COMM_WORLD, fem.petsc.NonlinearProblem(residual, unknown, conditions))
    newton.rtol, newton.atol, newton.max_it, newton.convergence_criterion = TOLERANCE, 1e-10, 20, "residual"
    options, prefix = PETSc.Options(), newton.krylov_solver.getOptionsPrefix()
    for name, value in (("ksp_type", "preonly"), ("pc_type", "lu"), ("pc_factor_mat_solver_type", "mumps")):
        options[prefix + name] = value
    newton.krylov_solver.setFromOptions()
    answer.start()
    steps, converged = newton.solve(unknown)
    answer.stop()
    if not converged:
        raise SystemExit("Newton's iteration did not converge")
    found = unknown.sub(0).collapse()
    answer.give(
        found.function_space.tabulate_dof_coordinates(), found.x.array.reshape(-1, 3),
        newton=int(steps), unknowns=int(found.x.array.size), version=dolfinx.__version__, element="Q2/P1d",
    )  # fmt: skip


main()
