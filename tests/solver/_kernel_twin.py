"""A textbook twin of the explicit kernel in plain numpy that shares no code with it, and meshes to try both on."""

from __future__ import annotations

import numpy as np

from solver.dehydration.kernel import new_state, place, positions
from solver.dehydration.kernel.diagnostics import NumpyArithmetic
from solver.dehydration.kernel.elements import core_forces, exocarp_forces, one_point_forces
from solver.dehydration.kernel.metric import element_planes, one_point_planes

KINDS = ("core", "exocarp", "one_point")
NODE = np.array([[1.0 if a & bit else -1.0 for bit in (4, 2, 1)] for a in range(8)])


def shape_gradient(point):
    """dN/dxi (8, 3) of N_a = prod_k (1 + xi_k xi_ak) / 8."""
    terms = 1 + point * NODE
    return np.stack([NODE[:, k] * np.prod(np.delete(terms, k, axis=1), axis=1) / 8 for k in range(3)], axis=1)


def rule(kind):
    g = 1 / np.sqrt(3)
    cube = [(np.array([a, b, c]), 1.0) for a in (-g, g) for b in (-g, g) for c in (-g, g)]
    if kind == "exocarp":
        # a tenth at Gauss points, the rest where the weighted mean of zeta^2 becomes 1
        line = np.sqrt((1 - 0.1 / 3) / 0.9)
        return [(p, 0.1 * w) for p, w in cube] + [(np.array([0, 0, z]), 0.9 * 4) for z in (-line, line)]
    return cube


def points_of(fresh, kind):
    """[(fresh volume of the point, dN/dX (8, 3))]."""
    result = []
    for point, weight in rule(kind):
        jacobian = fresh.T @ shape_gradient(point)
        result.append((weight * np.linalg.det(jacobian), shape_gradient(point) @ np.linalg.inv(jacobian)))
    return result


def isochoric(jacobian, jd):
    """J^(-2/3), continued along its tangent below a quarter of Jd."""
    edge = 0.25 * jd
    if jacobian.real > edge:
        return jacobian ** (-2 / 3)
    return edge ** (-2 / 3) - 2 / 3 * edge ** (-5 / 3) * (jacobian - edge)


def barrier(ratio):
    return 4 * (ratio - 0.6) ** 2 if ratio.real < 0.6 else 0.0


def twin_energy(fresh, position, kind, mu, kappa, theta):
    """Strain energy of one element; position may be complex (for exact derivatives by a complex step)."""
    jd = theta**3
    if kind == "one_point":
        return one_point_twin_energy(fresh, position, mu, kappa, jd)
    points = points_of(fresh, kind)
    total = 0.0
    volume, deformed = 0.0, 0.0
    for w, gradient in points:
        f = position.T @ gradient
        j = np.linalg.det(f)
        volume, deformed = volume + w, deformed + w * j
        total += w * jd * mu * (0.5 * (isochoric(j, jd) * np.sum(f * f) - 3) + barrier(j / jd))
    return total + volume * jd * kappa / 2 * (deformed / volume / jd - 1) ** 2


def one_point_twin_energy(fresh, position, mu, kappa, jd):
    volume = sum(w for w, _ in points_of(fresh, "core"))
    jacobian = sum(w * np.linalg.det(position.T @ g) for w, g in points_of(fresh, "core")) / volume
    centre = fresh.T @ shape_gradient(np.zeros(3))
    f = position.T @ shape_gradient(np.zeros(3)) @ np.linalg.inv(centre)
    mean = sum(w * position.T @ g for w, g in points_of(fresh, "core")) / volume
    stretch = np.sum(mean * mean) * volume
    patterns = {m: np.prod(NODE[:, [k for k in range(3) if m & (4, 2, 1)[k]]], axis=1) for m in (6, 3, 5, 7)}
    amplitude = {m: pattern @ (position - fresh @ f.T) / 8 for m, pattern in patterns.items()}
    for point, _ in rule("core"):
        gradient = 0
        for m, amount in amplitude.items():
            active = [k for k in range(3) if m & (4, 2, 1)[k]]
            slope = [np.prod([point[j] for j in active if j != k]) if k in active else 0.0 for k in range(3)]
            gradient = gradient + np.outer(amount, slope)
        gradient = gradient @ np.linalg.inv(centre)
        stretch = stretch + np.sum(gradient * gradient) * volume / 8
    shear = 0.5 * (isochoric(jacobian, jd) * stretch - 3 * volume)
    return jd * (mu * shear + volume * (mu * barrier(jacobian / jd) + kappa / 2 * (jacobian / jd - 1) ** 2))


def twin_gradient(fresh, position, kind, mu, kappa, theta):
    """dE/dx (8, 3) by a complex step: exact to rounding."""
    result = np.empty((8, 3))
    for a in range(8):
        for i in range(3):
            moved = position.astype(complex)
            moved[a, i] += 1e-30j
            result[a, i] = twin_energy(fresh, moved, kind, mu, kappa, theta).imag / 1e-30
    return result


def twin_force(fresh, position, kind, mu, kappa, theta):
    """sum_q w P dN/dX with the first Piola stress P = dW/dF, for elements that are not crushed."""
    jd = theta**3
    points = points_of(fresh, kind)
    volume = sum(w for w, _ in points)
    pressure = kappa * (sum(w * np.linalg.det(position.T @ g) for w, g in points) / volume / jd - 1)
    force = np.zeros((8, 3))
    for w, gradient in points:
        f = position.T @ gradient
        j, inverse_transpose = np.linalg.det(f), np.linalg.inv(f).T
        stress = (
            jd * mu * j ** (-2 / 3) * (f - np.sum(f * f) / 3 * inverse_transpose) + pressure * j * inverse_transpose
        )
        force += w * gradient @ stress.T
    return force


def random_hex(rng, amount=0.15):
    """A distorted, stretched and rotated hex (8, 3)."""
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    return (NODE + amount * rng.normal(size=(8, 3))) * rng.uniform(0.3, 1, 3) @ rotation.T


def block_mesh(rng, columns=(3, 3), core=2, exocarp=1, distort=0.1):
    """A distorted box, exocarp on top, bottom fixed: the arguments of `build_layout` as a dict."""
    nx, ny, nz = columns[0] + 1, columns[1] + 1, core + exocarp + 1
    grid = np.stack(np.meshgrid(np.arange(nx), np.arange(ny), np.arange(nz), indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(nx * ny * nz).reshape(nx, ny, nz)
    connectivity, skin = [], []
    for i in range(nx - 1):
        for j in range(ny - 1):
            for k in range(nz - 1):
                connectivity.append(number[i : i + 2, j : j + 2, k : k + 2].ravel())
                skin.append(k >= core)
    skin = np.array(skin)
    mu = np.where(skin, 10.0, 1.0)
    return {
        "positions": (grid + distort * rng.uniform(-1, 1, grid.shape)) * [0.3, 0.3, 0.2],
        "connectivity": np.array(connectivity),
        "is_exocarp": skin,
        "mu": mu,
        "kappa": 30 * mu,
        "fixed": grid[:, 2] == 0,
    }


def deformed(layout, rng, amount=0.01, theta=0.95):
    state, velocity = new_state(layout)
    place(state, positions(state) * theta + amount * rng.normal(size=(layout.nodes, 3)))
    return state, velocity


def algebra_forces(kind, fresh, position, mu, kappa, theta):
    """The kernel's algebra in float64 on a batch of elements (n, 8, 3)."""
    size = len(fresh)
    mu, kappa = np.full(size, mu), np.full(size, kappa)
    single = kind == "one_point"
    planes = one_point_planes(fresh, mu, kappa) if single else element_planes(fresh, mu, kappa, kind == "exocarp")
    forces_of = {"core": core_forces, "exocarp": exocarp_forces, "one_point": one_point_forces}[kind]
    nodes = [[position[:, a, i] for i in range(3)] for a in range(8)]
    return np.array(forces_of(NumpyArithmetic(), nodes, planes.__getitem__, theta)).transpose(2, 0, 1)


def close(actual, expected, tolerance):
    assert np.max(np.abs(actual - expected)) <= tolerance * np.max(np.abs(expected))
