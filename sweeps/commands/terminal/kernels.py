"""Where compiled loops are kept: numba refuses to compile what it can keep nowhere."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import solver

__all__ = ["kept", "place"]

#: A directory of this program's own, if it had to make one.
_own: Path | None = None


def place() -> Path | None:
    """Return the directory that numba keeps them in: the one chosen, the package's, the user's; None: nowhere."""
    found = next((path for path in _candidates() if _may_write(path)), None)
    return None if found == _own else found


@contextmanager
def kept() -> Iterator[None]:
    """Keep them somewhere while a program runs: where there is no place that lasts, for itself and those it starts."""
    global _own
    if place() is not None:
        yield
        return
    _own = Path(tempfile.mkdtemp(prefix="wizen-kernels-"))
    os.environ["NUMBA_CACHE_DIR"] = str(_own)
    try:
        yield
    finally:
        shutil.rmtree(_own, ignore_errors=True)


def _candidates() -> Iterator[Path]:
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        yield Path(chosen)
    yield Path(solver.__file__).parent
    import platformdirs

    yield platformdirs.user_cache_path("numba", appauthor=False)


def _may_write(path: Path) -> bool:
    """Return whether a directory may be written: by a trial, as numba does, for some file systems promise in vain."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            return True
    except OSError:
        return False
