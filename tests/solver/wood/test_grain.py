"""The grain's random factor: mean, deviation and correlation over many draws."""

import numpy as np
import pytest

from solver.wood.model.grain import Field, weibull_modulus


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
