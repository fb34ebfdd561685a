"""Targets changed in the middle of a run: exact statements about stress, energy and what is left alone."""

from __future__ import annotations

import numpy as np
import pytest

from solver.dehydration.kernel import (
    build_layout,
    element_report,
    internal_force,
    new_state,
    place,
    strain_energy,
)
from solver.dehydration.kernel.reload import reload

from ._loaded import drive_of, parse

pytestmark = pytest.mark.usefixtures("one_thread")


def block(fixed=False):
    """A skewed block of 2 x 2 x 3 core elements, free: all of its nodes move."""
    grid = np.stack(np.meshgrid(np.arange(3), np.arange(3), np.arange(4), indexing="ij"), axis=-1) * 0.2
    points = grid.reshape(-1, 3) + 0.02 * np.random.default_rng(3).uniform(-1, 1, (36, 3))
    number = np.arange(36).reshape(3, 3, 4)
    cells = [
        [number[i + (c >> 2 & 1), j + (c >> 1 & 1), k + (c & 1)] for c in range(8)]
        for i in range(2)
        for j in range(2)
        for k in range(3)
    ]
    ones = np.ones(len(cells))
    return build_layout(points, cells, ones == 0, ones, 100 * ones, np.full(36, fixed)), points


@pytest.mark.parametrize("one_point", [False, True])
@pytest.mark.parametrize("fd", [(0.7, 0.9, 0.95), (1.3, 1.1, 0.8)])
def test_a_free_block_that_takes_up_fd_is_free_of_stress(fd, one_point):
    fresh, points = block()
    theta = 0.75
    layout = reload(fresh, fresh, np.tile(np.array(fd) / theta, (fresh.elements, 1)))
    state, _ = new_state(layout, points * fd)
    report = element_report(layout, state, theta, one_point=one_point)
    assert report.least_ratio == pytest.approx(1.0, abs=1e-6)
    # stored planes are float32: volume times mu times a few 1e-7
    assert np.abs(report.energy).max() < 5e-7 * 0.2**3
    stretched, _ = new_state(layout, points * fd * [1.01, 1.0, 1.0])
    scale = internal_force(layout, stretched, theta, one_point=one_point).scale
    assert internal_force(layout, state, theta, one_point=one_point).norm < 1e-4 * scale


@pytest.mark.parametrize("one_point", [False, True])
def test_energy_is_that_of_the_definition(one_point):
    """An affine motion of a block: sum of V det(Fd) [mu/2 (I1(Fe) Je^(-2/3) - 3) + kappa/2 (Je - 1)^2]."""
    fresh, points = block()
    theta, fd = 0.8, np.array([0.7, 0.9, 0.95])
    motion = np.diag([0.75, 0.85, 0.97]) + 0.05 * np.random.default_rng(1).normal(size=(3, 3))
    layout = reload(fresh, fresh, np.tile(fd / theta, (fresh.elements, 1)))
    state, _ = new_state(layout, points @ motion.T)
    elastic = motion / fd
    j = np.linalg.det(elastic)
    density = 0.5 * (np.square(elastic).sum() * j ** (-2 / 3) - 3) + 50 * (j - 1) ** 2
    volume = (1 / fresh.core_planes[:, 2])[fresh.core_elements >= 0].sum()
    assert strain_energy(layout, state, theta, one_point=one_point) == pytest.approx(
        volume * fd.prod() * density, rel=1e-5
    )


@pytest.mark.parametrize("one_point", [False, True])
def test_force_is_the_gradient_of_the_energy_after_a_reload(one_point):
    params = parse(wetness=(0.3, 0.2, -0.4), anisotropy=(1.0, 0.4, 1.5))
    _, fresh, drive = drive_of(params, n=3, layers=2, one_point=one_point)
    shrinkage, generator = 0.2, np.random.default_rng(5)
    layout = drive.loaded(fresh, shrinkage)
    base = drive.smooth(shrinkage)
    base[layout.free] += 2e-3 * generator.normal(size=(int(layout.free.sum()), 3))
    along = generator.normal(size=base.shape) * layout.free[:, None]
    state, _ = new_state(layout)
    energies = []
    for step in (-1e-5, 1e-5):
        place(state, base + step * along)
        energies.append(strain_energy(layout, state, 1 - shrinkage, one_point=one_point))
    place(state, base)
    force = internal_force(layout, state, 1 - shrinkage, one_point=one_point).nodal
    assert (force * along).sum() == pytest.approx((energies[1] - energies[0]) / 2e-5, rel=2e-4)


def test_equal_factors_are_the_same_as_more_shrinkage():
    """Anisotropy (a, a, a) at s is isotropic shrinkage a s: same energies and forces in any state."""
    _, fresh, drive = drive_of(parse(anisotropy=(1.5, 1.5, 1.5)))
    layout = drive.loaded(fresh, 0.1)
    where = drive.smooth(0.1)
    where[fresh.free] *= 1.002
    state, _ = new_state(fresh, where)
    mine, same = internal_force(layout, state, 0.9), internal_force(fresh, state, 0.85)
    assert np.abs(mine.nodal - same.nodal).max() < 2e-4 * np.abs(same.nodal).max()
    assert strain_energy(layout, state, 0.9) == pytest.approx(strain_energy(fresh, state, 0.85), rel=1e-4)


def test_reload_leaves_all_but_the_cores_targets_alone():
    fresh, _ = block()
    layout = reload(fresh, fresh, np.ones((fresh.elements, 3)))
    assert (layout.core_planes == fresh.core_planes).all()
    assert layout.mass is fresh.mass
    assert layout.core_planes.ctypes.data % 64 == 0
    with pytest.raises(ValueError, match="positive"):
        reload(fresh, fresh, np.zeros((fresh.elements, 3)))
    with pytest.raises(ValueError, match="shape"):
        reload(fresh, fresh, np.ones((fresh.elements, 2)))
