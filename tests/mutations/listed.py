"""The list of mutations: what is changed where, and which tests should notice."""

from __future__ import annotations

import hashlib
import tomllib
from dataclasses import dataclass
from pathlib import Path

__all__ = ["HERE", "ROOT", "Mutation", "listed"]

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]


@dataclass(frozen=True)
class Mutation:
    """One change of one file. `tests`: files, tests or pytest options, as on a command line; `why`: what it breaks."""

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]
    why: str

    @property
    def path(self) -> Path:
        """The file, in the working tree."""
        return ROOT / self.file

    def applied(self, text: str) -> str:
        """Return the file's text with the change.

        Raises:
            ValueError: the old text is not there exactly once, or the change changes nothing.

        """
        if text.count(self.old) != 1 or self.old == self.new:
            raise ValueError(f"{self.name}: the old text occurs {text.count(self.old)} times in {self.file}.")
        return text.replace(self.old, self.new)

    def digest(self, root: Path) -> str:
        """Of all that its outcome hangs on most, in a tree: file, change and tests; 16 hexadecimal digits."""
        total = hashlib.sha256("\0".join((self.old, self.new, *self.tests)).encode())
        for path in (root / self.file, *(root / path.relative_to(ROOT) for path in files_of(self.tests))):
            total.update(path.read_bytes() if path.is_file() else path.name.encode())
        return total.hexdigest()[:16]


def files_of(tests: tuple[str, ...]) -> list[Path]:
    """Return the test files that a selection names."""
    return [ROOT / word.partition("::")[0] for word in tests if word.startswith("tests/")]


def listed() -> list[Mutation]:
    """Return all mutations, in the order of the files beside this one and within them."""
    found = []
    for path in sorted(HERE.glob("*.toml")):
        page = tomllib.loads(path.read_text())
        for entry in page["mutation"]:
            tests = entry.pop("tests", page.get("tests"))
            found.append(Mutation(**entry, tests=tuple(tests)))
    return found
