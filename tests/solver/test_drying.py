"""Hours to shrinkage against what was published: drying times, diffusion in a sphere, when grapes wrinkle."""

from __future__ import annotations

import math

import numpy as np
import pytest

from solver import registry
from solver.contract import InvalidInput
from solver.dehydration import SOLVER
from solver.dehydration.drying import Drying, moisture
from solver.dehydration.drying.clock import shrinkage


@pytest.mark.parametrize(("diameter", "fresh", "hours"), [(17.2, 0.782, 176.0), (22.0, 0.795, 228.0)])
def test_grapes_in_the_sun_are_dry_when_doymaz_found_them_dry(diameter: float, fresh: float, hours: float) -> None:
    """78.2 to 22 % water in 176 h (seedless), 79.5 to 22 % in 228 h (seeded)."""
    left = moisture.grape(hours, Drying(diameter=diameter))
    held = left * fresh / (1 - fresh)
    assert held / (1 + held) == pytest.approx(0.22, abs=1e-9)


def test_the_published_diffusivities_do_not_give_the_published_drying_times() -> None:
    """Why grapes have a rate of their own: 15 and 31 % of the water would be left, 8 and 7 % were."""
    berries = ((1.66e-11, 176, 17.2), (1.02e-11, 228, 22))
    left = [moisture.sphere(d * 3600 * hours / (mm / 2000) ** 2) for d, hours, mm in berries]
    assert left == pytest.approx([0.15, 0.31], abs=0.01)


def test_a_sphere_dries_as_diffusion_says() -> None:
    """Against finite differences of d(ru)/dt = D d2(ru)/dr2, which shares nothing with the two series."""
    n, number = 200, 0.2
    radius = np.linspace(0, 1, n + 1)
    held = radius.copy()
    held[-1] = 0
    step = 0.4 / n**2
    at: dict[float, float] = {}
    for k in range(round(number / step)):
        held[1:-1] += 0.4 * (held[2:] - 2 * held[1:-1] + held[:-2])
        for want in (0.02, 0.05, 0.1, 0.2):
            if abs((k + 1) * step - want) < step / 2:
                at[want] = 3 * float(np.trapezoid(held * radius, radius))
    assert len(at) == 4
    for want, left in at.items():
        assert moisture.sphere(want) == pytest.approx(left, abs=2e-4)
    assert moisture.sphere(0.1) == pytest.approx(moisture.sphere(0.1 + 1e-9), abs=1e-5)
    assert moisture.sphere(0.0) == 1


@pytest.mark.parametrize(("temperature", "air", "diffusivity"), [(50.0, 0.5, 1.1532e-10), (70.0, 1.5, 5.1895e-10)])
def test_jujubes_diffuse_as_published_at_both_ends(temperature: float, air: float, diffusivity: float) -> None:
    left = moisture.jujube(10.0, Drying(temperature=temperature, air_speed=air, diameter=22.0))
    assert left == pytest.approx(moisture.sphere(diffusivity * 36000 / 0.011**2), rel=1e-12)


def test_warmer_and_faster_air_dries_jujubes_sooner() -> None:
    def left(temperature: float, air: float) -> float:
        return moisture.jujube(10.0, Drying(temperature=temperature, air_speed=air, diameter=22.0))

    assert left(50, 0.5) > left(55, 0.5) > left(55, 1.0) > left(70, 1.0) > left(70, 1.5)
    # the activation energy that they were measured with, between 34.97 and 74.20 kJ/mol
    rates = [math.log(0.6079 / moisture.jujube(60, Drying(temperature=t, air_speed=1, diameter=22))) for t in (50, 70)]
    energy = 8.314 * math.log(rates[1] / rates[0]) / (1 / 323.15 - 1 / 343.15)
    assert 34.97e3 < energy < 74.20e3


def test_flesh_loses_the_volume_of_its_water() -> None:
    assert shrinkage(1.0, 0.8) == 0
    # bone dry, 0.2 kg of solids of 1591.3 kg/m3 are left of 0.8 / 997 + 0.2 / 1591.3 m3
    left = (0.2 / 1591.3) / (0.8 / 997 + 0.2 / 1591.3)
    assert (1 - shrinkage(0.0, 0.8)) ** 3 == pytest.approx(left)
    volumes = [(1 - shrinkage(ratio, 0.8)) ** 3 for ratio in (0.25, 0.5, 0.75)]
    assert np.diff(volumes) == pytest.approx([volumes[1] - volumes[0]] * 2)


def test_grapes_wrinkle_where_martin_and_stott_saw_them_wrinkle() -> None:
    """At 20 to 50 % of the fresh weight; raisin's own onset (s = 0.069, docs/dehydration.md) is at 18 %."""
    weights = [shrinkage(1 - loss / 0.782, 0.782) for loss in (0.2, 0.5)]
    assert weights == pytest.approx([0.078, 0.229], abs=2e-3)
    assert shrinkage(1 - 0.178 / 0.782, 0.782) == pytest.approx(0.0691, abs=1e-3)


def test_peas_shrink_a_little_less_than_their_water() -> None:
    """Ganjloo et al. 2018: geometric diameter 9.10 mm at 75.15 % water, 5.90 at 15.21 %. Air fills what is missing."""
    left = (0.1521 / 0.8479) / (0.7515 / 0.2485)
    assert shrinkage(left, 0.7515) == pytest.approx(1 - 5.90 / 9.10, rel=0.15)


def test_presets_dry_as_their_fruit() -> None:
    sunny = SOLVER.stages_after([0, 48, 176], {}, "raisin")
    assert sunny == SOLVER.stages_after([0, 48, 176], {"kinetics": "grape"})
    assert sunny[0] == 0
    assert sunny[1] < sunny[2] == pytest.approx(0.400, abs=1e-3)
    own = SOLVER.stages_after([48], {"kinetics": "page", "rate": "0.01445", "moisture": 0.782}, "plum1")
    assert own == pytest.approx(sunny[1:2], rel=1e-3)


@pytest.mark.parametrize(
    ("preset", "hours", "under", "word"),
    [
        ("plum1", 10, {}, "nobody measured"),
        ("raisin", 10, {"temperature": 60}, "open sun"),
        ("raisin", 200, {}, "outside of what was measured"),
        ("raisin", -1, {}, "outside of what was measured"),
        ("raisin", 176.0001, {}, r"hours = 176\.0001 h is outside of what was measured: 0 to 176 h"),
        ("raisin", 10, {"diameter": 30}, "outside of what was measured"),
        ("jujube1", 10, {}, "want temperature, air_speed, diameter"),
        ("jujube1", 10, {"temperature": 80, "air_speed": 1, "diameter": 22}, "outside of what was measured"),
        ("jujube1", 10, {"temperature": 60, "air_speed": 3, "diameter": 22}, "outside of what was measured"),
        ("jujube1", 10, {"temperature": 60, "air_speed": 1, "diameter": 22, "humidity": 20}, "humidity was not varied"),
        ("sphere", 10, {"kinetics": "page", "moisture": 0.8}, "wants a rate"),
        ("sphere", 10, {"kinetics": "page", "rate": 0.1}, "wants the moisture"),
        ("raisin", 10, {"wind": 3}, "unknown name 'wind'"),
        ("raisin", float("inf"), {}, "outside of what was measured"),
        ("sphere", 10, {"kinetics": "page", "rate": float("nan"), "moisture": 0.8}, "rate"),
        ("sphere", 1e300, {"kinetics": "page", "rate": 0.05, "exponent": 3, "moisture": 0.8}, "no time that a fruit"),
        ("sphere", -1, {"kinetics": "page", "rate": 0.05, "moisture": 0.8}, "no time that a fruit"),
        ("jujube1", float("inf"), {"temperature": 60, "air_speed": 1, "diameter": 22}, "no time that a fruit"),
        ("raisin", 10, {"rate": 0.05}, "rate would change nothing: the law of kinetics=grape"),
        ("jujube1", 24, {"temperature": 60, "air_speed": 1, "diameter": 22, "exponent": 1}, "exponent would change"),
        (
            "plum1",
            10,
            {"kinetics": "page", "rate": 0.05, "moisture": 0.8, "temperature": 60, "humidity": 20},
            "temperature, humidity would change nothing: the law of kinetics=page",
        ),
        ("jujube1", 24, {"temperature": 60, "air_speed": 1, "diameter": 1e-300}, "diameter: .* equal to 1"),
        ("jujube1", 24, {"temperature": 60, "air_speed": 1, "diameter": 1e300}, "diameter: .* equal to 1000"),
    ],
)
def test_what_nobody_measured_is_refused(preset: str, hours: float, under: dict[str, object], word: str) -> None:
    with pytest.raises(InvalidInput, match=word):
        SOLVER.stages_after([hours], under, preset)


@pytest.mark.parametrize("exponent", [0.3, 1.0, 3.0])
def test_hours_past_the_last_stage_are_refused_in_hours(exponent: float) -> None:
    under = {"kinetics": "page", "rate": 0.2, "exponent": exponent, "moisture": 0.95}
    with pytest.raises(InvalidInput, match=r"after 1e\+06 h .* s = 0\.6828, and stages end at 0\.6") as refused:
        SOLVER.stages_after([1e6], under)
    most = float(refused.value.advice.removeprefix("Ask for at most ").removesuffix(" hours."))
    assert SOLVER.stages_after([most], under)[0] == pytest.approx(0.6, abs=1e-3)
    assert SOLVER.stages_after([most], under)[0] <= SOLVER.stages.highest


def test_solvers_without_a_clock_say_so() -> None:
    with pytest.raises(InvalidInput, match="does not turn hours into stages"):
        registry.get("growth").stages_after([1.0], {})
