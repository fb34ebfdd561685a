"""The explicit kernel against a textbook twin in plain numpy that shares no code with it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numba
import numpy as np
import pytest

import solver.dehydration.kernel as package
from solver.dehydration.kernel import (
    build_layout,
    element_report,
    internal_force,
    kinetic_energy,
    march,
    new_state,
    place,
    positions,
    strain_energy,
)
from solver.dehydration.kernel import march as march_module_function  # the function; its module is reached below
from solver.dehydration.kernel.diagnostics import NumpyArithmetic
from solver.dehydration.kernel.elements import core_forces, exocarp_forces, one_point_forces
from solver.dehydration.kernel.masses import largest_stiffness
from solver.dehydration.kernel.metric import element_planes, one_point_planes

BACKENDS = ("vector", "scalar")
KINDS = ("core", "exocarp", "one_point")
march_module = sys.modules[march_module_function.__module__]


@pytest.fixture(autouse=True)
def one_thread():
    """Meshes are tiny and machines busy: waiting for a second thread would take most of the time."""
    numba.set_num_threads(1)
    yield
    numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)


# ---------------------------------------------------------------------------------------------------- textbook twin

NODE = np.array([[1.0 if a & bit else -1.0 for bit in (4, 2, 1)] for a in range(8)])


def shape_gradient(point):
    """dN/dxi (8, 3) of N_a = prod_k (1 + xi_k xi_ak) / 8."""
    terms = 1 + point * NODE
    return np.stack([NODE[:, k] * np.prod(np.delete(terms, k, axis=1), axis=1) / 8 for k in range(3)], axis=1)


def rule(kind):
    g = 1 / np.sqrt(3)
    cube = [(np.array([a, b, c]), 1.0) for a in (-g, g) for b in (-g, g) for c in (-g, g)]
    if kind == "exocarp":
        return [(p, 0.1 * w) for p, w in cube] + [(np.array([0, 0, z]), 0.9 * 4) for z in (-g, g)]
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


# ----------------------------------------------------------------------------------------------------------- meshes


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


def assembled_twin(mesh, layout, state, theta, one_point):
    """(nodal gradient (nn, 3), per-element gradients (ne, 8, 3), energy) from the twin in float64.

    The mesh is a `block_mesh`: three elements a column, the core's two first.
    """
    fresh, position = positions(layout.fresh), positions(state)
    nodal, each, energy = np.zeros_like(fresh), [], 0.0
    elements = zip(mesh["connectivity"], mesh["is_exocarp"], mesh["mu"], mesh["kappa"], strict=True)
    for e, (nodes, skin, mu, kappa) in enumerate(elements):
        single = one_point and e % 3 < 2 - layout.full_levels
        kind = "exocarp" if skin else "one_point" if single else "core"
        arguments = (fresh[nodes], position[nodes], kind, mu, kappa, 1.0 if skin else theta)
        each.append(twin_gradient(*arguments))
        energy += twin_energy(*arguments)
        np.add.at(nodal, nodes, each[-1])
    return nodal, np.array(each), energy


def close(actual, expected, tolerance):
    assert np.max(np.abs(actual - expected)) <= tolerance * np.max(np.abs(expected))


# ---------------------------------------------------------------------------------------------------------- algebra


def algebra_forces(kind, fresh, position, mu, kappa, theta):
    """The kernel's algebra in float64 on a batch of elements (n, 8, 3)."""
    size = len(fresh)
    mu, kappa = np.full(size, mu), np.full(size, kappa)
    single = kind == "one_point"
    planes = one_point_planes(fresh, mu, kappa) if single else element_planes(fresh, mu, kappa, kind == "exocarp")
    forces_of = {"core": core_forces, "exocarp": exocarp_forces, "one_point": one_point_forces}[kind]
    nodes = [[position[:, a, i] for i in range(3)] for a in range(8)]
    return np.array(forces_of(NumpyArithmetic(), nodes, planes.__getitem__, theta)).transpose(2, 0, 1)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("squeeze", [1.0, 0.45, 0.2, -0.3])
def test_algebra_is_the_gradient_of_the_textbook_energy(kind, squeeze):
    """Also in crushed (barrier), crushed beyond a quarter (tangent) and inverted elements."""
    rng = np.random.default_rng(1)
    theta = 0.85
    fresh = np.array([random_hex(rng) for _ in range(4)])
    position = (fresh + 0.03 * rng.normal(size=fresh.shape)) * [1.0, 1.0, squeeze] * theta
    with np.errstate(all="raise"):
        forces = algebra_forces(kind, fresh, position, 1.7, 40.0, theta)
    for x0, x, force in zip(fresh, position, forces, strict=True):
        close(force, twin_gradient(x0, x, kind, 1.7, 40.0, theta), 1e-11)
        if kind != "one_point" and squeeze == 1.0:
            close(force, twin_force(x0, x, kind, 1.7, 40.0, theta), 1e-11)


@pytest.mark.parametrize("kind", KINDS)
def test_rotation_rotates_forces_and_translation_does_nothing(kind):
    rng = np.random.default_rng(2)
    fresh = np.array([random_hex(rng) for _ in range(3)])
    position = fresh + 0.05 * rng.normal(size=fresh.shape)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    still = algebra_forces(kind, fresh, position, 1.0, 30.0, 0.9)
    moved = algebra_forces(kind, fresh, position @ turn.T + [0.3, -2.0, 1.0], 1.0, 30.0, 0.9)
    close(moved, still @ turn.T, 1e-11)
    close(still.sum(axis=1) + 1, np.ones(3), 1e-11)
    at_rest = algebra_forces(kind, fresh, fresh @ turn.T, 1.0, 30.0, 1.0)
    assert np.max(np.abs(at_rest)) < 1e-12


@pytest.mark.parametrize("kind", ["core", "one_point"])
def test_patch_of_core_elements_carries_affine_deformation_exactly(kind):
    rng = np.random.default_rng(3)
    mesh = block_mesh(rng, (2, 3), core=3, exocarp=0, distort=0.2)
    fresh = mesh["positions"][mesh["connectivity"]]
    affine = np.eye(3) + 0.2 * rng.normal(size=(3, 3))
    forces = algebra_forces(kind, fresh, fresh @ affine.T, 1.0, 30.0, 0.9)
    nodal = np.zeros_like(mesh["positions"])
    np.add.at(nodal, mesh["connectivity"], forces)
    counts = np.bincount(mesh["connectivity"].ravel())
    assert np.max(np.abs(nodal[counts == 8])) < 1e-12 * np.max(np.abs(forces))


def test_patch_of_exocarp_parallelepipeds_carries_affine_deformation_exactly():
    """The reduced rule integrates the gradients of the shape functions exactly only where the Jacobian is constant."""
    rng = np.random.default_rng(4)
    mesh = block_mesh(rng, (2, 2), core=2, exocarp=0, distort=0.0)
    slanted = mesh["positions"] @ (np.eye(3) + 0.3 * rng.normal(size=(3, 3)))
    fresh = slanted[mesh["connectivity"]]
    forces = algebra_forces("exocarp", fresh, fresh @ (np.eye(3) + 0.2 * rng.normal(size=(3, 3))), 1.0, 30.0, 0.9)
    nodal = np.zeros_like(slanted)
    np.add.at(nodal, mesh["connectivity"], forces)
    assert np.max(np.abs(nodal[13])) < 1e-12 * np.max(np.abs(forces))


# ------------------------------------------------------------------------------------------------- compiled kernel


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(("one_point", "full_levels"), [(False, 0), (True, 0), (True, 1), (True, 5)])
@pytest.mark.parametrize("columns", [(1, 1), (4, 5)])
def test_compiled_force_agrees_with_twin(backend, one_point, full_levels, columns):
    """One column fills a vector with 15 repetitions; 20 columns are a full strip and a quarter."""
    rng = np.random.default_rng(5)
    mesh = block_mesh(rng, columns)
    layout = build_layout(**mesh, full_levels=full_levels)
    state, _ = deformed(layout, rng, 0.005)
    nodal, each, energy = assembled_twin(mesh, layout, state, 0.9, one_point)
    force = internal_force(layout, state, 0.9, one_point=one_point, backend=backend)
    close(force.nodal, nodal, 2e-5)
    free = ~mesh["fixed"]
    assert force.norm == pytest.approx(np.linalg.norm(nodal[free]), rel=1e-5)
    assert force.scale == pytest.approx(np.linalg.norm(each[free[mesh["connectivity"]]]), rel=1e-5)
    assert force.relative_residual == pytest.approx(force.norm / force.scale)
    with np.errstate(all="raise"):
        assert strain_energy(layout, state, 0.9, one_point=one_point) == pytest.approx(energy, rel=1e-5)


@pytest.mark.parametrize("one_point", [False, True])
def test_back_ends_agree(one_point):
    rng = np.random.default_rng(6)
    layout = build_layout(**block_mesh(rng, (5, 5)))
    start, _ = deformed(layout, rng, 0.002, 1.0)
    results = []
    for backend in BACKENDS:
        state, velocity = start.copy(), np.zeros(start.shape, np.float32)
        march(layout, state, velocity, 40, theta=(1.0, 0.95), damping=0.05, one_point=one_point, backend=backend)
        results.append(state)
    moved = np.max(np.abs(results[0] - start))
    assert moved > 1e-3
    assert np.max(np.abs(results[0] - results[1])) < 1e-4 * moved
    assert all(np.all(result[:, 3] == 0) for result in results)
    assert all(np.array_equal(result[~layout.free], start[~layout.free]) for result in results)


def test_least_ratio_finds_the_inverted_element():
    rng = np.random.default_rng(7)
    mesh = block_mesh(rng, (3, 3))
    layout = build_layout(**mesh)
    state, _ = new_state(layout)
    ratios = element_report(layout, state, 1.0).least_ratio
    assert ratios.shape == (27,)
    assert np.allclose(ratios, 1.0, atol=1e-6)
    low, high = mesh["connectivity"][11][[0, 7]]
    state[[low, high], :3] = state[[high, low], :3]
    assert np.argmin(element_report(layout, state, 1.0).least_ratio) == 11
    assert element_report(layout, state, 1.0).least_ratio.min() < 0


def test_order_of_elements_and_of_their_nodes_does_not_matter():
    """Shuffled elements still form stacks; turned ones stand alone; the forces stay."""
    rng = np.random.default_rng(8)
    mesh = block_mesh(rng, (4, 5))
    layout = build_layout(**mesh)
    state, _ = deformed(layout, rng)
    expected = internal_force(layout, state, 0.9)
    order = rng.permutation(len(mesh["connectivity"]))
    shuffled = mesh | {name: mesh[name][order] for name in ("connectivity", "is_exocarp", "mu", "kappa")}
    again = build_layout(**shuffled)
    assert len(again.strips) == len(layout.strips)
    close(internal_force(again, state, 0.9).nodal, expected.nodal, 1e-5)
    # A quarter turn about zeta: (xi, eta) -> (eta, -xi).
    quarter = [4, 5, 0, 1, 6, 7, 2, 3]
    shuffled["connectivity"][::3] = shuffled["connectivity"][::3][:, quarter]
    turned = build_layout(**shuffled)
    assert len(turned.face_offsets) > len(layout.face_offsets)
    close(internal_force(turned, state, 0.9).nodal, expected.nodal, 1e-5)
    assert internal_force(turned, state, 0.9).scale == pytest.approx(expected.scale, rel=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_same_bytes_on_one_and_two_threads(backend):
    if numba.config.NUMBA_NUM_THREADS < 2:
        pytest.skip("only one thread")
    rng = np.random.default_rng(9)
    layout = build_layout(**block_mesh(rng, (7, 9)))
    start, _ = deformed(layout, rng, 0.002, 1.0)
    results = []
    for threads in (1, 2, 2):
        numba.set_num_threads(threads)
        state, velocity = start.copy(), np.zeros(start.shape, np.float32)
        march(layout, state, velocity, 60, theta=(1.0, 0.9), damping=0.02, backend=backend)
        results.append(state.tobytes() + velocity.tobytes())
    assert all(a == b for a, b in pairwise(results))


# ---------------------------------------------------------------------------------------------------------- masses


def stiffness(fresh, kind, mu, kappa):
    """Tangent at rest (24, 24), by central differences of the forces proved above."""
    steps = 1e-5 * np.concatenate([np.eye(24), -np.eye(24)]).reshape(48, 8, 3)
    forces = algebra_forces(kind, np.repeat(fresh[None], 48, axis=0), fresh + steps, mu, kappa, 1.0)
    return (forces[:24] - forces[24:]).reshape(24, 24) / 2e-5


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("kappa", [1.0, 30.0, 1000.0])
def test_stiffness_bound_is_safe_and_tight(kind, kappa):
    rng = np.random.default_rng(10)
    for flat in (1.0, 0.1):
        fresh = random_hex(rng) @ np.diag([1, 1, flat])
        bound = largest_stiffness(fresh[None], np.ones(1), np.full(1, kappa), kind == "exocarp")[0]
        exact = np.linalg.eigvalsh(stiffness(fresh, kind, 1.0, kappa))[-1]
        assert exact <= bound * (1 + 1e-6)
        assert bound <= exact * (1.06 if kappa >= 30 else 3.0)


def test_unit_step_is_stable_and_much_less_mass_is_not():
    rng = np.random.default_rng(11)
    layout = build_layout(**block_mesh(rng, (5, 5), distort=0.25))
    start, _ = deformed(layout, rng, 1e-4, 1.0)
    ends = []
    for lighter in (1.0, 2.5):
        layout.inverse_mass[:] *= np.float32(lighter)
        state, velocity = start.copy(), np.zeros(start.shape, np.float32)
        march(layout, state, velocity, 2000, theta=(1.0, 1.0), damping=0.0)
        ends.append(np.max(np.abs(positions(state) - positions(layout.fresh))))
    assert ends[0] < 1e-2
    assert not ends[1] < 0.1


def test_undamped_march_keeps_its_energy():
    rng = np.random.default_rng(12)
    layout = build_layout(**block_mesh(rng, (4, 4)))
    state, velocity = deformed(layout, rng, 1e-3, 1.0)
    # A softer step resolves the fastest modes, whose energy a unit step only bounds.
    layout.inverse_mass[:] /= np.float32(100)
    mass = layout.mass * 100
    totals = []
    for _ in range(20):
        before = velocity.copy()
        march(layout, state, velocity, 5, theta=(1.0, 1.0), damping=0.0)
        ahead, next_velocity = state.copy(), velocity.copy()
        march(layout, ahead, next_velocity, 1, theta=(1.0, 1.0), damping=0.0)
        middle = (velocity[:, :3].astype(float) + next_velocity[:, :3]) / 2
        totals.append(
            strain_energy(layout, state, 1.0) + 0.5 * np.sum(layout.free[:, None] * mass[:, None] * middle**2)
        )
        assert not np.array_equal(before, velocity)
    assert np.ptp(totals) < 2e-3 * totals[0]


def test_kinetic_energy_counts_free_nodes():
    layout = build_layout(**block_mesh(np.random.default_rng(13), (2, 2)))
    velocity = np.full((layout.nodes, 4), 0.5, dtype=np.float32)
    assert kinetic_energy(layout, velocity) == pytest.approx(0.5 * 0.75 * layout.mass[layout.free].sum())


# --------------------------------------------------------------------------------------------- inputs and machinery


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mu": np.ones(3)}, "mu must have shape"),
        ({"kappa": np.zeros(27)}, "kappa must be positive"),
        ({"positions": np.full((64, 3), np.nan)}, "positions must be finite"),
        ({"connectivity": np.full((27, 8), 64)}, "connectivity must name nodes"),
        ({"positions": np.zeros((64, 3))}, "27 fresh elements are inverted or flat, element 0 worst"),
    ],
)
def test_inputs_that_are_no_mesh_are_refused(change, words):
    with pytest.raises(ValueError, match=words):
        build_layout(**(block_mesh(np.random.default_rng(14)) | change))


def test_misuse_is_refused():
    layout = build_layout(**block_mesh(np.random.default_rng(15)), one_point=False)
    state, velocity = new_state(layout)
    with pytest.raises(ValueError, match="without the one-point core"):
        march(layout, state, velocity, 1, theta=(1, 1), damping=0, one_point=True)
    with pytest.raises(ValueError, match="velocity must be"):
        march(layout, state, velocity.astype(float), 1, theta=(1, 1), damping=0)
    with pytest.raises(ValueError, match="negative"):
        march(layout, state, velocity, -1, theta=(1, 1), damping=0)


def test_back_end_is_chosen_by_environment_and_falls_back(monkeypatch, caplog):
    choose = march_module.default_backend.__wrapped__

    def broken(backend):
        raise RuntimeError("no vectors here")

    monkeypatch.setattr(march_module, "compiled", broken)
    for name in BACKENDS:
        monkeypatch.setenv("WIZEN_KERNEL", name)
        assert choose() == name
    monkeypatch.setenv("WIZEN_KERNEL", "auto")
    assert choose() == "scalar"
    assert "no vectors here" in caplog.text
    monkeypatch.setenv("WIZEN_KERNEL", "gpu")
    with pytest.raises(ValueError, match="WIZEN_KERNEL"):
        choose()


PROBE = """
import numpy as np
from solver.dehydration.kernel import build_layout, internal_force, new_state, place, positions
from solver.dehydration.kernel.march import compiled
cube = np.array([[a >> 2 & 1, a >> 1 & 1, a & 1] for a in range(8)], dtype=float)
layout = build_layout(cube, [range(8)], [False], [1.0], [30.0], np.zeros(8, bool))
state, _ = new_state(layout)
place(state, positions(state) * 1.1)
print(internal_force(layout, state, 1.0, backend="vector").norm, sum(compiled("vector").stats.cache_hits.values()))
"""


def test_cache_is_used_across_processes_and_never_stale(tmp_path):
    """numba keys its cache by the file of the function; ours by every source the function is made of."""
    kernel = tmp_path / "solver" / "dehydration" / "kernel"
    shutil.copytree(Path(package.__file__).parent, kernel, ignore=shutil.ignore_patterns("__pycache__"))
    for module in Path(package.__file__).parent.parent.glob("contact*.py"):
        shutil.copy(module, kernel.parent)
    for parent in (kernel.parent, kernel.parent.parent):
        (parent / "__init__.py").touch()
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}

    def probe():
        run = subprocess.run(
            [sys.executable, "-c", PROBE], env=environment, cwd=tmp_path, capture_output=True, text=True, check=True
        )
        norm, hits = run.stdout.split()
        return float(norm), int(hits)

    first, hits = probe()
    assert hits == 0
    assert probe() == (first, 1)
    source = kernel / "elements.py"
    text = source.read_text()
    source.write_text(
        text.replace("pressure = plane(KAPPA) * (ratio - 1.0)", "pressure = 2.0 * plane(KAPPA) * (ratio - 1.0)")
    )
    changed, hits = probe()
    assert hits == 0
    assert changed == pytest.approx(2 * first, rel=1e-5)
    source.write_text(text)
    assert probe() == (first, 1)


def test_generated_module_finds_a_writable_directory(tmp_path, monkeypatch):
    from solver.dehydration.kernel import generate

    blocked = tmp_path / "file"
    blocked.touch()
    monkeypatch.setattr(generate, "cache_directories", lambda: iter([blocked / "sub", tmp_path / "good"]))
    path = generate.generated_path()
    assert path.parent == tmp_path / "good"
    assert path.read_text() == generate.module_source()
    assert list(path.parent.iterdir()) == [path]
    monkeypatch.setattr(generate, "cache_directories", lambda: iter([blocked / "sub"]))
    with pytest.raises(OSError, match="NUMBA_CACHE_DIR"):
        generate.generated_path()
