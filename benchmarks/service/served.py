"""A service over the table in the package, what it is asked for, and what it spends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from store import starter

from .__main__ import ROOT, free_port
from .asking import Found, closed_loop, run

__all__ = ["CLIENTS", "KINDS", "path", "quantile", "said", "serving"]

#: What is asked for: of the size that a page shows, and computed in the event loop; and one that a thread computes.
KINDS = {"points, 64": "resolution=64&format=points", "GLB, 192": "resolution=192&format=glb"}
CLIENTS = 16


def path(kind: str, seed: int) -> Any:
    """Return the addresses of shapes, no two of which are the same, within the axes of the table in the package."""

    def of(i: int) -> str:
        te, gamma = 0.03 + 0.01 * ((i + seed) * 0.6180339887 % 1), 10 + 40 * ((i + seed) * 0.7548776662 % 1)
        return f"/v1/shapes/dehydration?te={te:.7f}&gamma={gamma:.5f}&s=0.17&{KINDS[kind]}"

    return of


@contextmanager
def serving() -> Iterator[tuple[subprocess.Popen[str], int]]:
    """Run `wizen serve`; yield its process and port once it answers."""
    port = free_port()
    command = [sys.executable, "-m", "service.cli", "serve", "--store", str(starter.ROOT), "--port", str(port)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "WIZEN_JOBS_WORKERS": "0"}
    with (
        tempfile.TemporaryFile("w+") as said,
        subprocess.Popen(command, env=environment, stderr=said, text=True) as process,
    ):
        try:
            for kind in KINDS:
                for _ in range(600):
                    if run(closed_loop(port, path(kind, 0), 1, 0.2)).good:
                        break
                    time.sleep(0.1)
            yield process, port
        except BaseException:
            said.seek(0)
            print(f"the server's exit code: {process.poll()}; its last words: {said.read()[-2000:]}", file=sys.stderr)
            raise
        finally:
            process.send_signal(signal.SIGTERM)


def quantile(times: list[float], q: float) -> float:
    """Return a quantile [ms] of sorted times."""
    return 1e3 * times[min(int(q * len(times)), len(times) - 1)] if times else 0.0


def said(found: Found) -> dict[str, Any]:
    return {
        "rate": found.rate,
        "good": len(found.good),
        "refused": len(found.refused),
        "broken": found.broken,
        "p50_ms": quantile(found.good, 0.5),
        "p99_ms": quantile(found.good, 0.99),
        "refused_p50_ms": quantile(found.refused, 0.5),
        "refused_p99_ms": quantile(found.refused, 0.99),
        "late_p99_ms": quantile(found.late, 0.99),
        "refused_in_100_ms": sum(t <= 0.1 for t in found.refused) / max(len(found.refused), 1),
    }
