"""What is wrong with this machine, this store, this port and this installation: one finding per thing looked at.

Nothing is changed but for one small file that is written into the store's directory and removed again.
"""

from __future__ import annotations

import errno
import importlib
import importlib.metadata
import importlib.util
import os
import shlex
import shutil
import socket
import sqlite3
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Literal, NamedTuple
from urllib.error import URLError
from urllib.request import urlopen

from solver import registry
from store import tables
from store.checking import audit
from store.errors import NetworkFileSystem, StoreError
from store.ledger.database import readable
from store.ledger.filesystem import filesystem, refuse_network
from store.store import Store
from sweeps.commands.terminal import kernels

from ..settings import Settings

__all__ = ["Finding", "examine"]

#: A sweep's shards and a table of them take so much [bytes]; below it a sweep ends in StorageFull.
_ROOM = 2e9
#: A stage of a fine run holds so much while it marches [bytes].
_MEMORY = 2e9
#: A file's time may differ from the clock by the granularity of either [s].
_SKEW = 5.0
#: What the extras bring: package, and what it is for.
_EXTRAS = {
    "distributed": "runs on many machines: pip install '.[cluster]'",
    "trimesh": "meshes of one's own: pip install '.[formats]'",
    "OpenEXR": "maps in floating point: pip install '.[formats]'",
    "pxr": "USD files: pip install '.[usd]'",
    "meshoptimizer": "scenes in fewer bytes: pip install '.[scenes]'",
    "xatlas": "textures on meshes that have no coordinates: pip install '.[unwrap]'",
    "pypardiso": "MKL's sparse factor (WIZEN_FACTOR): pip install '.[mkl]'",
}

State = Literal["good", "note", "bad"]


class Finding(NamedTuple):
    """What was looked at, how it is, what was seen, and what to do where it is not good."""

    what: str
    state: State
    seen: str
    advice: str = ""


def examine(settings: Settings, deep: bool = False) -> Iterator[Finding]:
    """Yield what is found, quick things first; `deep` reads every byte of the store's results and tables."""
    yield _installation()
    yield from _extras()
    yield _kernels()
    yield _memory()
    yield _port(settings.host, settings.port)
    yield _page(settings.page)
    root = settings.store
    place = _place(root)
    yield place
    if not root.is_dir():
        yield Finding("store", "note", f"there is none in {root}", "`wizen sweep PLAN --store DIR` makes one.")
        return
    yield _room(root)
    yield _writing(root)
    if place.state != "bad":
        yield _ledger(root)
    yield from _tables(root, deep)
    if deep:
        yield from _results(Store(root))


def _installation() -> Finding:
    """The four packages are the ones that were installed, and no folder of the working directory hides them."""
    here = Path(__file__).resolve().parents[2]
    for name in ("solver", "store", "sweeps", "service"):
        origin = getattr(importlib.import_module(name), "__file__", None)
        if origin is None or Path(origin).resolve().parents[1] != here:
            where = origin or "a folder without Python in it"
            return Finding("installation", "bad", f"`{name}` is {where}", "Start wizen in another directory.")
    version = importlib.metadata.version("wizen")
    return Finding("installation", "good", f"wizen {version} in {here}, solvers {', '.join(registry.names())}")


def _extras() -> Iterator[Finding]:
    missing = {name: use for name, use in _EXTRAS.items() if importlib.util.find_spec(name) is None}
    for name, use in missing.items():
        yield Finding("extras", "note", f"{name} is not installed", f"It is for {use} in a checkout.")
    if not missing:
        yield Finding("extras", "good", "all installed")


def _kernels() -> Finding:
    """Compiled loops can be kept: else each process compiles for a minute."""
    import llvmlite.binding
    import numba

    place = kernels.place()
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    processor = os.environ.get("NUMBA_CPU_NAME") or llvmlite.binding.get_host_cpu_name()
    said = f"compiled for {processor}, {cores} cores, {numba.get_num_threads()} threads"
    if place is not None:
        return Finding("kernels", "good", f"{said}, kept in {place}")
    advice = "Set NUMBA_CACHE_DIR to a directory that lasts, or each process compiles anew, a minute or more."
    return Finding("kernels", "note", f"{said}; no directory may be written to keep it", advice)


def _memory() -> Finding:
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        free = next(1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable"))
    except (OSError, ValueError, StopIteration):
        return Finding("memory", "note", "this system does not say how much is free")
    if free < _MEMORY:
        return Finding("memory", "note", f"{free / 1e9:.1f} GB free", "Fine meshes take up to 2 GB: prefer `default`.")
    return Finding("memory", "good", f"{free / 1e9:.1f} GB free")


def _port(host: str, port: int) -> Finding:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        socket.create_server((host, port), family=family).close()
    except OSError as error:
        if error.errno == errno.EADDRINUSE and _is_ours(host, port):
            return Finding("port", "good", f"a wizen service answers on {host}, port {port}")
        why = error.strerror or str(error)
        return Finding("port", "bad", f"{host}, port {port}: {why}", "Choose another: `wizen serve --port 0`.")
    return Finding("port", "good", f"{host}, port {port} is free")


def _is_ours(host: str, port: int) -> bool:
    where = f"[{host}]" if ":" in host else host
    try:
        with urlopen(f"http://{where}:{port}/openapi.json", timeout=5) as answer:
            return b'"title":"wizen"' in answer.read(4096).replace(b" ", b"")
    except (URLError, OSError, ValueError):
        return False


def _page(built: Path) -> Finding:
    if (built / "index.html").is_file():
        return Finding("page", "good", f"built in {built}")
    return Finding(
        "page", "note", "the web page is not built", "`make page` in a checkout builds it; WIZEN_PAGE says where it is."
    )


def _place(root: Path) -> Finding:
    found = filesystem(root)
    where = f"{root} on {found[0]}, mounted at {found[1]}" if found else str(root)
    try:
        refuse_network(root)
    except NetworkFileSystem as error:
        return Finding("file system", "bad", error.message, error.advice)
    return Finding("file system", "good", where)


def _room(root: Path) -> Finding:
    free = shutil.disk_usage(root).free
    if free < _ROOM:
        return Finding("disk", "note", f"{free / 1e9:.1f} GB free", "Make room before a sweep; a result takes 1-50 MB.")
    return Finding("disk", "good", f"{free / 1e9:.1f} GB free")


def _writing(root: Path) -> Finding:
    """The store may be written, and its file system's clock is this machine's."""
    try:
        with tempfile.NamedTemporaryFile(dir=root, prefix=".doctor-") as file:
            file.write(b"x")
            file.flush()
            skew = Path(file.name).stat().st_mtime - time.time()
    except OSError as error:
        advice = "Tables are served all the same; sweeps and jobs need a store of their own: `--store DIR`."
        return Finding("writing", "note", f"{root}: {error.strerror}", advice)
    if abs(skew) > _SKEW:
        advice = "Leases do not mind, logs do: let NTP set both clocks."
        return Finding("clock", "note", f"files in {root} are {skew:+.0f} s off this machine's clock", advice)
    return Finding("writing", "good", "files can be written, and the clock is the file system's")


def _ledger(root: Path) -> Finding:
    path = root / "ledger.sqlite"
    if not path.exists():
        return Finding("ledger", "good", "none yet: it appears with the first job")
    try:
        with closing(sqlite3.connect(readable(path), uri=True, timeout=5)) as connection:
            said = connection.execute("PRAGMA quick_check").fetchone()[0]
            version = connection.execute("PRAGMA user_version").fetchone()[0]
            counts = dict(connection.execute("SELECT state, count(*) FROM jobs GROUP BY state")) if said == "ok" else {}
            done = connection.execute("SELECT key FROM jobs WHERE state = 'done'").fetchall() if counts else []
    except sqlite3.Error as error:
        if getattr(error, "sqlite_errorname", "").startswith(("SQLITE_CANTOPEN", "SQLITE_READONLY")):
            # nothing is known of what is in it
            return Finding("ledger", "bad", f"{path}: {error}", "Ask as the user whose store it is.")
        said, counts, version, done = str(error), {}, 0, []
    known = Store(root).ledger.database.version
    if version > known:
        advice = "Install the wizen that wrote it, or restore a backup from before."
        return Finding("ledger", "bad", f"{path} has version {version}, this program reads {known}", advice)
    if said != "ok":
        advice = f"Delete {path}* (three files); `wizen sweep` makes it anew from the results that are stored."
        return Finding("ledger", "bad", said, advice)
    told = ", ".join(f"{n} {state}" for state, n in counts.items()) or "empty"
    gone = [key for (key,) in done if not Store(root).has(key)]
    if gone:
        advice = "Sweep their plans again, or restore the last backup, which keeps what it had."
        return Finding("ledger", "note", f"{told}; the results of {len(gone)} that are done are not here", advice)
    return Finding("ledger", "good", told)


def _tables(root: Path, deep: bool) -> Iterator[Finding]:
    store, named = Store(root), shlex.quote(str(root))
    names = store.table_names()
    if not names:
        yield Finding("tables", "note", "none yet", f"`wizen table build --store {named}` makes one from its results.")
    for name in names:
        try:
            table = tables.info(store, name)
        except StoreError as error:
            yield Finding("tables", "bad", error.message, error.advice)
            continue
        said = f"{name}: {table.solver} {table.version}, {len(table.keys)} runs"
        if table.solver not in registry.names():
            yield Finding("tables", "bad", said, "Its solver is not installed: install it, or move the table away.")
            continue
        solver = registry.get(table.solver)
        anew = f"version {solver.version} of the solver is installed: sweep its plan again."
        if not solver.answers_from(table.version):
            yield Finding("tables", "bad", said, f"It is refused as stale; {anew}")
        elif table.version != solver.version:
            yield Finding("tables", "note", said, f"It is served as it is; {anew}")
        else:
            yield Finding("tables", "good", said)
        if deep:
            try:
                wrong = audit.verify(store, name)
            except StoreError as error:
                yield Finding("bytes", "bad", f"{name}: {error.message}", error.advice)
                continue
            advice = f"`wizen table rebuild --store {named}` makes the table anew from its results."
            for found in wrong:
                told = f"{name}: {found.message}"
                yield Finding("bytes", "note", told) if found.remark else Finding("bytes", "bad", told, advice)
            if not wrong:
                yield Finding(
                    "bytes", "good", f"{name}: every byte is as it was written, and the runs can be had again"
                )


def _results(store: Store) -> Iterator[Finding]:
    """Every result reads as it was written, whether a table holds it or not."""
    count = damaged = 0
    for key in iter(store.keys()):
        count += 1
        try:
            store.get(key)
        except StoreError as error:
            damaged += 1
            yield Finding("results", "bad", error.message, error.advice)
    if not damaged:
        yield Finding("results", "good", f"{count}, every byte as it was written")
