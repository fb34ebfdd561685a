"""Digests of small runs of every solver: what only moves code must leave every byte where it was.

    python -m benchmarks.digests [--out FILE.json] [--against FILE.json]

Variable by variable, so that one more, or one that is measured otherwise now, does not hide what has stayed. Compare on
one machine only: another processor rounds otherwise.
"""

from __future__ import annotations

import argparse
import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from solver import registry
from solver.contract import Need

#: Solver, parameters, stages, quality: each some seconds.
RUNS: tuple[tuple[str, dict[str, Any], tuple[float, ...], str], ...] = (
    ("dehydration", {"te": 0.1, "gamma": 10.0, "mirrors": "xyz"}, (0.05, 0.1), "preview"),
    ("dehydration", {"te": 0.1, "gamma": 1.0, "mirrors": "xyz"}, (0.02,), "preview"),
    ("decay", {}, (0.0, 1.0, 2.0), "preview"),
    ("growth", {"shape": "disc", "tools": [{"kind": "spot", "at": (0.2, 0.0, 0.0)}]}, (0.0, 0.2), "preview"),
    ("wood", {"rods": 12, "tip_load": (0.0, 0.0, -1.0), "clamp": "start"}, (0.0, 0.001), "preview"),
)


def digests(name: str, words: dict[str, Any], stages: tuple[float, ...], quality: str) -> dict[str, str]:
    """Return the SHA-256 of every variable but the seconds taken, type and shape included."""
    solver = registry.get(name)
    result = solver.solve(solver.parse(words), Need(stages=stages, quality=quality))
    found = {}
    for variable in sorted({*map(str, result.variables)} - {"seconds"}):
        values = np.ascontiguousarray(result[variable].values)
        made = hashlib.sha256(f"{values.dtype} {values.shape}".encode())
        made.update(values.tobytes() if values.dtype != object else repr(values.tolist()).encode())
        found[variable] = made.hexdigest()[:16]
    return found


def compared(before: dict[str, str], now: dict[str, str]) -> str:
    """Return which variables are the same, which are others, and which came or went."""
    both = before.keys() & now.keys()
    same = {name for name in both if before[name] == now[name]}
    kinds = {"same": same, "OTHER": both - same, "new": now.keys() - both, "gone": before.keys() - both}
    return "; ".join(f"{kind}: {', '.join(sorted(names))}" for kind, names in kinds.items() if names)


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--out", type=Path)
    asked.add_argument("--against", type=Path)
    words = asked.parse_args()
    before = json.loads(words.against.read_text()) if words.against else {}
    now = {}
    for run in RUNS:
        key = f"{run[0]} {json.dumps(run[1])} {run[3]}"
        now[key] = digests(*run)
        told = compared(before[key], now[key]) if key in before else ", ".join(now[key])
        print(f"{key}: version {registry.get(run[0]).version}\n  {told}", flush=True)
    if words.out:
        words.out.write_text(json.dumps(now, indent=1))


if __name__ == "__main__":
    main()
