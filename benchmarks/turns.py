"""Two trees take turns at the same uses: what benchmarks.linalg and benchmarks.loops are made of.

Both trees, the checkout BEFORE and this one, work in a process of their own with one thread, and take turns: before,
after, before, after. A use is set up and done once outside of the clock; what is timed is CPU seconds of one more. The
ratio is of the least times (other work on the machine only adds), that of the medians stands beside it.

The workers run this file as a script, given the file that lists the uses: in both trees it is this tree's.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import runpy
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["Use", "main"]

#: A use: what is done once outside of the clock returns what is timed, which returns arrays to compare.
Use = Callable[[], list[np.ndarray]]


def _work(listed: str) -> None:
    """Answer names of uses on stdin with CPU seconds and a digest of what came out."""
    uses, ready = runpy.run_path(listed), dict[str, Use]()
    for line in sys.stdin:
        name = line.strip()
        if name not in ready:
            ready[name] = uses[name]()
            ready[name]()
        begin = time.process_time()
        found = ready[name]()
        spent = time.process_time() - begin
        digest = hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in found)).hexdigest()[:12]
        size = float(np.linalg.norm(found[-1].ravel().astype(float)))
        print(json.dumps({"seconds": spent, "digest": digest, "norm": size}), flush=True)


class _Tree:
    """A worker in a tree."""

    def __init__(self, root: Path, listed: str) -> None:
        one = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
        self.child = subprocess.Popen(
            [sys.executable, str(Path(__file__).resolve()), str(Path(listed).resolve())],
            cwd=root,
            env={**os.environ, **one, "PYTHONPATH": str(root)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def run(self, name: str) -> dict[str, Any]:
        assert self.child.stdin
        assert self.child.stdout
        self.child.stdin.write(name + "\n")
        self.child.stdin.flush()
        return dict(json.loads(self.child.stdout.readline()))


def main(record: str, listed: str, said: str | None, uses: Sequence[Callable[[], Use]]) -> None:
    """Let both trees take turns at the uses that the file `listed` has, and keep what came of it as `record`."""
    from benchmarks.figures import ROOT, Sheet

    asked = argparse.ArgumentParser(description=said, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("before", type=Path)
    asked.add_argument("--rounds", type=int, default=15)
    asked.add_argument("--only", nargs="*", default=[use.__name__ for use in uses])
    options = asked.parse_args()
    trees = {"before": _Tree(options.before.resolve(), listed), "after": _Tree(ROOT, listed)}
    sheet = Sheet(record, ["use", "before [ms]", "after [ms]", "after / before", "of medians", "result"])
    for name in options.only:
        runs: dict[str, list[dict[str, Any]]] = {"before": [], "after": []}
        for _ in range(options.rounds):
            for which, tree in trees.items():
                runs[which].append(tree.run(name))
        seconds = {which: [run["seconds"] for run in found] for which, found in runs.items()}
        least, middle = ({w: float(f(v)) for w, v in seconds.items()} for f in (np.min, np.median))
        before, after = runs["before"][0], runs["after"][0]
        same = "same bytes" if before["digest"] == after["digest"] else f"{after['norm'] / before['norm'] - 1:.1e}"
        sheet.add(
            [
                name,
                f"{1e3 * least['before']:.1f}",
                f"{1e3 * least['after']:.1f}",
                f"{least['after'] / least['before']:.3f}",
                f"{middle['after'] / middle['before']:.3f}",
                same,
            ],
            use=name,
            seconds=seconds,
            digests={which: found[0]["digest"] for which, found in runs.items()},
        )
    told = ["git", "-C", str(options.before), "rev-parse", "--short=10", "HEAD"]
    sheet.keep(before=subprocess.run(told, capture_output=True, text=True, check=False).stdout.strip())


if __name__ == "__main__":
    sys.path.pop(0)  # this folder, where `service` is another one
    _work(sys.argv[1])
