"""The constants of Eq. 2-9, each in its own term."""

import pytest

from solver.decay import SOLVER
from solver.decay.fields.rates import daily


def test_each_constant_scales_its_own_term():
    """Table 3's growth and death are of one size by chance: sigma2 f1 = sigma3. Here all constants differ."""
    colony = {"sigma1": 0.1, "d1": 0.03, "d2": 0.02, "sigma2": 3.0, "f1": 0.7, "f2": 0.4, "sigma3": 1.1}
    params = SOLVER.parse({"climate": "paper", "growth_rate": 50.0, "mould": colony})
    pace = params.mould.pace
    rates = daily(params.mould, params, 30.0)
    assert rates.consume == pytest.approx(pace * 3.0 * 0.7, rel=1e-12)
    assert rates.wither == pytest.approx(pace * 1.1, rel=1e-12)
    assert (rates.half, rates.cap) == (0.4, 0.02)
