"""Open tables, kept current: a new generation is taken up between two requests, and none is dropped for it.

Readers hold the `ShapeTable` that they were given until they are done; a swap only changes what the next one is given.
"""

from __future__ import annotations

import difflib
import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from solver import registry
from solver.contract import Solver
from store.errors import CorruptTable, UnknownTable
from store.families.choose import Families
from store.families.stored import families
from store.generations.generation import Judged, judged
from store.lookup import ShapeTable
from store.store import Store
from store.tables import TableInfo, info, path_of

from ..limits import memory
from ..telemetry import LOGGER

__all__ = ["LiveTables"]

#: A manifest as the file system tells it: another inode, time or size is another generation.
Stamp = tuple[int, int, int]


#: Seconds after which a generation that could not be opened is tried again, twice as many after each failure up to the
#: most: a copy may bring the manifest before the file that it names, and a disk may come back.
_AGAIN, _SELDOM = 0.5, 60.0


@dataclass
class _Open:
    """An open table: the manifest that was last looked at, what is wrong with its generation, and when to try again."""

    table: ShapeTable
    stamp: Stamp
    looked: float
    complaint: str = ""
    failures: int = 0
    again: float = math.inf


class LiveTables:
    """The store's tables by name, each opened when first asked for and looked at again at most every `interval` s.

    before_folds: called before a shape that folds is put out of contact, as `ShapeTable.open` says.
    """

    def __init__(self, root: Path, interval: float, before_folds: Callable[[], None] = lambda: None) -> None:
        self._root = root
        self.before_folds = before_folds
        self._interval = interval
        self._open: dict[str, _Open] = {}
        self._manifests: dict[str, tuple[Stamp, TableInfo]] = {}
        self._families: dict[str, tuple[Families, float]] = {}
        self._solvers: tuple[tuple[str, ...], float] | None = None
        self._opening = threading.Lock()
        self._looking = threading.Lock()
        self._store: Store | None = None

    @property
    def store(self) -> Store:
        """The store, opened when first needed, so that the service may start before it.

        Raises:
            MissingStore: there is none yet.

        """
        if self._store is None or not self._store.tables_dir.is_dir():
            self._store = Store.open(self._root)
        return self._store

    def names(self) -> list[str]:
        """Return the names of all tables.

        Raises:
            MissingStore: there is no store.

        """
        return self.store.table_names()

    def info(self, name: str) -> TableInfo:
        """Return what is known of a table.

        Raises:
            UnknownTable: there is none of that name.
            CorruptTable: its manifest is damaged.

        """
        self._known(name)
        return info(self.store, name)

    def judged(self, table: TableInfo) -> Judged:
        """Return what a table says of its own trust, without opening all of it; nothing if it cannot be read."""
        try:
            return _judged(path_of(self.store, table))
        except (CorruptTable, FileNotFoundError):
            return Judged(None, None)  # /healthz and /v1/shapes complain

    def complaint(self, name: str) -> str:
        """Return why the newest generation of an open table is not the one that is served, or nothing."""
        entry = self._open.get(name)
        return entry.complaint if entry else ""

    def get(self, name: str) -> ShapeTable:
        """Return the table's newest generation that is open; a newer one is opened meanwhile, for later requests.

        Raises:
            UnknownTable: there is none of that name, or no longer.
            CorruptTable: it is damaged, and no older generation is open.

        """
        entry = self._open.get(name)
        if entry is None:
            with self._opening:
                if name not in self._open:
                    self._open[name] = self._first(name)
                return self._open[name].table
        # one request looks; the others go on with what they have
        if time.monotonic() - entry.looked >= self._interval and self._looking.acquire(blocking=False):
            try:
                self._look(name, entry)
            finally:
                self._looking.release()
        return entry.table

    def belongs(self, name: str, solver: str) -> None:
        """Refuse a table that is not the solver's.

        Raises:
            UnknownTable: it is another's, or there is none of that name.

        """
        found = self._solver(name)
        if found != solver:
            raise UnknownTable(
                f"table {name!r} belongs to the solver {found!r}, not to {solver!r}.",
                f"Ask /v1/shapes/{found}, or choose another table.",
            )

    def families(self, solver: Solver) -> Families:
        """Return the solver's tables, to choose among; the same object until one of them changes.

        Raises:
            UnknownTable: there is none.

        """
        known = self._families.get(solver.name)
        now = time.monotonic()
        if known is not None and now - known[1] < self._interval:
            return known[0]  # the directory is not listed for every request
        found = families(self.store, solver, self._manifest)
        if known is not None and found.infos == known[0].infos:
            found = known[0]
        self._families[solver.name] = found, now
        return found

    def solvers(self) -> tuple[str, ...]:
        """Return the names of the solvers that have tables, sorted; looked at again at most every `interval` s.

        Raises:
            MissingStore: there is no store.
            CorruptTable: a manifest is damaged, and no older generation is open.

        """
        now = time.monotonic()
        if self._solvers is None or now - self._solvers[1] >= self._interval:
            self._solvers = tuple(sorted({self._manifest(name).solver for name in self.names()})), now
        return self._solvers[0]

    def is_open(self, name: str) -> bool:
        """Return whether `get` will find the table open."""
        return name in self._open

    def _manifest(self, name: str) -> TableInfo:
        """Return a table's manifest, that of the generation which is served where the newest is damaged."""
        stamp = self._stamp(name)
        known = self._manifests.get(name)
        if known is None or known[0] != stamp:
            try:
                known = stamp, info(self.store, name)
            except CorruptTable:
                if name not in self._open:
                    raise
                known = stamp, self._open[name].table.info
            self._manifests[name] = known
        return known[1]

    def _solver(self, name: str) -> str:
        # a table that is open need not be read again to know whose it is
        entry = self._open.get(name)
        return entry.table.info.solver if entry else self.info(name).solver

    def _known(self, name: str) -> None:
        # before any path is made of it: a name from outside is only compared
        names = self.names()
        if name not in names:
            near = difflib.get_close_matches(name, names, n=1)
            hint = f"Did you mean {near[0]!r}? " if near else ""
            raise UnknownTable(f"there is no table {name!r}.", f"{hint}GET /v1/tables lists all.")

    def _stamp(self, name: str) -> Stamp:
        try:
            status = (self.store.tables_dir / name / "current.json").stat()
        except FileNotFoundError:
            raise UnknownTable(f"there is no table {name!r}.", "GET /v1/tables lists all.") from None
        return status.st_ino, status.st_mtime_ns, status.st_size

    def _first(self, name: str) -> _Open:
        self._known(name)
        # the stamp comes first: a swap in between is then noticed at the next look
        stamp = self._stamp(name)
        opened = _Open(self._read(name), stamp, time.monotonic())
        memory.keep("tables")
        return opened

    def _read(self, name: str) -> ShapeTable:
        return ShapeTable.open(self.store, name, surfaces=registry.surface, before_folds=self.before_folds)

    def _look(self, name: str, entry: _Open) -> None:
        """See whether there is another generation, and open it on the side: a large one takes seconds to verify."""
        try:
            stamp = self._stamp(name)
        except UnknownTable:
            self._open.pop(name, None)
            raise
        entry.looked = time.monotonic()
        if stamp != entry.stamp:
            entry.failures = 0
        elif entry.looked < entry.again:
            return
        entry.stamp, entry.again = stamp, math.inf
        threading.Thread(target=self._renew, args=(name, entry, stamp), daemon=True).start()

    def _renew(self, name: str, entry: _Open, stamp: Stamp) -> None:
        try:
            table = self._read(name)
        except Exception as error:  # whatever it is, the old generation serves and the next try may go well
            if entry.stamp == stamp:
                entry.complaint = str(error) or type(error).__name__
                entry.again = time.monotonic() + min(_AGAIN * 2 ** min(entry.failures, 10), _SELDOM)
                entry.failures += 1
            LOGGER.error("table %s: keeping the old generation: %s", name, error)
            return
        if entry.stamp == stamp:  # else a still newer one is on its way
            entry.table, entry.complaint, entry.failures = table, "", 0
            LOGGER.info("table %s: new generation %s", name, table.digest)


@lru_cache(maxsize=256)
def _judged(path: Path) -> Judged:
    return judged(path)  # a generation's file never changes
