"""Where the fresh weight goes: water, juice and what is respired, against floor's force and surface's volume."""

import numpy as np
import pytest

from solver.contract import Need
from solver.decay import SOLVER
from solver.decay.body.body import Body
from solver.decay.surfaces.surface import geodesic, lay

STAGES = (0.0, 5.0, 10.0, 20.0)


@pytest.mark.parametrize("preset", ["apple", "orange", "peach", "pear", "tomato"])
def test_density_stays_and_the_books_close_while_a_fruit_rots_and_dries(preset):
    values = {"body": "quasi-static", "temperature": 20.0, "humidity": 80.0}
    need = Need(
        fields=("mass", "water_lost", "juice_lost", "respired", "density", "rotten_share"),
        stages=STAGES,
        quality="preview",
    )
    run = SOLVER.solve(SOLVER.parse(values, preset), need)
    booked = run.mass + run.water_lost + run.juice_lost + run.respired
    assert booked.values == pytest.approx(np.ones(len(STAGES)), abs=1e-6)
    assert run.mass.values[0] == 1
    assert (np.diff(run.mass) < 0).all()
    for lost in (run.water_lost, run.juice_lost, run.respired):
        assert (np.diff(lost) >= -1e-12).all()
    assert run.rotten_share.values[-1] > 0.1
    assert run.juice_lost.values[-1] > 0.005
    # the surface's own volume, against the books' mass
    assert run.density.values[0] == pytest.approx(1, abs=0.01)
    assert run.density.values.min() > 0.8
    assert run.density.values.max() < 1.15
    assert "note" not in run.attrs


def test_a_fruit_lighter_than_fruits_are_says_why():
    """Each reason by taking it away: without the stone and without the skin the same peach is nearer to its weight."""
    values = {"body": "quasi-static", "te": 0.03, "skin": {"shrinkage": 0.5}}
    need = Need(fields=("density",), stages=(10.0,), quality="preview")
    found = {}
    for name, change in (("both", {}), ("no stone", {"stone": (0, 0)}), ("no skin", {"skin": None})):
        run = SOLVER.solve(SOLVER.parse(values | change, "peach"), need)
        found[name] = float(run.density.values[0]), run.attrs.get("note", "")
    light, said = found["both"]
    assert light < 0.8
    assert said.startswith(f"on day 10 the density is {light:.2f} of the fresh fruit's: ")
    assert "stone" in said
    assert "skin" in said
    for name in ("no stone", "no skin"):
        assert found[name][0] > light + 0.05
        assert found[name][1] == ""


def test_the_floor_carries_what_the_books_say_is_left():
    params = SOLVER.parse({"body": "quasi-static"}, "apple")
    surface, rays = lay(params, 16), geodesic(16)[0]
    body = Body(params, surface, 16, 6, 1e-3)
    state = body.state(0.2, np.where(rays[:, 1] < 0, 1.0, 0.0))
    balance = body.settled(state)
    fresh = body._pressure * body.solid.volume.sum()
    assert sum(state.booked) == pytest.approx(1, abs=1e-12)
    assert state.booked.evaporated == pytest.approx(0.2, rel=1e-12)
    assert state.booked.juice > 0.05
    assert balance.reaction == pytest.approx(fresh * state.booked.mass, rel=1e-6)


def test_juice_that_leaked_cannot_evaporate():
    params = SOLVER.parse({"body": "quasi-static"}, "tomato")
    body = Body(params, lay(params, 16), 16, 6, 1e-3)
    rotten = body.state(params.water_content / 100, np.ones(len(geodesic(16)[0])))
    assert rotten.booked.evaporated < params.water_content / 100 - 0.05
    assert sum(rotten.booked) == pytest.approx(1, abs=1e-12)
    assert rotten.shrinkage.min() > 0
