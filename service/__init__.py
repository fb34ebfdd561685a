"""HTTP: shapes in milliseconds, from tables that the sweeps built."""

from pathlib import Path

import sweeps as _below

# The names are generic, and Python looks into the working directory first: say whose module was found there.
if _below.__file__ is None or Path(_below.__file__).parents[1] != Path(__file__).parents[1]:
    raise ImportError(
        f"{_below.__file__ or _below.__path__} hides wizen's package `sweeps`. "
        "Rename it, run in another directory, or with `python -P`, which leaves the working directory out.",
        name="sweeps",
    )
