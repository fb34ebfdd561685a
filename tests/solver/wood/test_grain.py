"""The grain: mean, deviation and correlation of its random factor over many draws; growth rings and rays."""

import numpy as np
import pytest

from solver.wood import SOLVER
from solver.wood.model.bundle import lay
from solver.wood.model.grain import Field, weibull_modulus
from solver.wood.model.state import Wood


@pytest.mark.parametrize("variation", [0.1, 0.4])
def test_the_factor_has_mean_1_and_the_deviation_asked_for(variation):
    """Over 4000 draws at one place; a lognormal of mean 1 has the relative deviation sqrt(exp(v^2) - 1)."""
    generator = np.random.default_rng(3)
    found = np.array([Field(0.1, 0.01, generator).factor(np.zeros((1, 3)), variation)[0] for _ in range(4000)])
    deviation = np.sqrt(np.exp(variation**2) - 1)
    assert found.mean() == pytest.approx(1, abs=4 * deviation / np.sqrt(4000))
    assert found.std() == pytest.approx(deviation, rel=0.1)
    assert np.array_equal(Field(0.1, 0.01, generator).factor(np.zeros((2, 3)), 0.0), np.ones(2))


@pytest.mark.parametrize(("axis", "length"), [(0, 0.1), (1, 0.01), (2, 0.01)])
def test_places_are_alike_within_the_correlation_length(axis, length):
    """Random cosines with normal wave vectors have the correlation exp(-d^2 / 2 l^2)."""
    generator = np.random.default_rng(5)
    points = np.zeros((3, 3))
    points[1:, axis] = length, 3 * length
    values = np.array([Field(0.1, 0.01, generator)(points) for _ in range(3000)])
    alike = np.corrcoef(values.T)[0]
    assert alike[1] == pytest.approx(np.exp(-0.5), abs=0.06)
    assert alike[2] == pytest.approx(np.exp(-4.5), abs=0.06)


@pytest.mark.parametrize("variation", [0.05, 0.1, 0.4])
def test_strength_has_mean_1_its_deviation_and_weibull_s_tail(variation):
    generator = np.random.default_rng(7)
    found = np.array([Field(0.1, 0.01, generator).strength(np.zeros((1, 3)), variation)[0] for _ in range(4000)])
    assert found.mean() == pytest.approx(1, abs=4 * variation / np.sqrt(4000))
    assert found.std() == pytest.approx(variation, rel=0.06)
    # a straight line of log(-log(share that bears more)) over log(strength), its slope the modulus
    share = (np.arange(4000) + 0.5) / 4000
    low = slice(40, 3960)
    line = np.polyfit(np.log(np.sort(found))[low], np.log(-np.log(1 - share))[low], 1)
    assert line[0] == pytest.approx(weibull_modulus(variation), rel=0.06)


def test_long_rods_are_weaker_than_short_ones_by_weibull_s_law():
    """The least strength on 2 and on 32 correlation lengths, over 600 rods: apart by 16^(-1 / m)."""
    generator = np.random.default_rng(11)
    points = np.zeros((32 * 12, 3))
    points[:, 0] = np.arange(len(points)) / 12
    least = []
    for _ in range(600):
        strength = Field(1.0, 1.0, generator).strength(points, 0.2)
        least.append((strength[:24].min(), strength.min()))
    short, long = np.mean(least, axis=0)
    assert long / short == pytest.approx(16 ** (-1 / weibull_modulus(0.2)), rel=0.04)


RINGS = {"rings": 0.008, "late": 0.5, "contrast": 4.0, "strength": 0.0}


def _laid(rods: int, **grain: object) -> Wood:
    return lay(SOLVER.parse({"rods": rods, "vertices": 4, "clamp": "none", "unevenness": 0.0, "grain": grain}), 4)


def test_late_wood_is_stiffer_by_the_contrast_and_the_bundle_keeps_its_stiffness():
    """Rings of 8 mm in a bundle of 1 cm; rods of .7 mm that lie wholly in early or in late wood, or across."""
    wood, plain = _laid(200, **RINGS), _laid(200, strength=0.0)
    first = np.searchsorted(wood.rod, np.arange(len(wood.grid)))
    away = np.linalg.norm(wood.straight[wood.grid[:, 0], 1:], axis=1)
    wide, ratio = wood.rods.radius[first], wood.rods.k[first] / plain.rods.k[first]
    within = [(away - wide > low) & (away + wide < high) for low, high in ((0.0, 0.004), (0.004, 0.008))]
    assert min(mine.sum() for mine in within) > 10
    assert ratio[within[1]] == pytest.approx(4 * ratio[within[0]].mean(), rel=1e-9)
    assert np.ptp(ratio[within[0]]) < 1e-9
    assert wood.rods.k.sum() == pytest.approx(plain.rods.k.sum(), rel=1e-9)
    # and what is bonded in early wood comes apart more easily, by the root in strength
    middle = (wood.straight[wood.rods.a[wood.bonds.i], 1:] + wood.straight[wood.rods.a[wood.bonds.j], 1:]) / 2
    near, half = np.linalg.norm(middle, axis=1), wood.bonds.rest / 2
    early, late = (((near - half > low) & (near + half < high)) for low, high in ((0.0, 0.004), (0.004, 0.008)))
    torn = wood.bonds.torn / plain.bonds.torn
    assert torn[late] == pytest.approx(4 * torn[early].mean(), rel=1e-9)


def test_rods_wider_than_rings_see_none():
    wood, plain = _laid(20, **{**RINGS, "rings": 2e-4}), _laid(20, strength=0.0)
    assert wood.rods.k == pytest.approx(plain.rods.k, rel=0.06)


def test_rays_split_from_the_pith():
    """Half of what is joined around the pith, all of what is joined along a ray; the pith stands where it is said."""
    pith = (0.004, -0.03)
    wood, plain = _laid(60, rays=0.5, pith=pith, strength=0.0), _laid(60, strength=0.0)
    one, other = (wood.straight[wood.rods.a[edge], 1:] for edge in (wood.bonds.i, wood.bonds.j))
    out, way = (one + other) / 2 - pith, one - other
    cosine = np.abs((out * way).sum(1)) / np.linalg.norm(out, axis=1) / np.linalg.norm(way, axis=1)
    share = np.sqrt(wood.bonds.torn / plain.bonds.torn)
    assert share[cosine < 0.05] == pytest.approx(0.5, abs=0.01)
    assert share[cosine > 0.999] == pytest.approx(1.0, abs=0.01)
    assert (cosine > 0.999).any()
    assert (cosine < 0.05).any()
