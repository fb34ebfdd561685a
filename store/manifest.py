"""What a table is, on one page: the manifest that names its current generation and is swapped by rename."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from solver.contract import Quality

from . import seal
from .canonical import canonical
from .errors import CorruptTable, OutsideTable, UnknownTable
from .families.ties import Tie

__all__ = ["TableInfo", "directory", "read_manifest", "write_manifest"]

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")


@dataclass(frozen=True)
class TableInfo:
    """A generation of a table.

    `axes` are the parameters that vary, with their bounds; `fixed` those that do not. `places` says where each scalar
    sits in the solver's parameters, of which `template` is one complete set. `resolution` is the band limit and the
    lattice that holds it exactly. `digest` is that of the content; `created` (UTC) is not part of it. `tied` are
    parameters that vary along with an axis, `plan` is the text of the plan whose runs it holds.
    """

    name: str
    file: str
    digest: str
    solver: str
    version: str
    axes: dict[str, tuple[float, float]]
    fixed: dict[str, Any]
    stages: tuple[float, ...]
    resolution: int
    dtype: str
    samples: int
    descriptors: tuple[str, ...]
    need: dict[str, Any]
    template: dict[str, Any]
    places: dict[str, tuple[str, int | None]]
    keys: tuple[str, ...]
    created: str
    tied: dict[str, Tie] = field(default_factory=dict)
    plan: str = ""

    def complete(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return values on the axes, and with them those of the parameters that follow.

        Raises:
            OutsideTable: nobody knows what follows there.

        """
        return {**values, **self.following(values)} if self.tied else dict(values)

    def following(self, values: Mapping[str, float], given: Collection[str] = ()) -> dict[str, float]:
        """Return the values of the parameters that follow those on the axes, but of the `given` ones.

        Raises:
            OutsideTable: nobody knows them there; which, and to what end they are known.

        """
        ties = {name: tie for name, tie in self.tied.items() if tie.leader in values and name not in given}
        found = {name: tie.beyond(values[tie.leader]) for name, tie in ties.items()}
        lost = [name for name, value in found.items() if value is None]
        if lost:
            tie = ties[lost[0]]
            raise OutsideTable(
                f"what goes with {tie.leader} = {values[tie.leader]:.9g} is not known: table {self.name!r} has "
                f"{', '.join(lost)} follow it from {tie.at[0]:.12g} to {tie.at[-1]:.12g}.",
                f"Say {', '.join(lost)} as well, or stay within it.",
            )
        return {name: value for name, value in found.items() if value is not None}

    @property
    def quality(self) -> Quality:
        """Quality of the runs that it holds."""
        found: Quality = self.need["quality"]
        return found

    @property
    def reach(self) -> tuple[float, float]:
        """First and last stage that can be asked for: those stored, and the fresh 0, which goes without saying."""
        return min(0.0, self.stages[0]), max(0.0, self.stages[-1])

    def to_json(self) -> dict[str, Any]:
        """Return the manifest as JSON values."""
        found: dict[str, Any] = json.loads(json.dumps(asdict(self)))
        return found

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> TableInfo:
        """Return the manifest in JSON values.

        Raises:
            TypeError, KeyError, ValueError: it is not one.

        """
        fields = dict(values)
        for name in ("stages", "descriptors", "keys"):
            fields[name] = tuple(fields[name])
        fields["axes"] = {axis: (float(low), float(high)) for axis, (low, high) in fields["axes"].items()}
        fields["places"] = {axis: (field, index) for axis, (field, index) in fields["places"].items()}
        fields["tied"] = {name: Tie.from_json(tie) for name, tie in fields.get("tied", {}).items()}
        return cls(**fields)


def directory(tables: Path, name: str) -> Path:
    """Return the directory of the table `name`.

    Raises:
        UnknownTable: no table can have that name.

    """
    if _NAME.fullmatch(name) is None:
        raise UnknownTable(f"{name!r} is not a table's name.", "Use letters, digits, '-', '_' and '.', at most 64.")
    return tables / name


def write_manifest(tables: Path, info: TableInfo) -> None:
    """Make `info` the current generation of its table, at once for all who open it from now on.

    Raises:
        StorageFull: the disk is full; the old generation stays current.

    """
    values = info.to_json()
    page = {"checksum": _checksum(values), **values}
    seal.publish(directory(tables, info.name) / "current.json", json.dumps(page, indent=1).encode())


def read_manifest(tables: Path, name: str) -> TableInfo:
    """Return the current generation of the table `name`.

    Raises:
        UnknownTable: there is none of that name.
        CorruptTable: its manifest is damaged.

    """
    path = directory(tables, name) / "current.json"
    try:
        values = json.loads(path.read_bytes())
        checksum = values.pop("checksum")
        if checksum != _checksum(values):
            raise ValueError("its checksum is wrong")
        return TableInfo.from_json(values)
    except FileNotFoundError:
        known = sorted(p.parent.name for p in tables.glob("*/current.json"))
        hint = f"Known: {', '.join(known)}." if known else "Build one first."
        raise UnknownTable(f"there is no table {name!r}.", hint) from None
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise CorruptTable(f"{path} is damaged ({error}).", "Build the table again from the shards.") from error


def _checksum(values: Mapping[str, Any]) -> str:
    return hashlib.sha256(canonical(values)).hexdigest()
