"""The console script `wizen`: the commands of the batch floor, plus `serve` and the service's file formats."""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sweeps.commands.cli import app
from sweeps.commands.terminal import kernels, regions, watchdog
from sweeps.commands.terminal.console import emit, note
from sweeps.errors import InvalidOption, SweepError
from sweeps.formats import extend, tell_by

from .commands import export as cli_export
from .commands import match as cli_match
from .commands import scene as cli_scene
from .limits import memory

if TYPE_CHECKING:
    import xarray as xr

    from store.shape import Shape
    from sweeps.formats import Encoder, Made

    from .formats import About, Format
    from .settings import Settings
    from .shapes.compiling import Compiling

__all__ = ["app", "main"]


#: Largest request body of a studio [bytes]: a mesh of 100,000 points as JSON, twice over.
_MESHES = 32 << 20


class PortInUse(SweepError):
    """Another program listens where the service should."""

    code = "port-in-use"


@app.command()
def serve(
    store: Annotated[
        Path | None, typer.Option("--store", metavar="DIR", help="The store whose tables are served.")
    ] = None,
    host: Annotated[str | None, typer.Option("--host", help="Address to listen on; 0.0.0.0 is all of them.")] = None,
    port: Annotated[int | None, typer.Option("--port", min=0, max=65535, help="0 takes any free one.")] = None,
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, max=256, help="Processes that answer, over one table in memory.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="A Dask scheduler whose workers run the jobs."),
    ] = None,
    studio: Annotated[
        bool,
        typer.Option(
            "--studio",
            help="Print an address whose page may run jobs for a day. A store that is not there is made, with the "
            "package's tables.",
        ),
    ] = False,
) -> None:
    """Serve the tables of a store over HTTP. What is not given comes from WIZEN_STORE, WIZEN_HOST, WIZEN_PORT,
    WIZEN_WORKERS and WIZEN_SCHEDULER.

    [bold]Examples[/bold]

    wizen serve --store demo

    wizen serve --studio --store mine

    wizen serve --store demo --host 0.0.0.0 --port 9000 --workers 4

    wizen serve --store /shared/fruits --scheduler tcp://10.0.0.1:8786
    """
    with memory.loading():
        own = (store or _own_store()) if studio else store
        # a studio answers its owner, whose own meshes are large
        body = _MESHES if studio and "WIZEN_MAX_BODY" not in os.environ else None
        settings = _settings(store=own, host=host, port=port, workers=workers, scheduler=scheduler, max_body=body)
        secret = _fitted_out(settings.store) if studio else ""
        listener = _listen(settings.host, settings.port)
        _announce(settings, listener.getsockname()[1], secret)
        _answer(settings, listener)


def _announce(settings: Settings, port: int, secret: str) -> None:
    from .commands.hints import hints

    where = f"[{settings.host}]" if ":" in settings.host else settings.host
    address = f"http://{where}:{port}"
    note(f"serving {settings.store} at {address}")
    if secret:
        # behind the number sign: browsers send that to nobody
        note(f"the studio: {address}/#token={secret}")
    for line in hints(settings.store, address, settings.page):
        note(line)


def _answer(settings: Settings, listener: socket.socket) -> None:
    """Answer requests until the process is told to stop."""
    import uvicorn

    from .app import create_app
    from .shapes.compiling import Compiling

    options = _protocols(settings)
    if settings.workers == 1:
        made = create_app(settings, is_warmed=True)
        with listener, _compiling(made.state.compiling):
            uvicorn.Server(uvicorn.Config(made, **options)).run(sockets=[listener])
        return
    # several processes, one that dies being replaced: they bind the address that was found to be free, and read their
    # settings from the environment
    port = listener.getsockname()[1]
    listener.close()
    for name in ("store", "scheduler"):
        if getattr(settings, name) is not None:
            os.environ[f"WIZEN_{name.upper()}"] = str(getattr(settings, name))
    with _compiling(Compiling()):
        uvicorn.run("service.app:app", host=settings.host, port=port, workers=settings.workers, **options)


def _protocols(settings: Settings) -> dict[str, Any]:
    """Return how uvicorn is to speak."""
    from .limits.connections import GuardedProtocol
    from .limits.sockets import GuardedSocket
    from .stopping import PATIENCE

    return {
        "log_level": "warning",
        "timeout_graceful_shutdown": PATIENCE,
        "http": GuardedProtocol,
        "ws": GuardedSocket,
        "ws_max_size": settings.max_body,
        "ws_per_message_deflate": False,  # what is sent is differences, which compress to two thirds at best
    }


@app.command()
def doctor(
    store: Annotated[Path | None, typer.Option("--store", metavar="DIR", help="The store to look at.")] = None,
    host: Annotated[str | None, typer.Option("--host", help="The address that the service would listen on.")] = None,
    port: Annotated[int | None, typer.Option("--port", min=1, max=65535, help="The port.")] = None,
    deep: Annotated[bool, typer.Option("--deep", help="Read every byte of results and tables as well.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Say what is wrong with this machine, the store and the port, and what to do. Exits with 1 if something is.

    [bold]Examples[/bold]

    wizen doctor

    wizen doctor --store demo --deep
    """
    from .commands.doctor import examine

    given = {"store": store, "host": host, "port": port}
    findings = []
    for finding in examine(_settings(**given), deep):
        findings.append(finding)
        if not as_json:
            mark = {"good": "ok  ", "note": "note", "bad": "BAD "}[finding.state]
            typer.echo(f"{mark}  {finding.what}: {finding.seen}")
            if finding.advice:
                typer.echo(f"      {finding.advice}")
    if as_json:
        emit([finding._asdict() for finding in findings], True, lambda _: None)
    if any(finding.state == "bad" for finding in findings):
        raise typer.Exit(1)


def _own_store() -> Path:
    """Return where the store of one's own is, or would be."""
    import platformdirs

    named = os.environ.get("WIZEN_STORE")
    return Path(named) if named else platformdirs.user_data_path("wizen") / "store"


def _fitted_out(root: Path) -> str:
    from .commands.studio import fit_out

    return fit_out(root)


@contextmanager
def _compiling(compiling: Compiling) -> Iterator[None]:
    compiling.begin()
    try:
        yield
    finally:
        compiling.end()


def _settings(**given: Any) -> Settings:
    """Return the settings of the environment, but for what is given."""
    from pydantic import ValidationError

    from .settings import Settings

    try:
        return Settings(**{name: value for name, value in given.items() if value is not None})
    except ValidationError as error:
        item = error.errors()[0]
        name = "_".join(str(part) for part in item["loc"]).upper()
        raise InvalidOption(f"WIZEN_{name}: {item['msg']}.") from None


def main() -> None:
    """Run the command line."""
    watchdog.guard()
    try:
        with kernels.kept():
            app()
    finally:
        watchdog.leave()


def _listen(host: str, port: int) -> socket.socket:
    """Return a listening socket; bound here, because uvicorn's own way to fail is a traceback in its log."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family, backlog=2048)
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise PortInUse(f"port {port} on {host} is in use.", "Choose another with --port, or 0 for any.") from None
        why = error.strerror or str(error)
        raise SweepError(f"cannot listen on {host}, port {port}: {why}.", "Choose another --host or --port.") from None


def _formats() -> Mapping[str, Encoder]:
    """Return the service's formats as encoders of the command line."""
    from sweeps.formats import Encoder

    from .formats import FORMATS
    from .sequences import EXPORTS, STILLS

    clips = {e.suffix: partial(_clip, e.name) for e in EXPORTS.values() if not e.single and e.suffix.count(".") == 1}
    known = {
        f.suffix: Encoder(
            f.fields,
            partial(_encode, f),
            True,
            clips.get(f.suffix),
            later=f.suffix if f.name in STILLS else ".glb",
        )
        for f in FORMATS.values()
    }
    runs = {s: Encoder(("position",), partial(_whole, clip), True, clip, runs=True) for s, clip in clips.items()}
    return {**runs, **known}


def _clip(name: str, run: xr.Dataset) -> bytes:
    from .sequences import EXPORTS, Options, prepared, write

    return write(prepared(run, Options()), EXPORTS[name], Options())


def _whole(clip: Callable[[xr.Dataset], bytes], made: Made) -> bytes:
    assert made.run is not None
    return clip(made.run)


def _encode(chosen: Format, made: Made) -> bytes:
    about = _about(made)
    # as over HTTP, where glTF alone says how long r1 is
    return chosen.encode(made.shapes[0], replace(about, metres=made.metres) if chosen.name == "glb" else about)


def _about(made: Made) -> About:
    from .formats import About

    about = About(made.solver, made.table, made.fixed, made.stage_symbol, made.units, made.detail)
    return replace(about, made=made.made, shade=made.shade, reach=made.reach)


def _told(shape: Shape, made: Made) -> Mapping[str, Any]:
    """Return what the service says of a shape in an archive of NumPy."""
    from .formats.about import extras, lattice

    about = _about(made)
    return {**extras(shape, about), "lattice": lattice(len(shape.colatitude), len(shape.azimuth), about)}


def _part(text: str) -> regions.Part:
    """Return the part of a surface that a text names, as `region` does over HTTP."""
    from .shapes import detail

    found = detail.read({"region": text})
    if found.wrong:
        first = found.wrong[0]
        raise InvalidOption(f"--region {first.detail}.", first.advice)
    top, bottom, left, right = map(float, found.region.replace(":", ",").split(","))
    return regions.Part(found.region, (top, bottom), (left, right), found.window)


extend(_formats)
tell_by(_told)
regions.read_by(_part)
cli_export.add_to(app)
cli_scene.add_to(app)
cli_match.add_to(app)

if __name__ == "__main__":
    main()
