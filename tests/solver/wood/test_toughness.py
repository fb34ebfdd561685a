"""Double cantilever beam and end-notched flexure against beam theory, as in `benchmarks.wood.fracture`."""

from dataclasses import replace

import pytest

from benchmarks.wood.fracture import DCB, ENF, measured, trial


@pytest.mark.parametrize("of", [DCB, ENF], ids=["opening", "sliding"])
def test_a_crack_grows_at_beam_theory_s_load_and_costs_its_toughness(of):
    """Driven so fast, on such heavy masses, that it takes seconds: a tenth is inertia's."""
    found = measured(of, trial(replace(of, scaling=6400.0), 24, 35))
    assert found["before"] == pytest.approx(1, abs=0.08)
    assert found["highest"] == pytest.approx(1, abs=0.12)
    assert found["mean"] == pytest.approx(1, abs=0.12)
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
