"""The air against tables, and whole runs: frames, skips, the gate, spawning, presets."""

import json

import numpy as np
import pytest

from solver.contract import Context, InvalidInput, Need
from solver.decay import SOLVER, DecayParams, Wound
from solver.decay.climate import warmth
from solver.decay.environment import damping, deficit, saturation, water_lost
from solver.decay.fields.colony import PAPER_MOULDS, PAPER_ROT
from solver.decay.fields.spawning import Spawner
from solver.decay.fields.stepping import march
from solver.decay.fields.system import System
from solver.decay.presets import ENVIRONMENTS
from solver.decay.settings import choose
from solver.decay.surfaces.surface import extent

#: The paper's climate and kinetics, which start at once.
PAPER = {
    "climate": "paper",
    "rot": PAPER_ROT.model_dump(),
    "mould": PAPER_MOULDS["penicillium-expansum"].model_dump(),
}
FAST = {**PAPER, "growth_rate": 100.0, "propagation_rate": 8.0, "spawning": 1.0, "rot_spawning": 6.0}


@pytest.mark.parametrize(
    ("celsius", "pascal"),
    # Smithsonian Meteorological Tables, saturation over water
    [(0, 610.78), (10, 1227.2), (20, 2337.3), (25, 3167.1), (30, 4243.0), (40, 7377.7), (100, 101324.6)],
)
def test_saturation_pressures_are_the_tabulated_ones(celsius, pascal):
    assert saturation(celsius) == pytest.approx(pascal, rel=3e-5)


@pytest.mark.parametrize("celsius", [5.0, 22.2222, 30.0, 60.0])
def test_saturation_pressures_are_near_those_of_steam_tables(celsius):
    """Wagner and Pruss 1993, the equation behind IAPWS's tables: Goff and Gratch differ by less than 0.12 %."""
    tau = 1 - (celsius + 273.15) / 647.096
    terms = -7.85951783 * tau + 1.84408259 * tau**1.5 - 11.7866497 * tau**3 + 22.6807411 * tau**3.5
    terms += -15.9618719 * tau**4 + 1.80122502 * tau**7.5
    assert saturation(celsius) == pytest.approx(22.064e6 * np.exp(terms / (1 - tau)), rel=1.2e-3)


def test_the_room_of_the_paper():
    room = DecayParams()
    assert saturation(22.2222) == pytest.approx(2679, abs=1)
    assert damping(room.temperature, room.humidity) == pytest.approx(1, abs=1e-3)
    assert damping(-10, 0) == 0
    assert all(0 <= damping(e["temperature"], e["humidity"]) <= 1 for e in ENVIRONMENTS.values())
    assert deficit(DecayParams(humidity=100)) == 0


@pytest.mark.parametrize(
    ("fruit", "daily"), [("apple", 0.0018), ("pear", 0.0069), ("tomato", 0.010), ("orange", 0.091), ("peach", 0.177)]
)
def test_daily_losses_of_table_1(fruit, daily):
    params = SOLVER.parse({"radii": (1.0,) * 8}, f"{fruit}-paper")
    fresh = extent(params)
    assert water_lost(params, fresh, 1.0) == pytest.approx(daily, rel=0.1)
    assert water_lost(params, fresh, 1e6) == params.water_content / 100


def test_water_lost_in_changing_air_is_the_integral():
    """Humidity falls evenly at a steady temperature: the mean of both ends, exactly."""
    fresh = extent(DecayParams())
    falling = [{"day": 0, "temperature": 22.2, "humidity": 80}, {"day": 10, "temperature": 22.2, "humidity": 40}]
    lost = water_lost(DecayParams(weather=falling), fresh, 10.0)
    ends = [water_lost(DecayParams(humidity=h), fresh, 10.0) for h in (80, 40)]
    assert lost == pytest.approx(sum(ends) / 2, rel=1e-12)
    assert water_lost(DecayParams(weather=falling), fresh, 14.0) == pytest.approx(lost + 0.4 * ends[1], rel=1e-12)
    with pytest.raises(InvalidInput, match="must rise"):
        SOLVER.parse({"weather": falling[::-1]})


def test_steady_weather_is_the_climate_and_frost_stops_the_front():
    air = {"temperature": 22.2, "humidity": 50.0}
    (plain,) = stages(system(), (3.0,))
    (same,) = stages(system(weather=[{"day": 1, **air}, {"day": 2, **air}]), (3.0,))
    # the error is measured on every step in weather, so the steps differ
    assert system().distance(plain.state, same.state) < 5e-3
    frost = [{"day": 0, **air}, {"day": 1.5, **air}, {"day": 1.6, "temperature": -10.0, "humidity": 0.0}]
    cold = system(spawning=0.0, rot_spawning=0.0, weather=frost)
    reached = stages(cold, (1.6, 5.0))
    gone = [cold.rot.share(r.state.rot) > 0 for r in reached]
    assert gone[0].sum() == gone[1].sum() > 0


def system(cells: int = 8, mould: bool = True, **more: object) -> System:
    return System(SOLVER.parse({**FAST, **more}), cells, mould)


def stages(system: System, days: tuple[float, ...]) -> list:
    return list(march(system, days, 3e-4, 0.3, Context()))


def test_frames_do_not_change_the_rot():
    few = stages(system(), tuple(np.linspace(0, 4, 25)))
    many = stages(system(), tuple(np.linspace(0, 4, 97)))
    for a, b in zip(few, many[::4], strict=True):
        assert a.day == b.day
        assert a.steps == b.steps
        for x, y in zip(a.state[:2], b.state[:2], strict=True):
            assert np.array_equal(x.u, y.u)
            assert np.array_equal(x.n, y.n)
        assert a.state.water == b.state.water


def test_the_age_of_rot_is_the_time_since_its_front_came():
    """Age falls along a meridian by the distance over the front's speed, and day less age stays."""
    # without noise everything depends on the distance from the wound alone
    even = {"noise": 0.0, "unevenness": 0.0, "spawning": 0.0, "rot_spawning": 0.0, "radii": (1.0,) * 8}
    found = System(SOLVER.parse({**even, "wounds": ({"colatitude": 0},)}), 32, False)
    early, late = stages(found, (7.0, 9.0))
    ages = [found.age(at.state, at.day) for at in (early, late)]
    old = ages[0] > 0
    assert 50 < old.sum() < len(old) / 2
    # within a step it comes evenly, and a stage that is shown ends one of its own
    np.testing.assert_allclose(ages[1][old] - ages[0][old], 2.0, atol=1e-3)
    assert ((ages[1] > 0) == (found.rot.share(late.state.rot) >= 0.1)).all()
    ring = (ages[1] > 0.2) & (ages[1] < 1.8)
    far = np.arccos(np.clip(found.surface.points[:, 1] / np.linalg.norm(found.surface.points, axis=1), -1, 1))
    slope, _ = np.polyfit(ages[1][ring], 1.04 * far[ring], 1)
    # the front of the model runs at the speed that its species was measured to have, in mm a day
    speed = found.params.rot.speed * float(warmth(found.params.rot, found.params.temperature)) / found.skin.radius
    assert -slope == pytest.approx(speed, rel=0.1)


def test_the_rot_without_mould_is_the_rot_with_it():
    # steps follow the harder of the two, so they differ; the colonies do not, and the fields hardly
    alone, both = system(mould=False), system(mould=True)
    days = (1.0, 3.0)
    for a, b in zip(stages(alone, days), stages(both, days), strict=True):
        assert a.state.mould is None
        gap = np.abs(alone.rot.share(a.state.rot) - both.rot.share(b.state.rot)).max()
        assert gap < 0.02


def test_mould_is_only_where_rot_is():
    whole = system(cells=16)
    for reached in stages(whole, (0.0, 1.0, 2.0, 3.0)):
        rot, mould = reached.state[:2]
        fresh = whole.rot.share(rot) < 0.001
        assert (mould.u + mould.v)[fresh].max(initial=0) == 0
        assert fresh.any() or reached.day >= 3


def test_budgets_close_to_round_off_with_every_colony_that_lands():
    whole = system()
    for reached in stages(whole, (0.0, 2.0, 5.0, 9.0)):
        assert whole.rot.budget_error(reached.state.rot) < 1e-13
        assert whole.mould.budget_error(reached.state.mould) < 1e-13
    assert reached.state.rot.n.min() >= 0
    assert len(whole.arrivals.mould._parents) > 2


def test_halving_the_tolerated_error_lands_on_the_same_rot():
    coarse, fine = system(spawning=0.0, rot_spawning=0.0), system(spawning=0.0, rot_spawning=0.0)
    (a,) = march(coarse, (3.0,), 3e-4, 0.3, Context())
    (b,) = march(fine, (3.0,), 1e-5, 0.3, Context())
    assert a.steps < b.steps
    assert coarse.distance(a.state, b.state) < 5e-3


def test_clocks_run_at_their_rate_and_land_within_reach():
    spawner = Spawner(2.0, 0.0, 0.4, np.random.default_rng(0))
    home = np.array([0.0, 0.0, 1.0])
    spawner.settle(home, 0.0)
    landings = []
    while spawner.next < 500:
        landings.append(spawner.land())
    assert len(landings) == pytest.approx(1000, abs=4 * np.sqrt(1000))
    angles = np.arccos([np.clip(at.direction @ home, -1, 1) for at in landings])
    assert angles.max() <= 0.4 + 1e-9
    # even over the cap: half of them within the angle of half its area
    assert np.mean(angles < np.arccos((1 + np.cos(0.4)) / 2)) == pytest.approx(0.5, abs=0.07)


def test_no_wounds_no_rot():
    untouched = System(SOLVER.parse({"wounds": []}), 8, True)
    (end,) = stages(untouched, (5.0,))
    assert not end.state.rot.u.any()
    assert not end.state.mould.u.any()


def test_a_wound_stays_where_it_was_put():
    one = System(
        SOLVER.parse({**PAPER, "growth_rate": 20.0, "wounds": [Wound(colatitude=90, azimuth=90).model_dump()]}),
        16,
        True,
    )
    (end,) = stages(one, (3.0,))
    middle = (one.surface.points * (end.state.rot.u + end.state.rot.v)[:, None]).sum(axis=0)
    assert middle[2] > 0.95 * np.linalg.norm(middle)


def test_asking_for_no_mould_computes_none_and_asking_for_water_steps_nothing():
    params = SOLVER.parse({**PAPER, "growth_rate": 100.0})
    need = {"stages": (1.0,), "quality": "preview"}
    rot = SOLVER.solve(params, Need(fields=("mean_rot",), **need))
    assert rot.attrs["path"] == "rot"
    water = SOLVER.solve(params, Need(fields=("water_lost",), **need))
    assert water.attrs["path"] == "closed-form"
    assert int(water.iterations[-1]) == 0
    assert float(water.water_lost[0]) > 0


def test_fields_lie_on_the_lattice_between_0_and_1():
    params = SOLVER.parse({**PAPER, "growth_rate": 100.0})
    run = SOLVER.solve(
        params, Need(stages=(0.0, 2.0), quality="preview", resolution=32, fields=("rot", "mould", "position"))
    )
    assert run.rot.shape == (2, 32, 64)
    assert run.position.shape == (2, 32, 64, 3)
    for name in ("rot", "mould"):
        assert 0 <= float(run[name].min()) < float(run[name].max()) <= 1
    assert float(run.rot[1].mean()) > float(run.rot[0].mean())
    # the default wounds: both poles
    assert float(run.rot[0, 0].max()) > 0.1
    assert float(run.rot[0, -1].max()) > 0.1
    assert float(run.rot[0, 16].max()) == 0


def test_parameters_travel_as_json_and_nonsense_is_refused():
    for name in ("apple", "orange-tropical", "tomato-cold-desert"):
        params = SOLVER.parse({}, name)
        assert DecayParams.model_validate_json(json.dumps(json.loads(params.model_dump_json()))) == params
    with pytest.raises(InvalidInput, match="humidity"):
        SOLVER.parse({"humidity": 101})
    with pytest.raises(InvalidInput, match="theta"):
        SOLVER.parse({"mould": {"theta": 0}})


def test_a_finer_quality_takes_a_finer_mesh():
    sizes = [choose(DecayParams(), quality).vertices for quality in ("preview", "default", "fine")]
    assert sizes == [10242, 92162, 368642]


HOSTILE = {
    "frost": {"temperature": -10.0, "humidity": 0.0},
    "steam": {"temperature": 60.0, "humidity": 100.0, "porosity": 100.0, "water_content": 99.0},
    "asleep": {"growth_rate": 0.0},
    "no nutrient": {"nutrient": 1e-9},
    "bare patches": {"unevenness": 1.0, "noise": 0.9, "patch_size": 0.05},
    "quick": {"growth_rate": 100.0, "mould": {"pace": 500.0}},
    "runs": {"mould": {"sigma1": 0.2, "d1": 0.1}, "rot": {"sigma1": 0.2, "d1": 0.1}},
    "dies": {"mould": {"sigma3": 50.0}, "rot": {"sigma3": 50.0}},
    "spores": {"spawning": 24.0, "propagation_rate": 9.0, "rot_spawning": 100.0, "spawn_reach": 3.2},
    "wounds": {"wounds": [{"colatitude": 90, "azimuth": 5 * k, "radius": 0.6} for k in range(64)]},
    "thin fruit": {"radii": (1, 0.7, 0.5, 0.45, 0.5, 0.7, 1, 0.45), "stone": (0.3, 0.2)},
    "eats all": {"mould": {"theta": 1.0, "sigma2": 50.0, "f1": 10.0}},
}


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_parameters_end_finite_positive_and_in_balance(case):
    whole = System(SOLVER.parse({**PAPER, "growth_rate": 50.0} | HOSTILE[case]), 4, True)
    for reached in march(whole, (0.5, 3.0), 1e-3, choose(DecayParams(), "preview").longest, Context()):
        for layer, state in zip((whole.rot, whole.mould), reached.state[:2], strict=True):
            assert all(np.isfinite(part).all() and part.min() >= 0 for part in state[:3])
            assert layer.budget_error(state) < 1e-12
