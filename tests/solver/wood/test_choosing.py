"""Mode auto: what it chooses, that it says why, and that its expected error is one that is met."""

import numpy as np
import pytest

from solver.contract import InvalidInput, Need
from solver.wood import SOLVER, choosing
from solver.wood.choosing import decide, error_at

PRESS = {"rods": 5, "vertices": 9, "fracture": "none"}


def chosen(values, preset=None):
    return decide(SOLVER.parse({"mode": "auto", **values}, preset=preset))


def test_lowest_frequency_is_the_beam_s():
    """First frequency of a slender hinged and a clamped beam; a short one is softer by its shear."""
    values = {"length": 1.0, "radius": 0.005, "grips": [], "clamp": "start"}
    params = SOLVER.parse(values)
    c = (10e9 / 600) ** 0.5 * 0.005 / 2
    assert choosing._frequency(params, choosing._held(params)) == pytest.approx(3.516 * c, rel=0.01)
    short = SOLVER.parse({**values, "length": 0.05})
    assert choosing._frequency(short, choosing._held(short)) < 0.95 * 3.516 * c / 0.05**2


def test_rate_and_loads_decide():
    assert decide(SOLVER.parse({"mode": "auto"}, preset="cantilever")).mode == "static"
    assert chosen({"tip_load": (0, 0, -1.0)}).mode == "static"
    near = chosen({"tip_load": (0, 0, -400.0)})
    assert (near.mode, near.scaling) == ("explicit", 1.0)
    assert "break nothing" in near.why
    assert "inertia" in chosen({}, "fig-4.1").why
    slow = chosen({}, "press")
    assert slow.mode == "explicit"
    assert 1e4 <= slow.scaling <= 1e5
    assert slow.error <= 0.02
    # ten times as fast bears less mass; a hit none
    ways = [{"time": 0.0, "position": (0.075, 0, 0.015)}, {"time": 0.3, "position": (0.075, 0, -0.015)}]
    blocks = [b.model_dump() for b in SOLVER.parse({}, preset="press").bodies[:2]]
    body = {"shape": "cylinder", "size": (0.01, 0.06, 0.0), "path": ways}
    faster = chosen({"bodies": [*blocks, body]}, "press")
    assert 1 < faster.scaling < slow.scaling
    # the same way in steps is the same load
    ways[1:] = [{"time": 0.03 * n, "position": (0.075, 0, 0.015 - 0.003 * n)} for n in range(1, 11)]
    assert chosen({"bodies": [*blocks, body]}, "press").scaling == faster.scaling
    ways[1:] = [{"time": 0.003, "position": (0.075, 0, -0.015)}]
    assert chosen({"bodies": [*blocks, body]}, "press").scaling == 1


def test_error_grows_with_masses_and_names_what_is_unknown():
    params = SOLVER.parse({}, preset="press")
    errors = [error_at(params, s) for s in (1.0, 1e2, 1e4, 1e6)]
    assert errors == sorted(errors)
    assert "unknown" in decide(params).why
    assert "unknown" not in decide(params.model_copy(update={"fracture": "none"})).why


def test_auto_is_what_it_chose_and_says_so():
    """The same numbers as what was chosen, set by hand; the note is told before any work, and stored."""
    told = []
    need = Need(stages=(0.02, 0.04), fields=("elastic_energy", "tip_position"), quality="preview", dtype="float64")
    from solver.contract import Context

    auto = SOLVER.solve(SOLVER.parse(PRESS, preset="press"), need, Context(lambda _, said: told.append(said)))
    scale = auto.attrs["mass_scaling"]
    hand = SOLVER.solve(SOLVER.parse({**PRESS, "mode": "explicit", "mass_scaling": scale}, preset="press"), need)
    assert np.array_equal(auto.elastic_energy.values, hand.elastic_energy.values)
    assert auto.attrs["note"] == told[0]
    assert f"{scale:g} times" in told[0]
    assert 0 < auto.attrs["expected_error"] <= 0.02
    assert "note" not in hand.attrs


@pytest.mark.slow
def test_expected_error_is_met():
    """Elastic energy of the press on chosen against real masses: twice the error of forces, and no more."""
    need = Need(stages=(1.1, 1.3), fields=("elastic_energy",), quality="preview")
    auto = SOLVER.solve(SOLVER.parse(PRESS, preset="press"), need)
    real = SOLVER.solve(SOLVER.parse({**PRESS, "mode": "explicit"}, preset="press"), need)
    allowed = 2 * auto.attrs["expected_error"]
    assert auto.elastic_energy.values == pytest.approx(real.elastic_energy.values, rel=allowed)


def test_auto_refuses_a_scale_of_one_s_own():
    with pytest.raises(InvalidInput, match="leave mass_scaling out"):
        SOLVER.parse({"mode": "auto", "mass_scaling": 4.0})
