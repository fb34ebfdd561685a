"""`wizen backup` and `wizen restore`: a store copied while it is in use, and brought back."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from .terminal.console import emit, note
from .terminal.options import As_json, StorePath

__all__ = ["add_to"]


def add_to(app: typer.Typer) -> None:
    """Add these commands to the `wizen` command."""
    app.command()(backup)
    app.command()(restore)


def backup(
    to: Annotated[Path, typer.Argument(metavar="DIR", help="Where the copy goes; again and again into the same one.")],
    store: StorePath,
    as_json: As_json = False,
) -> None:
    """Copy a store: results, tables, tokens and the ledger of jobs. It may be in use meanwhile.

    A second backup into the same directory copies what is new. `wizen restore` brings it back. Files that were damaged
    already are named, and the exit code is 1 then.

    [bold]Examples[/bold]

    wizen backup /backups/fruits --store fruits
    """
    from store.copies.backup import backup as copy
    from store.store import Store

    copied = copy(Store.open(store), to)
    emit(
        {"store": str(store), "backup": str(to), **copied._asdict()},
        as_json,
        lambda console: _show(console, copied, to),
    )
    for name in copied.damaged:
        note(f"damaged already in the store: {name}; delete it there, and make it again")
    if copied.kept:
        note(f"the store has lost what the backup before had, and this one keeps: {_some(copied.kept)}")
    if copied.gone:
        note(f"the ledger calls done what neither has: {_some(copied.gone)}; sweep their plans again")
    if copied.damaged:
        raise typer.Exit(1)


def restore(
    source: Annotated[Path, typer.Argument(metavar="DIR", help="A directory that `wizen backup` made.")],
    store: Annotated[Path, typer.Option("--store", metavar="DIR", help="The new store's directory.")],
    as_json: As_json = False,
) -> None:
    """Make a store of a backup, once every byte of it was found as it was copied. Jobs that ran then wait.

    [bold]Examples[/bold]

    wizen restore /backups/fruits --store fruits-again
    """
    from store.copies.backup import restore as bring_back
    from store.errors import CorruptTokens
    from store.tokens import Tokens

    copied = bring_back(source, store)
    emit(
        {"store": str(store), "backup": str(source), **copied._asdict()},
        as_json,
        lambda console: _show(console, copied, store),
    )
    with suppress(CorruptTokens):  # they were so in the store, and stop no restore
        tokens = ", ".join(token.name for token in Tokens(store).all() if not token.expired)
        if tokens:
            note(f"good as on {copied.created} are the tokens {tokens}: revoke again those that were revoked since")


def _some(names: Sequence[str]) -> str:
    """Return the first few of many names."""
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return f"{', '.join(names[:3])}{more}"


def _show(console: Any, copied: Any, where: Path) -> None:
    size = f"{copied.bytes / 1e6:.1f} MB"
    console.print(f"{copied.files} files, {size}, in {where} ({copied.new} copied now)", markup=False)
