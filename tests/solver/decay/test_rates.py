"""The paper's constants in days and r1, the air's dryness and the clocks of colonies, each worked out anew here."""

import numpy as np
import pytest

from solver.decay import SOLVER, DecayParams
from solver.decay.environment import deficit, water_lost
from solver.decay.fields.colony import PAPER_MOULDS
from solver.decay.fields.layer import Layer
from solver.decay.fields.rates import daily
from solver.decay.fields.system import System
from solver.decay.surfaces.surface import extent, geodesic, triangulated

#: The paper's width of the map, 1, is the girth of the fruit: lengths there are 2 pi r1.
R1 = 1 / (2 * np.pi)
#: Its climate and its kinetics.
PAPER = {"climate": "paper", "mould": PAPER_MOULDS["penicillium-expansum"].model_dump()}


def test_table_3_on_a_fruit_of_the_paper():
    """Eq. 4 and 9 by hand: 25 degC are 77 F; s adds 3 + 77 + 60 + 80 (Eq. 4); a day has 7 steps at growth rate 50."""
    params = SOLVER.parse(
        {**PAPER, "porosity": 3.0, "temperature": 25.0, "humidity": 60.0, "water_content": 80.0, "growth_rate": 25.0}
    )
    colony = params.mould
    rates = daily(colony, params, 40.0)
    steps = 3.5
    assert colony.pace == 7.0
    assert rates.mobility * R1**2 == pytest.approx(steps * 220 * 0.01 * 0.01, rel=1e-12)
    assert rates.feed * R1**2 == pytest.approx(steps * 1e-6, rel=1e-12)
    assert rates.consume == pytest.approx(steps * 5.0, rel=1e-12)
    assert rates.wither == pytest.approx(steps * 5.0, rel=1e-12)
    # u (1 - u / d2) is largest in the middle
    u = np.linspace(0, 0.01, 10001)
    assert rates.fastest == pytest.approx(rates.mobility * (u * (1 - u / 0.01)).max(), rel=1e-7)


@pytest.mark.parametrize(("name", "per_cent"), [("porosity", 7.0), ("humidity", 4.0), ("water_content", 11.0)])
def test_each_per_cent_adds_to_the_scale_s(name, per_cent):
    """Warm and moist enough that Eq. 6 damps nothing: 72 F and 50 %, or more."""
    values = {**PAPER, "porosity": 3.0, "temperature": 30.0, "humidity": 60.0, "water_content": 80.0}
    few = SOLVER.parse(values)
    many = SOLVER.parse(values | {name: values[name] + per_cent})
    s = 3 + (32 + 1.8 * 30) + 60 + 80
    ratio = daily(many.mould, many, 30.0).mobility / daily(few.mould, few, 30.0).mobility
    assert ratio == pytest.approx((s + per_cent) / s, rel=1e-12)


def test_nutrient_evens_out_at_its_rate():
    """No organism: n spreads alone. A harmonic of degree 1 falls by exp(-2 D t) on the unit sphere, D in girths^2."""
    params = SOLVER.parse({**PAPER, "growth_rate": 50.0, "mould": {"nutrient_diffusion": 2e-4}})
    sphere = triangulated(*geodesic(12))
    y = sphere.points[:, 1]
    layer = Layer(sphere, daily(params.mould, params, 30.0), 0.5 + 0.1 * y, np.ones_like(y))
    state = layer.fresh
    for _ in range(10):
        state = layer.advance(state, 1.0)
    d = 7 * 2e-4 * (2 * np.pi) ** 2
    factor = np.sum(sphere.area * (state.n - 0.5) * y) / np.sum(sphere.area * 0.1 * y * y)
    assert factor == pytest.approx(np.exp(-2 * d * 10), rel=0.01)


def wagner(celsius: float) -> float:
    """Return the saturation pressure [Pa] of Wagner and Pruss 1993: what Goff and Gratch is within 0.12 % of."""
    tau = 1 - (celsius + 273.15) / 647.096
    powers = ((1, -7.85951783), (1.5, 1.84408259), (3, -11.7866497), (3.5, 22.6807411), (4, -15.9618719))
    terms = sum(a * tau**p for p, a in powers) + 1.80122502 * tau**7.5
    return float(22.064e6 * np.exp(terms / (1 - tau)))


@pytest.mark.parametrize("humidity", [20.0, 50.0, 90.0])
def test_air_draws_water_from_what_is_nearly_pure_water(humidity):
    """The paper's surface has a water activity of 0.98, so it loses nothing where the air is as moist as that."""
    params = DecayParams(temperature=22.0, humidity=humidity)
    assert deficit(params) == pytest.approx(wagner(22.0) * (0.98 - humidity / 100), rel=2e-3)
    assert deficit(DecayParams(temperature=22.0, humidity=98.0)) == pytest.approx(0, abs=1e-9 * wagner(22.0))
    assert deficit(DecayParams(temperature=22.0, humidity=97.0)) > 0
    # Eq. 10 in grams: K [g / (m^2 s MPa)] times area, dryness and a day, over the fresh weight
    fresh = extent(params)
    r1 = (params.weight * 1e-6 / fresh.volume) ** (1 / 3)
    grams = params.transpiration * fresh.area * r1**2 * wagner(22.0) * (0.98 - humidity / 100) * 1e-6 * 24 * 3600
    assert water_lost(params, fresh, 2.0) == pytest.approx(2 * grams / params.weight, rel=2e-3)


@pytest.mark.parametrize("rate", [0.0, 5.0, 9.0])
def test_a_colony_spawns_with_the_paper_s_chance(rate):
    """1 / (10 - rate) of its spawnings (D22): 12 a day of two wounds, counted over some thousand landings."""
    system = System(SOLVER.parse({"climate": "paper", "propagation_rate": rate, "spawning": 12.0}), 4, True)
    expected = 2000
    until = expected / (2 * 12.0 / (10 - rate))
    for spawner, strays in ((system.arrivals.rot, 0.0), (system.arrivals.mould, 2.0)):
        count = 0
        while spawner.next < until:
            count += not spawner.land().stray
        assert count == pytest.approx(expected, abs=4 * np.sqrt(expected)), strays
