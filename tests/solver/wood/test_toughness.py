"""Double cantilever beam and end-notched flexure against beam theory, as in `benchmarks.wood.fracture`."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.wood.bench import bent, opened, slid
from benchmarks.wood.fracture import DCB, ENF, WIDE, measured, trial


@pytest.mark.parametrize("of", [DCB, ENF], ids=["opening", "sliding"])
def test_a_crack_grows_at_beam_theory_s_load_and_costs_its_toughness(of):
    """On such heavy masses that it takes seconds: some percent are inertia's."""
    found = measured(of, trial(replace(of, scaling=1600.0), 24, 35))
    assert found["before"] == pytest.approx(1, abs=0.06)
    assert found["highest"] == pytest.approx(1, abs=0.12)
    assert found["borne"] == pytest.approx(1, abs=0.06)
    assert found["mean"] == pytest.approx(1, abs=0.08)
    assert found["by_area"] == pytest.approx({"DCB": 250.0, "ENF": 700.0}[of.name], rel=0.03)
    assert found["area"] > 2e-4
    assert found["balance"] < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("of", [DCB, ENF], ids=["opening", "sliding"])
def test_slowly_driven_it_does_within_five_percent(of):
    found = measured(of, trial(of, 24, 35))
    assert found["before"] == pytest.approx(1, abs=0.05)
    assert found["mean"] == pytest.approx(1, abs=0.05)
    assert found["by_area"] == pytest.approx({"DCB": 250.0, "ENF": 700.0}[of.name], rel=0.02)


def test_what_a_coarse_mesh_bears_is_held_against_theory_with_its_strength():
    """A curve drawn with half of the strength: less than what the wood bears, all of what the mesh does."""
    cut, weak = 0.121, 4e6
    way, force = ENF.theory(cut, weak)
    way, force = way[way < ENF.way], force[way < ENF.way]
    run = {"way": way, "force": force, "area": np.array([cut, cut + 0.04]) * WIDE, "spent": np.array([0.0, 0.5])}
    run |= {"balance": np.zeros(2), "shears": np.array(weak)}
    found = measured(ENF, run)
    assert found["highest"] < 0.95
    assert found["borne"] == pytest.approx(1, abs=1e-9)


def test_the_bench_reads_curves_as_beam_theory_made_them():
    """Moduli and toughnesses that curves were drawn with: a bent stick, and cracks that grow."""
    stiff, shear = 11.9e9, 0.74e9
    way = np.linspace(0, 5e-3, 60)
    force = np.where(way < 4e-3, 4 * 0.025**4 * 10.8e9 / 0.36**3 * way, 10.0)
    e, rupture = bent(way, force)
    assert e == pytest.approx(10.8e9)
    assert rupture == pytest.approx(3 * force.max() * 0.36 / (2 * 0.025**3))
    a = np.linspace(0.08, 0.13, 60)
    bend = stiff * 0.02 * DCB.high**3 / 12
    load = np.sqrt(250 * 0.02 * bend) / a
    assert opened(2 * load * a**3 / (3 * bend), load, stiff) == pytest.approx(250)
    h = ENF.high
    load = np.sqrt(700 * 16 * stiff * 0.02**2 * h**3 / 9) / a
    sag = load * ((3 * a**3 + 2 * 0.16**3) / (8 * stiff * 0.02 * h**3) + 3 * 0.16 / (10 * shear * 0.02 * h))
    assert slid(sag, load, stiff, shear) == pytest.approx(700)
