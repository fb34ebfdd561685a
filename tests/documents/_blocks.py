"""The code blocks of the documents, fenced or indented, with the place where they stand."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCUMENTS = (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md")))


@dataclass(frozen=True)
class Block:
    """One block: its document, the line it begins at, its language ("" where none is said) and its text."""

    path: Path
    line: int
    language: str
    text: str

    def __str__(self) -> str:
        return f"{self.path.name}:{self.line}"


def blocks() -> list[Block]:
    """Return all code blocks of all documents, in order."""
    return [block for path in DOCUMENTS for block in _blocks(path)]


def commands(block: Block) -> list[str]:
    """Return the commands of a block, those behind a `$` if it shows output, too; lines ended by a backslash joined."""
    text = re.sub(r"\\\n\s*", " ", block.text)
    lines = text.splitlines()
    if any(line.startswith("$ ") for line in lines):
        return [line[2:] for line in lines if line.startswith("$ ")]
    return [line for line in lines if line.strip() and not line.startswith("#")]


def _blocks(path: Path) -> list[Block]:
    found: list[Block] = []
    lines = path.read_text(encoding="utf-8").splitlines()
    number = 0
    while number < len(lines):
        line = lines[number]
        if line.startswith("```"):
            end = next(n for n in range(number + 1, len(lines)) if lines[n].startswith("```"))
            found.append(Block(path, number + 2, line[3:].strip(), "\n".join(lines[number + 1 : end])))
            number = end + 1
        elif line.startswith("    ") and (number == 0 or not lines[number - 1].strip()):
            end = number
            # a blank line does not end a block that goes on behind it
            while end < len(lines) and (lines[end] or "".join(lines[end + 1 : end + 2])).startswith("    "):
                end += 1
            if not _in_list(lines[:number]):
                found.append(Block(path, number + 1, "", "\n".join(text[4:] for text in lines[number:end])))
            number = end
        else:
            number += 1
    return found


def _in_list(before: list[str]) -> bool:
    """Whether what is indented goes on with a list's entry."""
    text = next((line for line in reversed(before) if line.strip()), "")
    return bool(re.match(r"(?:[-*] |\d+\. |  )", text))
