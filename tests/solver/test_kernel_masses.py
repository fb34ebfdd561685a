"""The scaled masses of the explicit kernel: a unit step is stable, and energy stays."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from solver.dehydration.kernel import build_layout, kinetic_energy, march, positions, strain_energy
from solver.dehydration.kernel.bounds import element_bounds, nodal_sums
from solver.dehydration.kernel.fixed_point import place
from solver.dehydration.kernel.masses import largest_stiffness

from ._kernel_twin import KINDS, algebra_forces, block_mesh, deformed, random_hex

pytestmark = pytest.mark.usefixtures("one_thread")


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


@pytest.mark.parametrize("exocarp", [False, True])
def test_compiled_bound_is_the_plain_one(exocarp):
    rng = np.random.default_rng(16)
    corners = np.stack([random_hex(rng) @ np.diag([1, 1, flat]) / 4 for flat in (1.0, 0.5, 0.1, 0.03) * 5])
    state = np.zeros((8 * len(corners), 4), np.int32)
    place(state, corners.reshape(-1, 3))
    mu, kappa = rng.uniform(0.5, 10, (2, len(corners))) * [[1], [30]]
    plain = largest_stiffness(positions(state).reshape(-1, 8, 3), mu, kappa, exocarp, one_point=False)
    connect, kind = np.arange(8 * len(corners)).reshape(-1, 8), np.full(len(corners), exocarp)
    compiled = element_bounds(state, connect, kind, mu, kappa, -np.inf, split=False)[0]
    np.testing.assert_allclose(compiled, plain, rtol=1e-12)


def test_an_inverted_element_has_no_bound():
    cube = 0.5 * np.array([[a >> 2 & 1, a >> 1 & 1, a & 1] for a in range(8)])
    folded = cube.copy()
    folded[7] = [0.1, 0.1, 0.1]
    state = np.zeros((16, 4), np.int32)
    place(state, np.concatenate([cube, folded]))
    connect = np.arange(16).reshape(2, 8)
    sound, crushed = element_bounds(state, connect, np.zeros(2, bool), np.ones(2), np.ones(2), 0.05, split=False)[0]
    assert sound > 0
    assert crushed == 0


def test_nodal_sums_are_those_of_numpy():
    rng = np.random.default_rng(17)
    connect, values = rng.integers(0, 30, (40, 8)), rng.normal(size=40)
    plain = np.bincount(connect.ravel(), weights=np.repeat(values, 8), minlength=30)
    np.testing.assert_allclose(nodal_sums(connect, values, 30), plain, rtol=1e-12, atol=1e-15)


PROBE = """
import hashlib
import numpy as np
from solver.dehydration.kernel.bounds import element_bounds
noise = np.random.default_rng(0).normal(size=(500, 8, 3))
cubes = np.array([[a >> 2 & 1, a >> 1 & 1, a & 1] for a in range(8)]) - 0.5 + 0.05 * noise
state = np.zeros((4000, 4), np.int32)
state[:, :3] = np.rint(cubes.reshape(-1, 3) / 2.0**-24)
connectivity, half = np.arange(4000).reshape(-1, 8), np.arange(500) < 250
bounds = element_bounds(state, connectivity, half, np.ones(500), np.full(500, 30.0), 0.05, split=True)
print(hashlib.sha256(bounds.tobytes()).hexdigest(), bounds[0].min() > 0)
"""


def test_bounds_are_the_same_bytes_compiled_or_loaded(tmp_path):
    """numba optimises a parallel loop once more before it keeps it: what may be reordered then has other last bits."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    compiled, loaded = (
        subprocess.run(
            [sys.executable, "-c", PROBE], env=environment, capture_output=True, text=True, check=True
        ).stdout
        for _ in range(2)
    )
    assert compiled.endswith(" True\n")
    assert compiled == loaded
