"""The bonds of a bundle as one material: a net across the grain."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.stats import qmc

from solver.wood import SOLVER
from solver.wood.model.bundle import lay
from solver.wood.model.section import apart

from ._bonds_twin import bond_energies


@pytest.mark.parametrize("unevenness", [0.0, 0.5])
def test_a_bundle_pulled_across_the_grain_has_the_modulus_asked_for(unevenness):
    """Its stiffness by the energies of small strains of the section; 1 over the compliance in any direction."""
    values = {"rods": 300, "vertices": 4, "length": 0.05, "radius": 0.01, "clamp": "none", "fracture": "none"}
    grain = {"stiffness": 0.0, "strength": 0.0}
    params = SOLVER.parse({**values, "grain": grain, "unevenness": unevenness, "transverse": 4e8})
    wood = lay(params, 4)
    x, size = wood.motion.x, 1e-4

    def energy(yy: float, zz: float, yz: float) -> float:
        strain = size * np.array([[yy, yz / 2], [yz / 2, zz]])
        moved = x.copy()
        moved[:, 1:] += x[:, 1:] @ strain
        return float(bond_energies(wood, moved).sum())

    unit = np.eye(3)
    single = [energy(*e) for e in unit]
    stiffness = np.diag(2 * np.array(single))
    for p, q in ((0, 1), (0, 2), (1, 2)):
        stiffness[p, q] = stiffness[q, p] = energy(*(unit[p] + unit[q])) - single[p] - single[q]
    stiffness /= size**2 * np.pi * params.radius**2 * params.length
    compliance = np.linalg.inv(stiffness)
    for angle in np.linspace(0, np.pi, 7)[:-1]:
        c, s = np.cos(angle), np.sin(angle)
        stress = np.array([c * c, s * s, c * s])
        assert 1 / (stress @ compliance @ stress) == pytest.approx(params.transverse, rel=0.05)


@pytest.mark.parametrize("least", [0.5, 0.13, 0.04])
def test_rods_stand_where_scipy_s_poisson_disk_has_them(least):
    """Bundles that were laid by it are laid the same; and no point of the square is free any more, or nearly none."""
    found = apart(least, np.random.default_rng(3))
    twin = qmc.PoissonDisk(2, radius=least, rng=np.random.default_rng(3)).fill_space()
    assert found.tobytes() == twin.tobytes()
    assert np.asarray(cKDTree(found).query(found, 2)[0])[:, 1].min() > least * (1 - 1e-6)
    anywhere = np.random.default_rng(0).uniform(size=(20_000, 2))
    assert (np.asarray(cKDTree(found).query(anywhere)[0]) > least).mean() < 0.03
