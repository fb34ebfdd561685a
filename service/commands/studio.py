"""`wizen serve --studio`: a store of one's own to work in, and a token for the page."""

from __future__ import annotations

import secrets
from pathlib import Path

from store import seal, starter
from store.store import Store
from store.tokens import Tokens

__all__ = ["fit_out"]

#: How long the page's token lasts [s].
_DAY = 86_400.0
_PREFIX = "studio-"


def fit_out(root: Path) -> str:
    """Make a store at `root` where none is, give it the package's tables where it has none, and return the secret of a
    token that may run jobs for a day.

    Raises:
        ReadOnlyStore: the store is the package's own, or cannot be made there.
        StorageFull: the disk is full.

    """
    starter.check_own(root)
    store = Store.open(root, create=True)
    if not store.table_names():
        _lay_in(store)
    tokens = Tokens(root)
    for old in tokens.all():
        if old.expired and old.name.startswith(_PREFIX):
            tokens.revoke(old.id)
    return tokens.create(f"{_PREFIX}{secrets.token_hex(4)}", ["run"], _DAY)[1]


def _lay_in(store: Store) -> None:
    """Copy the package's tables; a table is seen once its last file, which names the others, is there."""
    for table in sorted((starter.ROOT / "tables").iterdir()):
        to = store.tables_dir / table.name
        seal.make_directory(to)
        for source in sorted(table.iterdir(), key=lambda path: path.suffix == ".json"):
            seal.publish(to / source.name, source.read_bytes())
