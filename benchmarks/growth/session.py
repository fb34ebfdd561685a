"""From an input to its geometry: milliseconds of processor of a live session's engine, over a real WebSocket.

    python -m benchmarks.growth.session

A client paints at about 5,000 vertices: a dab as soon as the frame has come that holds the one before. Counted is
what the engine spends from taking a dab until the frame that holds it is packed (a step of growth to its residual, the
difference to what the client holds), as every frame says of itself. What the network takes, and the client's drawing,
is not in it.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

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
    "median [ms of processor]",
    "p95",
    "worst",
    "over 100 ms",
    "bytes a frame",
    "whole frame",
)


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


def painted(url: str, token: str, name: str, vertices: int) -> tuple[Client, list[float]]:
    """Paint a circle; return the client, and for each dab what the engine spent on it [ms]."""
    values = _SHEETS[name]
    mesh = start(values["shape"], vertices, 4.0)
    params = {k: v for k, v in values.items() if k != "shape"} | {"tools": [], "step": 1.0, "remesh": 1.3}
    params |= {"mesh": {"points": mesh.x.tolist(), "faces": mesh.triangles.tolist()}}
    client = Client(url, token=token, params=params, quality="preview")
    assert client.opened()["say"] == "opened"
    spent = []
    for dab in range(_DABS):
        turn = 2 * np.pi * dab / _DABS
        at = [float(np.cos(turn)), float(np.sin(turn)), 0.0]
        way = [-at[1], at[0], 0.0]
        client.do("brush", at=at, way=way, radius=0.4, stretch=[_BY, _BY])
        client.until(lambda c: c.frames and c.frames[-1]["input"] >= c.last)
        spent.append(client.frames[-1]["ms"])
    return client, spent


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("vertices", type=int, nargs="*", default=[5000])
    given = parser.parse_args()
    sheet = Sheet("growth-session", _HEAD, "growth")
    with serving() as (url, token):
        for vertices in given.vertices:
            for name in _SHEETS:
                client, spent = painted(url, token, name, vertices)
                median, late = (float(v) for v in np.percentile(spent, [50, 95]))
                sizes = [f["bytes"] for f in client.frames if f["base"]]
                whole, size = client.frames[0]["bytes"], float(np.median(sizes))
                count, over = client.frames[-1]["vertices"], sum(v > 100 for v in spent)
                cells = (name, count, f"{median:.0f}", f"{late:.0f}", f"{max(spent):.0f}", f"{over} of {len(spent)}")
                run = {"painting": name, "vertices": count, "median": median, "p95": late, "worst": max(spent)}
                sheet.add((*cells, f"{size:.0f}", whole), **run, over=over, bytes=size, whole=whole, spent=spent)
                client.send(do="close")
                client.close()
    sheet.keep()


if __name__ == "__main__":
    main()
