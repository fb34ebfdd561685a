"""Batch: plans, the resumable runner, executors and the command line."""

from pathlib import Path

import store as _below

# The names are generic, and Python looks into the working directory first: say whose module was found there.
if _below.__file__ is None or Path(_below.__file__).parents[1] != Path(__file__).parents[1]:
    raise ImportError(
        f"{_below.__file__ or _below.__path__} hides wizen's package `store`. "
        "Rename it, run in another directory, or with `python -P`, which leaves the working directory out.",
        name="store",
    )
