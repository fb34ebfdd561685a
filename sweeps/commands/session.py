"""`wizen session`: a live engine driven by a file of actions, without a network."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import BAD_INPUT, InvalidOption
from .terminal.console import note
from .terminal.options import check_place, parameters

__all__ = ["add_to"]

#: What the first message may say; a file that was sent over a connection may be read again, whoever its token was.
_OPENING = ("do", "params", "preset", "quality", "fields", "token", "id")


def add_to(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(session)


def session(
    solver: Annotated[str, typer.Argument(metavar="SOLVER", help="One that offers a live engine, such as growth.")],
    actions: Annotated[
        Path, typer.Argument(metavar="ACTIONS", help="Messages, one JSON object a line; - reads standard input.")
    ],
    params_file: Annotated[
        Path | None, typer.Option("--params", metavar="FILE", help="Parameters to begin with, TOML or JSON.")
    ] = None,
    preset: Annotated[str | None, typer.Option("--preset", help="Named parameters to begin with.")] = None,
    quality: Annotated[str | None, typer.Option("--quality", help="preview (as is usual), default or fine.")] = None,
    save: Annotated[
        Path | None, typer.Option("--save", metavar="FILE.toml", help="The session as a parameter file.")
    ] = None,
) -> None:
    """Do to a growing shape what a file says, action by action, and save it as parameters that give it again.

    Each line is a message of docs/sessions.md without its id, and is done with before the next one is read: brushes,
    tools, solids, play, undo, redo. The first may be an `open` with what to begin with, which the options come before.
    Replies go to standard output, a line each.

    [bold]Examples[/bold]

    wizen session growth examples/growth/painted.jsonl --save painted.toml

    wizen session growth - --params examples/growth/c-pumpkin.toml --quality default --save pumpkin.toml
    """
    if save is not None:
        check_place("--save", save)
    saved = _driven(solver, list(_messages(actions)), params_file, preset, quality)
    if save is not None:
        save.write_text(saved["toml"].replace("session.toml", save.name, 2), encoding="utf-8")
        note(f"saved; the same again: {saved['command'].replace('session.toml', str(save))}")


def _driven(
    solver: str, messages: list[dict[str, Any]], params_file: Path | None, preset: str | None, quality: str | None
) -> dict[str, Any]:
    """Do what the messages say, and return the session as it is saved."""
    from typing import get_args

    from threadpoolctl import threadpool_limits

    from solver import registry
    from solver.contract import InvalidInput, Quality, SolverError

    from ..live.desk import Desk

    chosen = registry.get(solver)
    opening = messages.pop(0) if messages and messages[0].get("do") == "open" else {}
    strange = [name for name in opening if name not in _OPENING]
    if strange:
        raise InvalidOption(f"open does not take {strange[0]!r} here.", f"It takes {', '.join(_OPENING[1:4])}.")
    values = parameters(params_file) or opening.get("params") or {}
    named = preset or opening.get("preset")
    if named is not None and not isinstance(named, str):
        raise InvalidOption(f"open: {named!r} names no preset.", f"Known: {', '.join(sorted(chosen.presets))}.")
    wanted = quality or opening.get("quality", "preview")
    found: Quality | None = next((known for known in get_args(Quality) if known == wanted), None)
    if found is None:
        raise InvalidOption(f"there is no quality {wanted!r}.", f"Take {', '.join(get_args(Quality))}.")
    failed: list[Mapping[str, Any]] = []

    def say(told: dict[str, Any]) -> None:
        if told["say"] in ("done", "saved", "error"):
            typer.echo(json.dumps({k: v for k, v in told.items() if k != "toml"}))
        if told["say"] == "error":
            failed.append(told["problem"])

    with threadpool_limits(1, user_api="blas"):
        params = chosen.parse(values, named)
        desk = Desk(chosen, params, found, (), say, lambda frame: None)
        for number, message in enumerate(messages, 1):
            if message.get("do") == "play" and message.get("until") is None:
                raise InvalidOption(f"message {number}: play without `until` has no end here.", 'Add "until".')
            desk.take({**message, "id": number})
            desk.finish()
            if failed:
                code = str(failed[0]["type"]).rpartition(":")[2]
                # what was asked for is wrong, or it could not be done
                kind = InvalidInput if code in BAD_INPUT else SolverError
                raise kind(f"message {number}: {failed[0]['detail']}", advice=str(failed[0]["advice"]))
        return desk.saved()


def _messages(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the messages of a file.

    Raises:
        InvalidOption: it cannot be read, or a line is no JSON object.

    """
    try:
        text = sys.stdin.read() if str(path) == "-" else path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidOption(f"{path} cannot be read: {error}.", "Name a file of messages.") from None
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip():
            continue
        try:
            message = json.loads(line)
        except ValueError as error:
            raise InvalidOption(f"{path}, line {number}: {error}.", "Write one JSON object a line.") from None
        if not isinstance(message, dict):
            raise InvalidOption(f"{path}, line {number}: no JSON object.", 'Write for example {"do": "undo"}.')
        yield message
