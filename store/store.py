"""A store: one directory with shards, tables and a ledger of what was wanted and done.

root/shards/ab/abcd....h5   one file per result, named by its key
root/tables/<name>/         generations of look-up tables
root/plans/<name>.toml      plans as they were written when last swept
root/ledger.sqlite          who computes what; can be rebuilt from the shards
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self
from urllib.parse import quote

from . import seal, shards, starter
from .errors import CorruptShard, MissingStore, UnknownJob, full_disk
from .keys import is_key
from .ledger.ledger import Ledger

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Store"]


class Store:
    """Results by key. Safe among threads and processes: a result never changes once it is visible."""

    def __init__(self, root: Path | str) -> None:
        self.root = Path(root)

    @classmethod
    def open(cls, root: Path | str, create: bool = False) -> Self:
        """Return the store in directory `root`, cleaned of what killed processes left behind.

        Raises:
            MissingStore: there is none, and `create` is false.
            ReadOnlyStore: it cannot be made there.

        """
        store = cls(root)
        if create:
            with full_disk(store.root):
                seal.make_directory(store._shards)
                seal.make_directory(store.tables_dir)
        elif not store._shards.is_dir():
            raise MissingStore(
                f"there is no store in {store.root.absolute()}.",
                "Run a sweep with that directory to create it, or name another one.",
            )
        for directory in (store.root, store._shards, store.tables_dir):
            seal.clean(directory)
        return store

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.root,)

    def __repr__(self) -> str:
        return f"Store({str(self.root)!r})"

    @property
    def _shards(self) -> Path:
        return self.root / "shards"

    @property
    def tables_dir(self) -> Path:
        """The directory that holds one directory per table."""
        return self.root / "tables"

    @cached_property
    def ledger(self) -> Ledger:
        """The record of jobs; its file appears with the first job."""
        return Ledger(self.root / "ledger.sqlite")

    def keep_plan(self, name: str, text: str) -> None:
        """Keep a plan as it is written, for the tables that are built of its runs."""
        seal.make_directory(self.root / "plans")
        seal.publish(self._plan(name), text.encode())

    def plan(self, name: str) -> str:
        """Return a plan as it was written when it was last swept; an empty text where nobody kept it."""
        try:
            return self._plan(name).read_text(encoding="utf-8")
        except OSError:
            return ""

    def _plan(self, name: str) -> Path:
        # plans may be called anything
        return self.root / "plans" / f"{quote(name, safe=' ')[:200]}.toml"

    def table_names(self) -> list[str]:
        """Return the names of the tables that can be opened, sorted."""
        return sorted(path.parent.name for path in self.tables_dir.glob("*/current.json"))

    def shard_path(self, key: str) -> Path:
        """Return where the result of `key` is or would be.

        Raises:
            UnknownJob: `key` is not a key at all.

        """
        if not is_key(key):
            raise UnknownJob(f"{key!r} is not a key.", "A key has 64 hexadecimal digits.")
        return self._shards / key[:2] / f"{key}.h5"

    def has(self, key: str) -> bool:
        """Return whether a result is stored under `key`. Whether it reads well is for `get` to find out."""
        return is_key(key) and self.shard_path(key).is_file()

    def find(self, key: str) -> xr.Dataset | None:
        """Return the result of `key` if it is here or comes with the package: `library` of runs that start from others.

        Raises:
            CorruptShard: it is damaged, or belongs to another key.

        """
        return self.get(key) if self.has(key) else starter.result(key)

    def put(self, key: str, dataset: xr.Dataset) -> str:
        """Store a result and return its content digest. One that is there already, undamaged, is kept.

        Raises:
            StorageFull: the disk is full.
            UnknownJob: `key` is not a key at all.

        """
        if self.has(key):
            try:
                found: str = self.get(key).attrs["digest"]
                return found
            except CorruptShard:
                pass  # replaced below by the good one
        return shards.write(self.shard_path(key), dataset, key)

    def get(self, key: str) -> xr.Dataset:
        """Return the result of `key`, in memory and verified.

        Raises:
            UnknownJob: nothing is stored under `key`.
            CorruptShard: it is damaged, or belongs to another key.

        """
        path = self.shard_path(key)
        try:
            dataset = shards.read(path)
        except FileNotFoundError:
            raise UnknownJob(f"no result is stored under {key}.", "Ask for it with a job or a sweep.") from None
        if dataset.attrs.get("key") != key:
            raise CorruptShard(f"{path} holds the result of another key.", "Delete it and run the same sweep again.")
        return dataset

    def keys(self) -> Iterator[str]:
        """Yield the keys of all stored results, sorted."""
        for path in sorted(self._shards.glob("??/*.h5")):
            if is_key(path.stem):
                yield path.stem

    def results(self, keys: Iterable[str] | None = None) -> Iterator[xr.Dataset]:
        """Yield all stored results (or those of `keys`) that read well, by key, one in memory at a time."""
        for key in self.keys() if keys is None else keys:
            try:
                yield self.get(key)
            except CorruptShard:
                continue

    def learn(self, keys: Iterable[str] | None = None) -> int:
        """Let the ledger know of results that came without it: copied in, or from before it was lost; return how many.

        All are looked at, or `keys`. Those that are damaged are passed over.

        Raises:
            StoreError: the ledger cannot be read, or is not to be written and lacks some.

        """
        if keys is None:
            known = {job.key for state in ("done", "running") for job in self.ledger.jobs(state)}
            keys = [key for key in self.keys() if key not in known]
        return self.ledger.learn(self.results(keys))
