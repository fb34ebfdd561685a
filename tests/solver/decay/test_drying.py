"""Water lost in changing air against SciPy's quadrature."""

import pytest
from scipy.integrate import quad

from solver.decay import DecayParams
from solver.decay.environment import deficit, water_lost
from solver.decay.surfaces.surface import extent


def test_water_lost_is_the_integral_of_the_deficit():
    """Ever colder and drier air: the deficit is no polynomial of the day."""
    weather = [{"day": 0, "temperature": 22.2, "humidity": 80}, {"day": 10, "temperature": 2.0, "humidity": 40}]
    params = DecayParams(weather=weather)
    fresh = extent(params)
    drawn = quad(lambda day: float(deficit(params, day)), 0, 10, epsrel=1e-12)[0]
    # r1 of a density of 1 g/cm^3; a conductance in g/(m2 s MPa), a deficit in Pa day
    skin = fresh.area * (params.weight * 1e-6 / fresh.volume) ** (2 / 3)
    grams = params.transpiration * skin * drawn * 1e-6 * 24 * 3600
    assert water_lost(params, fresh, 10.0) == pytest.approx(grams / params.weight, rel=1e-6)
