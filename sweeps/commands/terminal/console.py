"""How commands speak: results on stdout, everything else on stderr, errors in one line, `--json` as one document."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperGroup

from ...errors import describe, exit_code

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["Root", "emit", "grid", "note"]


def note(text: str) -> None:
    """Say something to a person: on stderr."""
    typer.echo(text, err=True)


def emit(document: Any, as_json: bool, show: Callable[[Console], None]) -> None:
    """Print a result: as the JSON document, or as `show` writes it for people."""
    if as_json:
        typer.echo(json.dumps(document, indent=2, allow_nan=False))
        return
    from rich.console import Console

    # names are the user's: "[/a]" is a directory, not an end of something bold
    show(Console(highlight=False, soft_wrap=True, markup=False))


def grid(console: Console, head: Sequence[str], rows: Iterable[Sequence[str]], title: str = "") -> None:
    """Print a table for people: no word is cut, and what goes to a file or a pipe has one line for each row."""
    from rich import box
    from rich.table import Table

    table = Table(*head, title=title or None, title_justify="left", box=box.SIMPLE_HEAD)
    table.columns[0].no_wrap = True  # names are typed again: no terminal is too narrow for them
    for name, column in zip(head, table.columns, strict=True):
        column.min_width = len(name)
    for row in rows:
        for column, cell in zip(table.columns, row, strict=True):
            column.min_width = max(column.min_width or 0, *map(len, cell.split()), 0)
        table.add_row(*row)
    needed = console.measure(table, options=console.options.update(max_width=10_000))
    console.width = max(console.width, needed.minimum) if console.is_terminal else needed.maximum
    console.print(table)


class Root(TyperGroup):
    """The `wizen` command: whatever goes wrong below it ends in one line and the right exit code."""

    def main(self, args: Sequence[str] | None = None, *rest: Any, **more: Any) -> Any:
        """Run a command line. Exits with 2 for bad input, 1 for other failures (what a store does not hold is
        one), 130 after Ctrl-C.
        """
        given = list(sys.argv[1:] if args is None else args)
        try:
            code = super().main(given, *rest, **{**more, "standalone_mode": False})
        except Exception as error:
            if os.environ.get("WIZEN_DEBUG") == "1":
                raise
            sys.exit(_complain(error, given))
        sys.exit(code if isinstance(code, int) else 0)


def _complain(error: Exception, given: Sequence[str]) -> int:
    if isinstance(error, BrokenPipeError):
        # the reader of our output has left (`| head`); Python must not stumble over it again at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    # the usage errors of typer's parser know how to put themselves in words
    usage = getattr(error, "format_message", None)
    if usage is not None:
        said = {"code": "invalid-usage", "message": usage().rstrip("."), "advice": "`--help` shows examples."}
        said["message"] += "."
        code = getattr(error, "exit_code", 2)
    elif isinstance(error, typer.Abort):
        said, code = {"code": "aborted", "message": "stopped.", "advice": ""}, 130
    elif isinstance(error, OSError):
        said, code = _system(error), 1
    else:
        said, code = describe(error), exit_code(error)
        if said["code"] == "cancelled":
            code = 130
        if said["code"] == "internal-error":
            said["advice"] = "This is a defect of wizen; WIZEN_DEBUG=1 shows where."
            odd = [word for word in given if _is_odd(word)]
            if odd:
                said = {"code": "invalid-usage", "message": f"{odd[0]!a} is not UTF-8.", "advice": "Write it so."}
                code = 2
    note(" ".join(f"error: {said['message']} {said['advice']}".split()))
    if "--json" in given:
        typer.echo(json.dumps({"error": said}, indent=2))
    return code


def _is_odd(word: str) -> bool:
    """Return whether a word of the command line is no text: bytes of another encoding."""
    try:
        word.encode()
    except UnicodeEncodeError:
        return True
    return False


def _system(error: OSError) -> dict[str, Any]:
    where = f"{error.filename}: " if error.filename else ""
    advice = "Name a place that can be written." if isinstance(error, PermissionError) else ""
    return {"code": "system-error", "message": f"{where}{error.strerror or error}.", "advice": advice}
