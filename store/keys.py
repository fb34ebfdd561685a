"""The name of a result: a hash of what was asked for. Equal questions have equal names, on every machine."""

from __future__ import annotations

import hashlib
import re

from solver.contract import Need, Params

from .canonical import canonical

__all__ = ["canonical", "is_key", "key"]

_KEY = re.compile(r"[0-9a-f]{64}")


def key(solver: str, version: str, params: Params, need: Need) -> str:
    """Return the key of a result, 64 hexadecimal digits. `need` must have been settled by its solver.

    Raises:
        ValueError: the need still leaves something to defaults, which may change.

    """
    if not need.fields or not need.stages or need.resolution is None or need.tolerance is not None:
        raise ValueError("only a settled need has a key: pass it through Solver.settle first")
    asked = {
        "solver": solver,
        "version": version,
        "params": params.model_dump(mode="json"),
        "need": need.model_dump(mode="json"),
    }
    return hashlib.sha256(canonical(asked)).hexdigest()


def is_key(text: str) -> bool:
    """Return whether `text` has the form of a key."""
    return _KEY.fullmatch(text) is not None
