"""The table that comes with the package, so that a fresh install has shapes to serve.

A store like any other, without its shards: `store/starter/README.md` says which runs it was built from.
"""

from __future__ import annotations

from pathlib import Path

from .errors import ReadOnlyStore

__all__ = ["ROOT", "check_own", "is_starter", "own_or_starter"]

#: The store in the package. Read only.
ROOT = Path(__file__).parent / "starter"


def own_or_starter(root: Path | None) -> Path:
    """Return `root` if there is a store in it, else the starter's."""
    return root if root is not None and (root / "shards").is_dir() else ROOT


def is_starter(root: Path) -> bool:
    """Return whether `root` is the store in the package."""
    return root.resolve() == ROOT.resolve()


def check_own(root: Path) -> None:
    """Refuse to write into the package.

    Raises:
        ReadOnlyStore: `root` is the starter's.

    """
    if is_starter(root):
        raise ReadOnlyStore(
            "the table that comes with wizen takes nothing new.", "Name a store of your own with --store DIR."
        )
