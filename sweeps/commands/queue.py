"""`wizen work`, `wizen token` and `wizen audit`: who works off what is asked for over HTTP, who may ask, who did."""

from __future__ import annotations

import re
import time
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InvalidOption
from .terminal.console import emit, grid, note
from .terminal.options import As_json, StorePath
from .terminal.tables import begin_store

if TYPE_CHECKING:
    from store.ledger.asks import Ask
    from store.store import Store

    from ..running.report import Event

__all__ = ["add_to"]

_SPAN = re.compile(r"(\d+(?:\.\d+)?)([smhd])")
_SECONDS = {"s": 1, "m": 60, "h": 3600, "d": 86400}

tokens = typer.Typer(
    no_args_is_help=True, rich_markup_mode="rich", help="Make, list and take back tokens for the service."
)


def add_to(app: typer.Typer) -> None:
    """Add these commands to the `wizen` command."""
    app.command()(work)
    app.command()(audit)
    app.add_typer(tokens, name="token")


def work(
    store: StorePath,
    workers: Annotated[int | None, typer.Option("--workers", help="Local processes; they share the cores.")] = None,
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", metavar="ADDRESS", help="A running Dask scheduler.")
    ] = None,
    until_empty: Annotated[bool, typer.Option("--until-empty", help="End when no job is left.")] = False,
    as_json: As_json = False,
) -> None:
    """Run the jobs that were asked for over HTTP, as they come. Stop it at any time; any number may run at once.

    A service with WIZEN_JOBS_WORKERS=0 leaves all jobs to such workers. With --until-empty the exit code is 1 if a job
    was given up.

    [bold]Examples[/bold]

    wizen work --store demo --workers 4

    wizen work --store demo --until-empty
    """
    import math

    from store.starter import check_own

    from ..running import executors
    from ..running.runner import run_queue
    from .terminal import progress
    from .terminal.words import failed as told

    given_up: list[str] = []

    def observe(event: Event) -> None:
        if event.kind == "done":
            note(f"{event.key[:12]} solved in {event.seconds:.1f} s")
        elif event.kind == "failed":
            given_up.append(event.key)
            note(f"failed {told(event.key, '', event.error or {}, store)}")

    check_own(store)
    with executors.choose(workers, scheduler=scheduler) as pool, progress.stopping(progress.GIVEN_BACK) as stop:
        note(f"working for {store} on {pool.title}")
        solved = run_queue(begin_store(store), pool, stop, 0.0 if until_empty else math.inf, observe)
    said = f"{solved} solved" + (f", {len(given_up)} failed" if given_up else "")
    emit({"solved": solved, "failed": given_up}, as_json, lambda console: console.print(said))
    if stop.is_set():
        raise typer.Exit(130)
    if given_up:
        raise typer.Exit(1)


def audit(
    store: StorePath,
    since: Annotated[str | None, typer.Option("--since", metavar="SPAN", help="How far back, e.g. 7d or 12h.")] = None,
    token: Annotated[str | None, typer.Option("--token", help="Only what this token asked for, by name or id.")] = None,
    as_json: As_json = False,
) -> None:
    """List who asked for which job over HTTP, from where, and how long it took. Secrets were never noted.

    [bold]Examples[/bold]

    wizen audit --store demo --since 7d

    wizen audit --store demo --token studio --json
    """
    from store.store import Store

    opened = Store.open(store)
    start = 0.0 if since is None else time.time() - _span(since, "--since")
    found = _asks(opened, start, token)
    if token is not None and not found:
        _check_known(opened, token)
    rows = [{**ask._asdict(), "at": _date(ask.at)} for ask in found]

    def show(console: Any) -> None:
        cells = [
            [r["at"], r["name"] or r["token"], r["client"], r["key"][:12], r["solver"], r["state"], _took(r)]
            for r in rows
        ]
        grid(console, ("asked", "token", "from", "job", "solver", "state", "seconds"), cells)

    emit({"asks": rows}, as_json, show)


def _asks(store: Store, since: float = 0.0, token: str | None = None) -> list[Ask]:
    """Return who asked for what; looking begins no ledger."""
    from store.ledger.asks import asks

    return asks(store.ledger.database, since, token) if store.ledger.path.is_file() else []


def _check_known(store: Store, token: str) -> None:
    """Refuse a token that neither is one nor ever asked for anything: revoked ones stay in the audit.

    Raises:
        UnknownToken: saying which are known.

    """
    from store.errors import UnknownToken
    from store.tokens import Tokens

    ids = {ask.token: ask.name for ask in _asks(store)} | {one.id: one.name for one in Tokens(store.root).all()}
    if token not in (*ids, *ids.values()):
        known = ", ".join(sorted({name or id for id, name in ids.items()}))
        raise UnknownToken(f"there is and was no token {token!r}.", f"Known: {known or 'none'}.")


def _took(row: dict[str, Any]) -> str:
    return f"{row['seconds']:.1f}" if row["seconds"] is not None else f"about {row['expected']:.0f}"


@tokens.command()
def create(
    store: StorePath,
    name: Annotated[str, typer.Option("--name", help="What the token is for; shown in lists.")],
    scopes: Annotated[str, typer.Option("--scopes", help="read, run or admin, or several: run includes read.")] = "run",
    expires: Annotated[
        str | None, typer.Option("--expires", metavar="SPAN", help="For how long, e.g. 90d, 12h; for ever if left out.")
    ] = None,
    as_json: As_json = False,
) -> None:
    """Make a token and print its secret, which cannot be shown again.

    [bold]Examples[/bold]

    wizen token create --store demo --name studio --scopes run --expires 90d
    """
    from store.tokens import Tokens

    wanted: Any = [part for part in re.split(r"[,\s]+", scopes) if part]
    seconds = None if expires is None else _span(expires, "--expires")
    token, secret = Tokens(begin_store(store).root).create(name, wanted, seconds)
    note(f"token {token.name!r} for {', '.join(token.scopes)}; the secret is not shown again:")
    emit({**_row(token), "secret": secret}, as_json, lambda console: console.print(secret, markup=False))


@tokens.command(name="list")
def list_(store: StorePath, as_json: As_json = False) -> None:
    """List the tokens of a store, without their secrets.

    [bold]Examples[/bold]

    wizen token list --store demo
    """
    from store.store import Store
    from store.tokens import Tokens

    rows = [_row(token) for token in Tokens(Store.open(store).root).all()]

    def show(console: Any) -> None:
        cells = [[r["name"], ", ".join(r["scopes"]), r["id"], r["created"], r["expires"] or "never"] for r in rows]
        grid(console, ("name", "scopes", "id", "created", "expires"), cells)

    emit({"tokens": rows}, as_json, show)


@tokens.command()
def revoke(
    name: Annotated[str, typer.Argument(help="Name or id of the token (`wizen token list`).")],
    store: StorePath,
    as_json: As_json = False,
) -> None:
    """Take a token back: services refuse it from the next request on.

    [bold]Examples[/bold]

    wizen token revoke studio --store demo
    """
    from store.store import Store
    from store.tokens import Tokens

    token = Tokens(Store.open(store).root).revoke(name)
    emit(_row(token), as_json, lambda console: console.print(f"revoked {token.name}", markup=False))


def _row(token: Any) -> dict[str, Any]:
    return {
        "id": token.id,
        "name": token.name,
        "scopes": list(token.scopes),
        "created": _date(token.created),
        "expires": None if token.expires is None else _date(token.expires),
        "expired": token.expired,
    }


def _date(seconds: float) -> str:
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(seconds))


def _span(text: str, option: str) -> float:
    match = _SPAN.fullmatch(text.strip())
    if match is None:
        raise InvalidOption(f"{option} {text!r} is not a span of time.", "Write for example 90d, 12h or 30m.")
    return float(match[1]) * _SECONDS[match[2]]
