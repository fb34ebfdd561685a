"""From an input to its geometry: milliseconds of processor of a live session's engine, over a real WebSocket.

    python -m benchmarks.growth.session

A client paints at about 5,000 vertices: a dab as soon as the frame at rest has come that holds the one before. Counted
is what the engine spends from taking a dab until a frame is packed, as every frame says of itself: the first whose
geometry moves by it, be it on its way or at rest, and the first at rest that holds it (a step of growth to its
residual, the difference to what the client holds). What the network takes, and the client's drawing, is not in it.
Frames a second are those that came, of either kind, by the clock.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.figures import Sheet
from solver.growth.shapes import start
from store.store import Store
from store.tokens import Tokens
from tests.service._session import Client

_DABS = 150
#: Growth of length under the brush in a dab.
_BY = 1.003
_SHEETS: dict[str, dict[str, Any]] = {
    "leaf": {"shape": "disc", "thickness": 0.02},
    "sphere": {"shape": "sphere", "thickness": 0.02},
}
_HEAD = (
    "painting",
    "vertices",
    "to geometry: median [ms of processor]",
    "p95",
    "worst",
    "to rest: median",
    "p95",
    "worst",
    "frames a second",
    "bytes a frame",
    "whole frame",
)
#: Flag of a frame whose shape is on its way to its equilibrium; more frames than there are of one step.
_UNDERWAY, _MANY = 4, 500


@contextmanager
def serving() -> Iterator[tuple[str, str]]:
    """Yield the address of `wizen serve` over an empty store, and a token."""
    with tempfile.TemporaryDirectory() as folder:
        store = Store.open(Path(folder) / "store", create=True)
        token = Tokens(store.root).create("painter", ["run"])[1]
        command = [sys.executable, "-m", "service.cli", "serve", "--store", str(store.root), "--port", "0"]
        env = {**os.environ, "WIZEN_MAX_BODY": str(1 << 24), "WIZEN_JOBS_WORKERS": "0"}
        server = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=env)
        assert server.stderr is not None
        try:
            address = next(word for line in server.stderr for word in line.split() if word.startswith("http://"))
            yield address, token
        finally:
            server.terminate()
            server.wait()


class Painted(NamedTuple):
    """A painting: for each dab what the engine spent until its first geometry, and until it rested [ms]."""

    client: Client
    first: list[float]
    rest: list[float]
    frames_s: float


def painted(url: str, token: str, name: str, vertices: int) -> Painted:
    """Paint a circle."""
    values = _SHEETS[name]
    mesh = start(values["shape"], vertices, 4.0)
    params = {k: v for k, v in values.items() if k != "shape"} | {"tools": [], "step": 1.0, "remesh": 1.3}
    params |= {"mesh": {"points": mesh.x.tolist(), "faces": mesh.triangles.tolist()}}
    client = Client(url, token=token, params=params, quality="preview")
    assert client.opened()["say"] == "opened"
    first, rest = [], []
    begin, known = time.monotonic(), len(client.frames)
    for dab in range(_DABS):
        turn = 2 * np.pi * dab / _DABS
        at = [float(np.cos(turn)), float(np.sin(turn)), 0.0]
        way = [-at[1], at[0], 0.0]
        client.do("brush", at=at, way=way, radius=0.4, stretch=[_BY, _BY])
        client.until(lambda c: bool(c.frames) and _holds(c.frames[-1], c.last))
        seen = [f for f in client.frames[-_MANY:] if f["input"] >= client.last]
        first.append(seen[0]["ms"])
        rest.append(seen[-1]["ms"])
    return Painted(client, first, rest, (len(client.frames) - known) / (time.monotonic() - begin))


def _holds(frame: dict[str, Any], number: int) -> bool:
    return frame["input"] >= number and not frame["flags"] & _UNDERWAY


def _parts(spent: list[float]) -> dict[str, float]:
    median, late = (float(v) for v in np.percentile(spent, [50, 95]))
    return {"median": median, "p95": late, "worst": max(spent)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("vertices", type=int, nargs="*", default=[5000])
    given = parser.parse_args()
    sheet = Sheet("growth-session", _HEAD, "growth")
    with serving() as (url, token):
        for vertices in given.vertices:
            for name in _SHEETS:
                client, first, rest, rate = painted(url, token, name, vertices)
                parts = {"first": _parts(first), "rest": _parts(rest)}
                sizes = [f["bytes"] for f in client.frames if f["base"]]
                whole, size = client.frames[0]["bytes"], float(np.median(sizes))
                count = client.frames[-1]["vertices"]
                figures = [f"{part[which]:.0f}" for part in parts.values() for which in ("median", "p95", "worst")]
                run = {"painting": name, "vertices": count, "frames_s": rate, "bytes": size, "whole": whole, **parts}
                cells = (name, count, *figures, f"{rate:.0f}", f"{size:.0f}", whole)
                sheet.add(cells, **run, spent_first=first, spent_rest=rest)
                client.send(do="close")
                client.close()
    sheet.keep()


if __name__ == "__main__":
    main()
