"""The documents' figures, rendered from their records: python -m benchmarks.documents [--check] (`make docs`).

Two kinds of comments mark figures in README.md and docs/*.md; both end at `<!-- end -->`:

`<!-- figures: NAME [PART] -->`: what is between is rendered from `benchmarks/results/NAME.json`; nobody types there.
`<!-- measured: SOLVER VERSION -->`: a paragraph with figures that no record holds, and the version that they are of.

Where the version is behind the solver's, or a record was taken over from text, the rendering says so.
"""

from __future__ import annotations

import argparse
import difflib
import importlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from solver import registry

from . import figures

DOCUMENTS = (figures.ROOT / "README.md", *sorted((figures.ROOT / "docs").glob("*.md")))
_BLOCK = re.compile(r"<!-- (figures|measured): ([^>]*?) -->\n(.*?)<!-- end -->", re.DOTALL)
#: A table with one of these has times in it.
_TIMED = re.compile(r"CPU s|wall s|seconds|\bms\b|\bns\b|\d s\b|processor")
_NOTE = re.compile(r"\n*\*(?:Measured with version|Taken over from|Run beside)[^*]*\*\n*\Z")


def rendered(text: str) -> str:
    """Return a document with all its marked figures as their records have them."""
    return _BLOCK.sub(lambda block: _one(*block.groups()), text)


def _one(kind: str, about: str, body: str) -> str:
    if kind == "figures":
        name, *part = about.split()
        record = figures.load(name)
        text = "\n" + table(record, *part) + "\n"
        solver, version, source = record.get("solver"), record.get("version"), record["source"]
        timed = bool(_TIMED.search(text))
        commit, beside = record["commit"], busy(record.get("machine") or {}) * timed
    else:
        solver, version = about.split()
        text, source, commit, beside = _NOTE.sub("", body.rstrip("\n")) + "\n", "run", "", ""
    said = " ".join(filter(None, (note(solver, version, source, commit), beside)))
    text += f"\n*{said}*\n" if said else ""
    return f"<!-- {kind}: {about} -->\n{text}" + ("\n" if kind == "figures" else "") + "<!-- end -->"


def table(record: figures.Row, *part: str) -> str:
    """Return a record's table as Markdown: its own, or what the module `tables` beside its benchmark makes of it, as of
    each part of a record.
    """
    if "table" in record and not part:
        return figures.markdown(record["table"]["head"], record["table"]["rows"])
    room = str(record["name"]).split("-")[0]
    made: str = importlib.import_module(f"benchmarks.{room}.tables").table(record, *part)
    return made


def note(solver: str | None, version: str | None, source: str, commit: str = "") -> str:
    """Return what has to be said of figures of that version; nothing if there is nothing to say."""
    now = registry.get(solver).version if solver else None
    behind = f" of `{solver}`; it is {now} now" if version != now else f" of `{solver}`"
    if source == "text":
        of = f", version {version}{behind}" if solver else ""
        return f"Taken over from the text at commit {commit}{of}: no record of the runs was kept."
    return f"Measured with version {version}{behind}." if version != now else ""


def busy(machine: figures.Row) -> str:
    """Return what has to be said of seconds that were measured on a machine that had more to do than it has cores."""
    load, cores = machine.get("load") or 0.0, machine.get("cores") or 1
    if load <= 1.5 * cores:
        return ""
    return f"Run beside other work (load {load:.0f} on {cores} cores): compare seconds within the table only."


def stale() -> Iterator[tuple[Path, str]]:
    """Yield each document that differs from its rendering, and how."""
    for path in DOCUMENTS:
        text = path.read_text(encoding="utf-8")
        fresh = rendered(text)
        if fresh != text:
            lines = difflib.unified_diff(text.splitlines(), fresh.splitlines(), "document", "records", "", "", 0, "")
            yield path, "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing; exit with 1 where a document differs")
    asked = parser.parse_args()
    found = list(stale())
    for path, how in found:
        print(f"{path.relative_to(figures.ROOT)}\n{how}" if asked.check else f"rendered {path.name}")
        if not asked.check:
            path.write_text(rendered(path.read_text(encoding="utf-8")), encoding="utf-8")
    return 1 if asked.check and found else 0


if __name__ == "__main__":
    sys.exit(main())
