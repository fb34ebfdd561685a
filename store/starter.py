"""The tables that come with the package, so that a fresh install has shapes to serve.

A store like any other, but of the runs that they were built from it holds those alone whose wrinkles others start from:
just past an onset last digits decide between patterns, and another processor comes to another one.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .errors import ReadOnlyStore

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["ROOT", "check_own", "has", "is_starter", "own_or_starter", "result"]

#: The store in the package. Read only.
ROOT = Path(__file__).parent / "starter"


def own_or_starter(root: Path | None) -> Path:
    """Return `root` if there is a store in it, else the starter's."""
    return root if root is not None and (root / "shards").is_dir() else ROOT


def is_starter(root: Path) -> bool:
    """Return whether `root` is the store in the package."""
    return root.resolve() == ROOT.resolve()


def has(key: str) -> bool:
    """Return whether the result of `key` comes with the package."""
    from .store import Store

    return Store(ROOT).has(key)


def result(key: str) -> xr.Dataset | None:
    """Return the result of `key` if it comes with the package.

    Raises:
        CorruptShard: it is damaged.

    """
    from .store import Store

    package = Store(ROOT)
    return package.get(key) if package.has(key) else None


def check_own(root: Path) -> None:
    """Refuse to write into the package.

    Raises:
        ReadOnlyStore: `root` is the starter's.

    """
    if is_starter(root):
        raise ReadOnlyStore(
            "the table that comes with wizen takes nothing new.", "Name a store of your own with --store DIR."
        )
