"""Apply the listed mutations one by one in a copy of the tree, and see whether their tests notice.

    python -m tests.mutations.run [--only WORD] [--again] [--limit SECONDS]

Writes benchmarks/results/mutants.json after each mutation, and the survivors as mutants.md beside it. What is known of
the same file, change and tests is not run again; what is known of other ones is old, and counts as not known. The test
that notices must pass without the mutation.

All that is slow to import is imported once, and each mutation runs in a fork of that process. Compiled functions are
kept among mutations but for those of modules that import the changed one: numba looks at a function's own file only.
"""

from __future__ import annotations

import argparse
import ast
import fcntl
import importlib
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from benchmarks import figures

from .listed import ROOT, Mutation, listed

RESULTS = ROOT / "benchmarks" / "results"
FLOORS = ("solver", "store", "sweeps", "service")
#: A fork starts with these: nothing of the four floors, and nothing that pytest plugins are made of.
_EARLY = ("numpy", "scipy.sparse.linalg", "scipy.spatial", "numba", "xarray", "h5netcdf", "pydantic")
#: CPU seconds that a selection may take, and how much longer a busy machine may let it wait.
_LIMIT, _WAIT = 240, 8


class Copy:
    """A copy of the tree that mutations are applied in, and the caches of what was compiled there."""

    def __init__(self, home: Path) -> None:
        self.root, self.cache, self._mutant_cache = home / "tree", home / "numba", home / "numba-mutant"
        self.cache.mkdir(parents=True, exist_ok=True)
        self.refresh()

    def refresh(self) -> None:
        """Make the copy what the working tree is: what git knows or would."""
        command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        names = subprocess.run(command, cwd=ROOT, capture_output=True, check=True, text=True).stdout.split("\0")
        wanted = {name for name in names if name and (ROOT / name).is_file()}
        for name in wanted:
            source, target = ROOT / name, self.root / name
            if not target.exists() or target.read_bytes() != source.read_bytes():
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(source, target)
        for path in self.root.rglob("*.py"):
            if str(path.relative_to(self.root)) not in wanted and "__pycache__" not in path.parts:
                path.unlink()

    def caches_without(self, changed: str) -> Path:
        """Return a cache without what may have been compiled from a file."""
        shutil.rmtree(self._mutant_cache, ignore_errors=True)
        self._linked(self.cache, self._mutant_cache, changed)
        return self._mutant_cache

    def keep_compiled(self, changed: str) -> None:
        """Keep what the last run compiled, but for what may have been compiled from the changed file."""
        self._linked(self._mutant_cache, self.cache, changed)

    def _linked(self, source: Path, target: Path, changed: str) -> None:
        stale = {Path(name).stem for name in self._importers(changed)}
        target.mkdir(parents=True, exist_ok=True)
        for path in source.rglob("*.nb?"):
            # numba calls what it keeps module.function-line...
            place = target / path.relative_to(source)
            if path.name.partition(".")[0] not in stale and not (place.exists() and place.samefile(path)):
                place.parent.mkdir(parents=True, exist_ok=True)
                place.unlink(missing_ok=True)
                os.link(path, place)

    def _importers(self, changed: str) -> set[str]:
        """Return a file and all that import it, whatever way round."""
        found, todo = set[str](), [changed]
        while todo:
            name = todo.pop()
            if name in found:
                continue
            found.add(name)
            module = _module(name)
            todo += [other for other, needs in self._imports.items() if module in needs]
        return found

    @cached_property
    def _imports(self) -> dict[str, set[str]]:
        sources = [path for floor in FLOORS for path in (self.root / floor).rglob("*.py")]
        return {(name := str(path.relative_to(self.root))): _imports(path, name) for path in sources}


def _module(name: str) -> str:
    return name.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _imports(path: Path, name: str) -> set[str]:
    """Return the modules that a file imports, as absolute names."""
    package = _module(name).split(".") if name.endswith("__init__.py") else _module(name).split(".")[:-1]
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            found |= {module, *(f"{module}.{alias.name}" for alias in node.names)}
    return found


def run(tests: Sequence[str], copy: Copy, cache: Path, limit: float) -> tuple[int, str, float]:
    """Run a selection in a fork, in the copy; return pytest's exit code, the tail of what it said and CPU seconds.

    The code is -9 where it ran past its limit.
    """
    out = Path(tempfile.mkstemp(prefix="mutant-")[1])
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    child = os.fork()
    if child == 0:
        _child(tests, copy.root, cache, out, limit)
    end, status = time.monotonic() + _WAIT * limit, 0
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            break
        if time.monotonic() > end:
            os.killpg(child, signal.SIGKILL)
        time.sleep(0.05)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    text = out.read_text(errors="replace")
    out.unlink()
    code = os.waitstatus_to_exitcode(status)
    return (-9 if code < 0 else code), text[-4000:], after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _child(tests: Sequence[str], root: Path, cache: Path, out: Path, limit: float) -> None:
    code = 70
    try:
        os.setpgid(0, 0)
        resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit) + 5))
        handle = os.open(out, os.O_WRONLY | os.O_TRUNC)
        for number in (1, 2):
            os.dup2(handle, number)
        os.chdir(root)
        os.environ |= {"PYTHONPATH": str(root), "NUMBA_CACHE_DIR": str(cache), "PYTHONDONTWRITEBYTECODE": "1"}
        # some plugins take longer to import than most of these tests take
        os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
        importlib.import_module("numba").config.CACHE_DIR = str(cache)
        sys.dont_write_bytecode = True
        for name in [name for name in sys.modules if name.partition(".")[0] in (*FLOORS, "tests", "benchmarks")]:
            del sys.modules[name]
        sys.path[:] = [str(root), *(path for path in sys.path if Path(path or ".").resolve() != ROOT)]
        pytest = importlib.import_module("pytest")
        code = int(pytest.main(["-x", "-p", "pytest_timeout", "-p", "no:cacheprovider", "--tb=line", *tests]))
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        os._exit(code)


class Ledger:
    """What is known, in benchmarks/results/mutants.json."""

    def __init__(self) -> None:
        self.path = RESULTS / "mutants.json"
        self.rows: dict[str, dict[str, Any]] = {}
        self._read()

    def _read(self) -> None:
        page = json.loads(self.path.read_text()) if self.path.exists() else {}
        self.rows |= {row["name"]: row for row in page.get("runs", [])}

    def known(self, mutation: Mutation, copy: Copy) -> bool:
        row = self.rows.get(mutation.name)
        return (
            row is not None
            and row["digest"] == mutation.digest(copy.root)
            and row["outcome"] in ("caught", "caught by its limit", "survived")
        )

    def note(self, mutations: Sequence[Mutation], **row: Any) -> None:
        with (RESULTS / "mutants.lock").open("w") as lock:
            # another one may be at work
            fcntl.flock(lock, fcntl.LOCK_EX)
            self._read()
            self.rows[row["name"]] = row
            self.write(mutations)

    def write(self, mutations: Sequence[Mutation]) -> None:
        """Write what is known; of changed files, changes and tests only that it is old."""
        rows = [self.rows[m.name] | {"old": self.old(m)} for m in mutations if m.name in self.rows]
        known = [row for row in rows if not row["old"]]
        caught = sum(row["outcome"].startswith("caught") for row in known)
        figures.keep(
            "mutants",
            rows,
            listed=len(mutations),
            run=len(known),
            old=len(rows) - len(known),
            caught=caught,
            caught_share=round(caught / max(len(known), 1), 4),
            table={"head": ["where", "listed", "known", "caught"], "rows": _floors(mutations, known)},
        )
        (RESULTS / "mutants.md").write_text(_table(figures.load("mutants")))

    def old(self, mutation: Mutation) -> bool:
        """Return whether what is known of it is of another file, change or test."""
        return bool(self.rows[mutation.name]["digest"] != mutation.digest(ROOT))


def _floors(mutations: Sequence[Mutation], known: Sequence[dict[str, Any]]) -> list[list[str]]:
    """Return rows of where, how many are listed, how many known as they are now, how many of these caught."""
    floors: dict[str, list[int]] = {}
    rows = {row["name"]: row for row in known}
    for mutation in mutations:
        parts = mutation.file.split("/")
        place = "/".join(parts[:2]) if parts[0] == "solver" and len(parts) > 2 else parts[0]
        counts = floors.setdefault(place, [0, 0, 0])
        counts[0] += 1
        if mutation.name in rows:
            counts[1] += 1
            counts[2] += rows[mutation.name]["outcome"].startswith("caught")
    return [[place, *map(str, counts)] for place, counts in sorted(floors.items())]


def _table(page: dict[str, Any]) -> str:
    lines = [
        "# Mutations",
        "",
        f"Written by `make mutants` at {page['commit']}: {page['caught']} of {page['run']} caught "
        f"({100 * page['caught_share']:.1f} %), {page['listed']} listed. {page['old']} were run before their file, "
        "change or tests were altered, and do not count.",
        "",
        "| where | listed | known | caught |",
        "|---|---|---|---|",
        *("| " + " | ".join(row) + " |" for row in page["table"]["rows"]),
        "",
        "| not caught | file | what it breaks | outcome |",
        "|---|---|---|---|",
    ]
    lost = [row for row in page["runs"] if not row["outcome"].startswith("caught")]
    lines += [f"| {row['name']} | `{row['file']}` | {row['why']} | {row['outcome']} |" for row in lost]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run what is listed and not known."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="mutations in whose name or file this regular expression is found")
    parser.add_argument("--again", action="store_true", help="run what is known as well")
    parser.add_argument("--limit", type=float, default=_LIMIT, help="CPU seconds of one selection")
    parser.add_argument("--home", type=Path, default=Path(tempfile.gettempdir()) / f"wizen-mutants-{os.getuid()}")
    asked = parser.parse_args()
    mutations, ledger = listed(), Ledger()
    copy = Copy(asked.home)
    wanted = [m for m in mutations if re.search(asked.only, f"{m.name} {m.file}")]
    todo = [m for m in wanted if asked.again or not ledger.known(m, copy)]
    # what nobody has tried first, then what takes least: most is known soon
    todo.sort(key=lambda m: (ledger.rows.get(m.name, {"seconds": 0.0})["seconds"], m.digest(copy.root)))
    for name in _EARLY:
        importlib.import_module(name)
    passed: dict[str, bool] = {}
    for number, mutation in enumerate(todo, 1):
        outcome, by, seconds = _tried(mutation, copy, asked.limit)
        if outcome == "caught" and not _passes(by, passed, copy, 4 * asked.limit):
            outcome = "its test fails as it is"
        ledger.note(
            mutations,
            name=mutation.name,
            file=mutation.file,
            why=mutation.why,
            outcome=outcome,
            by=by,
            seconds=round(seconds, 1),
            digest=mutation.digest(copy.root),
        )
        print(f"{number}/{len(todo)} {outcome}: {mutation.name} ({seconds:.1f} s) {by}", flush=True)
    ledger.write(mutations)
    rows = [ledger.rows[m.name] for m in mutations if m.name in ledger.rows and not ledger.old(m)]
    caught = sum(row["outcome"].startswith("caught") for row in rows)
    print(f"{caught} of {len(rows)} caught, {len(mutations)} listed")
    sys.exit(caught < 0.95 * len(mutations))


def _passes(test: str, known: dict[str, bool], copy: Copy, limit: float) -> bool:
    """Return whether the test that noticed passes without a mutation."""
    if test and test not in known:
        code, said, _ = run([test], copy, copy.cache, limit)
        known[test] = code == 0
        if code:
            print(said)
    return known.get(test, True)


def _tried(mutation: Mutation, copy: Copy, limit: float) -> tuple[str, str, float]:
    """Return what came of one mutation, the test that caught it, and CPU seconds."""
    target = copy.root / mutation.file
    text = target.read_text()
    kept = target.stat()
    try:
        changed = mutation.applied(text)
    except ValueError:
        return "does not fit its file any more", "", 0.0
    try:
        target.write_text(changed)
        code, said, seconds = run(mutation.tests, copy, copy.caches_without(mutation.file), limit)
    finally:
        target.write_text(text)
        # numba and Python know a source by its time
        os.utime(target, ns=(kept.st_atime_ns, kept.st_mtime_ns))
    copy.keep_compiled(mutation.file)
    if code in (0, 1):
        failed = [line.removeprefix("FAILED ").partition(" - ")[0] for line in said.splitlines() if "FAILED " in line]
        return ("caught" if code else "survived"), (failed or [""])[-1], seconds
    if code == -9:
        return "caught by its limit", "", seconds
    return f"broken (pytest says {code})", said.strip().splitlines()[-1] if said.strip() else "", seconds


if __name__ == "__main__":
    main()
