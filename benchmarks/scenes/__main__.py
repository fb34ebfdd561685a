"""A scene of 1,000 fruits of 50 kinds beside 1,000 requests for them, in one run: python -m benchmarks.scenes.

With --peer PYTHON, one that has xpublish and xpublish-zarr, it stands beside xpublish too: a server of arrays, which is
given each fruit's positions on the lattice that the scene gives it, looked up by us beforehand, as a chunk of
float32 of its own. Its bytes are positions alone: no triangles, normals, colours or places.

The server is `wizen serve` on the tables in the package; processor time is the server's own, wall time the client's.
Every single request names the lattice that the scene gave that fruit. Then 10,000 items, an item out of the picture,
and the memory that they take.
"""

from __future__ import annotations

import argparse
import json
import struct
import sys
import tempfile
import time
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from benchmarks.figures import Sheet
from benchmarks.service.__main__ import running
from solver.registry import surface
from store import starter
from store.lookup import ShapeTable

#: xpublish over an archive of arrays v0, v1, ..., each of them one chunk.
PEER = """
import sys, numpy as np, xarray as xr, xpublish, uvicorn
with np.load(sys.argv[2]) as found:
    data = xr.Dataset({name: (f"point{i}", found[name]) for i, name in enumerate(found.files)})
uvicorn.run(xpublish.Rest({"d": data}).app, host="127.0.0.1", port=int(sys.argv[1]), log_level="error")
"""

#: Kinds: te, gamma and stage within the table in the package.
KINDS = [(0.03 + 0.01 * (i * 0.618 % 1), 10 + 40 * (i * 0.382 % 1), 0.1 + 0.2 * (i * 0.755 % 1)) for i in range(50)]


def scene(count: int, aside: int = 0, **budget: float) -> dict[str, Any]:
    """Return a scene of `count` fruits in view, and `aside` that stand behind the camera, an item each."""
    random = np.random.default_rng(0)
    wide = 0.75 * count**0.5
    items = []
    for i in range(count + aside):
        te, gamma, stage = KINDS[i % len(KINDS)]
        x, z = random.uniform(-wide, wide, 2)
        at = [x, 1.0, z] if i < count else [x, 1.0, 50.0 * wide + z]
        items.append(
            {
                "parameters": {"te": round(te, 5), "gamma": round(gamma, 3)},
                "stage": round(stage, 4),
                "seed": i,
                "transforms": [{"position": [round(float(v), 4) for v in at]}],
            }
        )
    camera = {"position": [0, 0.6 * wide, 2.2 * wide], "target": [0, 0, 0], "fov": 45, "width": 1280, "height": 720}
    return {"camera": camera, "items": items, "budget": budget}


def ask(port: int, process: psutil.Process, body: dict[str, Any], **query: str) -> dict[str, Any]:
    """Send a scene; return seconds, processor seconds, bytes, memory, and the report."""
    words = "&".join(f"{name}={value}" for name, value in query.items())
    data = json.dumps(body).encode()
    request = urllib.request.Request(
        f"http://127.0.0.1:{port}/v1/scenes?{words}", data, {"Content-Type": "application/json"}
    )
    before, start = sum(process.cpu_times()[:2]), time.perf_counter()
    with urllib.request.urlopen(request, timeout=600) as answer:
        found, head = answer.read(), answer.headers
    wall, spent = time.perf_counter() - start, sum(process.cpu_times()[:2]) - before
    report = json.loads(head["Wizen-Scene"]) if "Wizen-Scene" in head else json.loads(found)
    size = process.memory_info().rss
    return {"wall_s": wall, "processor_s": spent, "bytes": len(found), "memory": size, "report": report, "data": found}


def one_by_one(port: int, process: psutil.Process, body: dict[str, Any], lattices: list[int]) -> dict[str, Any]:
    """Get the shape of every item as a GLB of its own."""
    before, start, size = sum(process.cpu_times()[:2]), time.perf_counter(), 0
    for item, n in zip(body["items"], lattices, strict=True):
        said = item["parameters"]
        query = f"te={said['te']}&gamma={said['gamma']}&s={item['stage']}&resolution={n}&format=glb"
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/v1/shapes/dehydration?{query}", timeout=60) as answer:
            size += len(answer.read())
    wall, spent = time.perf_counter() - start, sum(process.cpu_times()[:2]) - before
    return {"wall_s": wall, "processor_s": spent, "bytes": size, "memory": process.memory_info().rss}


def beside(peer: str, body: dict[str, Any], lattices: list[int], rounds: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Have xpublish serve every fruit's positions; return what 1,000 requests took, and one for each distinct array."""
    table = ShapeTable.open(starter.ROOT, "default", surfaces=surface)
    asked, arrays, order = {}, {}, []
    for item, n in zip(body["items"], lattices, strict=True):
        said = (*item["parameters"].values(), item["stage"], n)
        if said not in asked:
            asked[said] = f"v{len(asked)}"
            shape = table.at(item["parameters"], item["stage"], resolution=n)
            arrays[asked[said]] = np.asarray(shape.position, np.float32).ravel()
        order.append(asked[said])
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "arrays.npz"
        np.savez(file, **arrays)
        with running([peer, "-c", PEER, "{port}", str(file)], "/datasets/d/zarr/v0/c/0") as (server, port, _):
            process = psutil.Process(server.pid)
            found = [[_arrays(port, process, names) for _ in range(rounds)] for names in (order, list(arrays))]
    return _least(found[0]), _least(found[1])


def _arrays(port: int, process: psutil.Process, names: list[str]) -> dict[str, Any]:
    before, start, size = sum(process.cpu_times()[:2]), time.perf_counter(), 0
    for name in names:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/datasets/d/zarr/{name}/c/0", timeout=60) as answer:
            size += len(answer.read())
    wall, spent = time.perf_counter() - start, sum(process.cpu_times()[:2]) - before
    return {"wall_s": wall, "processor_s": spent, "bytes": size, "memory": process.memory_info().rss}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=3, help="of which the least times are kept")
    parser.add_argument("--peer", help="a Python that has xpublish")
    given = parser.parse_args()
    rounds = given.rounds
    sheet = Sheet("scenes", ["1,000 fruits of 50 kinds and more", "wall", "processor", "bytes", "memory of the server"])
    command = [sys.executable, "-m", "service.cli", "serve", "--port", "{port}"]
    settings = {
        "WIZEN_STORE": str(starter.ROOT),
        "WIZEN_CACHE_BYTES": "0",
        "WIZEN_MAX_BODY": str(1 << 24),
        "WIZEN_TIMEOUT": "600",
    }
    with running(command, "/healthz", **settings) as (server, port, _):
        process = psutil.Process(server.pid)
        thousand = scene(1000, bytes=3_000_000)
        ask(port, process, thousand)  # what is compiled or opened once
        made = [ask(port, process, thousand) for _ in range(rounds)]
        lattices = _lattices(made[0]["data"], thousand)
        alone = [one_by_one(port, process, thousand, lattices) for _ in range(min(rounds, 2))]
        best, single = _least(made), _least(alone)
        _row(sheet, "one scene", best, {k: best["report"][k] for k in ("meshes", "triangles", "shown", "left_out")})
        _row(sheet, "1,000 requests, each with the lattice that it has in the scene", single, {})
        if given.peer:
            each_of, once = beside(given.peer, thousand, lattices, min(rounds, 2))
            _row(sheet, "xpublish: 1,000 requests for their positions, stored beforehand", each_of, {})
            _row(sheet, "xpublish: a request for each distinct one of them", once, {})
        base = [ask(port, process, scene(1, 0), format="json") for _ in range(rounds + 2)]
        many = [ask(port, process, scene(1, 9999), format="json") for _ in range(rounds)]
        each = 1e6 * (_least(many)["processor_s"] - _least(base)["processor_s"]) / 9999
        _row(sheet, "10,000 items, 9,999 of them behind the camera", _least(many), {"each_us": each})
        full = [ask(port, process, scene(10_000, 0, bytes=10_000_000)) for _ in range(rounds)]
        _row(sheet, "10,000 items in view", _least(full), {"memories": [one["memory"] for one in full]})
    ratio = single["processor_s"] / best["processor_s"]
    print(f"{ratio:.1f} times less processor than one by one; {each:.1f} us for an item out of the picture")
    sheet.keep(ratio=ratio, outside_us=each)


def _lattices(data: bytes, body: dict[str, Any]) -> list[int]:
    """Return each item's lattice in a scene's file: the items are in view one by one, so all have one."""
    document = json.loads(data[20 : 20 + struct.unpack_from("<I", data, 12)[0]])
    found: dict[str, list[int]] = {}
    for node in document["nodes"]:
        if "mesh" in node and "extensions" in node:
            name = document["meshes"][node["mesh"]]["name"]
            number = node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["SCALE"]
            found.setdefault(node["name"], []).extend(
                [int(name.rsplit(" ", 1)[1])] * document["accessors"][number]["count"]
            )
    # which individual has which does not matter for what all of them cost
    flat = [n for values in found.values() for n in values]
    return flat + [8] * (len(body["items"]) - len(flat))


def _least(runs: list[dict[str, Any]]) -> dict[str, Any]:
    return {**runs[0], **{name: min(run[name] for run in runs) for name in ("wall_s", "processor_s")}}


def _row(sheet: Sheet, name: str, run: dict[str, Any], more: dict[str, Any]) -> None:
    cells = [name, f"{run['wall_s']:.2f} s", f"{run['processor_s']:.2f} s", f"{run['bytes'] / 1e6:.2f} MB"]
    kept = {k: v for k, v in run.items() if k not in ("data", "report")}
    sheet.add([*cells, f"{run['memory'] / 1e6:.0f} MB"], what=name, **kept, **more)


if __name__ == "__main__":
    main()
