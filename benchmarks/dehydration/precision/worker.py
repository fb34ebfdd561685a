"""One run in a process of its own: python -m benchmarks.dehydration.precision.worker MODULE:FUNCTION JSON."""

from __future__ import annotations

import importlib
import json
import resource
import sys


def main() -> None:
    module, function = sys.argv[1].split(":")
    found = importlib.import_module(f"benchmarks.dehydration.precision.{module}")
    row = getattr(found, function)(**json.loads(sys.argv[2]))
    row["peak_MB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps(row))


if __name__ == "__main__":
    main()
