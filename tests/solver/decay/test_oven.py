"""Heat in a fruit against the series of a ball, its budget, browning, and what a run in an oven hands over."""

import numpy as np
import pytest
from scipy.optimize import brentq

from solver.contract import InvalidGeometry, Need
from solver.decay import SOLVER, DecayParams
from solver.decay.environment import saturation
from solver.decay.surfaces.surface import extent, lay
from solver.decay.within.joint import joined
from solver.decay.within.roast import Roast

BASE = {"stone": (0, 0), "weight": 138.0, "temperature": 20.0, "within": {}, "oven": {}}


def roast(count: int = 6000, **more: object) -> tuple[Roast, DecayParams]:
    params = DecayParams.parse({**BASE, **more})
    joint = joined(lay(params, 16), count, 0.01)
    assert params.within is not None
    assert params.oven is not None
    return Roast(params, params.within, params.oven, joint, extent(params)), params


def test_heat_goes_into_a_ball_as_the_series_says():
    """Carslaw and Jaeger: convection, Biot 1.9, below boiling and without water that leaves; mean and middle."""
    found, params = roast(12000, oven={"celsius": 95}, transpiration=0.0, open_transpiration=0.0)
    oven, radius = params.oven, (138e-6 / (4 / 3 * np.pi)) ** (1 / 3)
    biot = oven.film * radius / oven.conductivity
    roots = [brentq(lambda b: b / np.tan(b) + biot - 1, (n + 1e-9) * np.pi, (n + 1 - 1e-9) * np.pi) for n in range(40)]
    state, medium = found.fresh, found.joint
    middle = len(medium.cover.points) + int(np.argmin(np.linalg.norm(medium.flesh, axis=1)))
    for step in range(1, 181):
        state = found.advance(state, 20.0)
        if step not in (15, 45, 180):
            continue
        fo = oven.diffusivity * step * 20 / radius**2
        terms = [(b, b * b + biot * (biot - 1), np.exp(-b * b * fo)) for b in roots]
        mean = sum(6 * biot**2 * e / (b * b * c) for b, c, e in terms)
        core = sum(2 * biot * (b * b + (biot - 1) ** 2) / c * np.sin(b) / b * e for b, c, e in terms)
        assert (95 - medium.mean(state.warm)) / 75 == pytest.approx(mean, abs=5e-3)
        assert (95 - state.warm[middle]) / 75 == pytest.approx(core, abs=7e-3)
    assert state.wet.min() == pytest.approx(1, rel=1e-12)


def test_heat_that_came_in_is_what_the_air_gave():
    """Stored and latent heat against the film's, which is summed up here."""
    found, params = roast()
    missing = []
    for seconds in (20.0, 5.0):
        state, given = found.fresh, 0.0
        for _ in range(int(3000 / seconds)):
            before = state.warm[: len(found.area)]
            state = found.advance(state, seconds)
            skin = (before + state.warm[: len(found.area)]) / 2
            given += seconds * float(np.sum(found.area * params.oven.film * (180 - skin)))
        missing.append(abs(state.heat / given - 1))
        assert 0.1 < found.lost(state.wet) < 0.25
        assert state.warm.max() < 180
    assert missing[0] < 0.03
    assert missing[1] < 0.5 * missing[0]


def test_what_is_wet_does_not_get_hotter_than_boiling_water():
    found, _ = roast(oven={"celsius": 250, "film": 60})
    state = found.fresh
    for _ in range(180):
        state = found.advance(state, 20.0)
    assert state.warm[state.wet > 0.01].max() < 100.01
    assert state.warm[state.wet < 1e-6].max() > 120
    assert state.wet.min() >= 0


def test_skin_gives_off_what_its_vapour_pressure_drives():
    found, params = roast(open_transpiration=3.0, transpiration=0.2)
    film = 25.0 / 1206.0 / (0.46153 * 293.15) * 1e6
    alone = 1e-6 * 3.0 * film / (3.0 + film)
    at = found.evaporates(np.array([20.0, 80.0]), np.ones(2))
    air = params.humidity / 100 * saturation(20.0)
    assert at == pytest.approx(alone * (0.98 * saturation(np.array([20.0, 80.0])) - air), rel=1e-9)


def test_skin_browns_as_a_crust_does():
    """At one temperature: 1 - exp(-k t), k of Zanoni et al. 1995; a quarter of an hour at 150 degC."""
    found, _ = roast(oven={"celsius": 150, "film": 500}, transpiration=0.0, open_transpiration=0.0)
    dry = np.zeros_like(found.fresh.wet)
    state = found.fresh._replace(warm=np.full_like(dry, 150.0), wet=dry)
    for _ in range(45):
        state = found.advance(state, 20.0)
    rate = 42_000 * np.exp(-64_151 / 8.314462618 / 423.15)
    assert state.brown == pytest.approx(1 - np.exp(-rate * 900), rel=1e-3)


def test_a_run_in_an_oven_shrinks_dries_and_browns_and_nothing_rots():
    values = {"body": "quasi-static", "within": {}, "oven": {"celsius": 200}}
    need = Need(stages=(0, 0.02, 0.05), quality="preview", resolution=16)
    run = SOLVER.solve(SOLVER.parse(values, preset="apple"), need)
    assert run.attrs["path"] == "oven"
    assert run["rot"].max() == 0
    lost, brown = run["water_lost"].values, run["roasted"].values
    assert lost[0] == 0
    assert 0.03 < lost[1] < lost[2] < 0.6
    assert brown[0].max() == 0
    assert 0 < brown[1].mean() < brown[2].mean() < 1
    warm = run["flesh_temperature"].values
    assert warm[0] == pytest.approx(22.2)
    assert 60 < warm[2].min() < warm[2].max()
    size = np.linalg.norm(run["position"].values, axis=-1).mean(axis=(1, 2))
    assert size[2] < size[1] < size[0]
    alone = SOLVER.solve(SOLVER.parse(values, preset="apple"), need.model_copy(update={"stages": (0.05,)}))
    assert np.array_equal(alone["flesh_temperature"].values[0], warm[2])


def test_an_oven_without_flesh_and_two_airs_are_refused():
    with pytest.raises(InvalidGeometry, match="give within"):
        DecayParams.parse({"oven": {}})
    weather = ({"day": 0, "temperature": 20, "humidity": 50},)
    with pytest.raises(InvalidGeometry, match="weather"):
        DecayParams.parse({"oven": {}, "within": {}, "weather": weather})
