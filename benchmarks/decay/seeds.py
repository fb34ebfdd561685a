"""What the number of frames does to the statistics of a rot: nothing. Means and spreads over seeds.

    python -m benchmarks.decay.seeds [seeds] [days]

The same seeds with 24 and with 96 frames a day, then other seeds with 96: the first two must be equal, and the third
differ from them by no more than seeds differ. `t` is Welch's, against the first row: within +-2 is noise.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from numpy.typing import NDArray
from scipy.stats import ttest_ind

from benchmarks.figures import Sheet
from solver.contract import Context
from solver.decay import DecayParams
from solver.decay.fields.stepping import march
from solver.decay.fields.system import System
from solver.decay.settings import choose

_CELLS = 16
#: Spores fall often, so that seeds differ by more than their patches of nutrient.
_SETTING = {"growth_rate": 50.0, "propagation_rate": 8.0, "spawning": 1.0, "rot_spawning": 6.0}


def ends(seeds: range, rate: int, days: float) -> NDArray[np.float64]:
    """Return shares that are rotten and mouldy and the mean mould, [%], of each seed (s, 3) at the last of the days."""
    found = []
    for seed in seeds:
        params = DecayParams.model_validate(_SETTING | {"seed": seed})
        system = System(params, _CELLS, True)
        frames = tuple(np.arange(1, round(rate * days) + 1) / rate)
        *_, end = march(system, frames, 1e-3, choose(params, "preview").longest, Context())
        assert system.mould is not None
        assert end.state.mould is not None
        rot, mould = system.rot.share(end.state.rot), system.mould.share(end.state.mould)
        mean = system.surface.mean
        found.append([mean(rot >= 0.1), mean(mould >= 0.1), mean(mould)])
    return 100 * np.array(found)


def main(count: int = 24, days: float = 3.0) -> None:
    """Print the table."""
    ends(range(1), 1, 1.0)  # compiled before the clock runs
    head = ("frames a day", "seeds", "rotten %", "mouldy %", "mean mould %", "t", "CPU s")
    rows = []
    for rate, seeds in ((24, range(count)), (96, range(count)), (96, range(count, 2 * count))):
        begun = time.process_time()
        rows.append((rate, seeds, ends(seeds, rate, days), time.process_time() - begun))
    sheet = Sheet("decay-seeds", head, "decay")
    first = rows[0][2]
    for rate, seeds, found, seconds in rows:
        cells = [f"{mean:.2f} ± {spread:.2f}" for mean, spread in zip(found.mean(0), found.std(0, ddof=1), strict=True)]
        if np.array_equal(found, first):
            noise = "the first's bytes" if seconds != rows[0][3] else ""
        else:
            noise = ", ".join(f"{t:+.1f}" for t in ttest_ind(found, first, equal_var=False).statistic)
        each = {str(seed): share for seed, share in zip(seeds, found.tolist(), strict=True)}
        sheet.add(
            (rate, f"{seeds[0]} to {seeds[-1]}", *cells, noise, f"{seconds:.1f}"),
            frames_a_day=rate, days=days, cpu=seconds, rotten_mouldy_mean_by_seed=each,
        )  # fmt: skip
    sheet.keep()


if __name__ == "__main__":
    main(*(kind(text) for kind, text in zip((int, float), sys.argv[1:], strict=False)))
