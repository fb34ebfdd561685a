"""The parts of the Blender extension that need no Blender, against a service and files of ours."""

from __future__ import annotations

import ast
import socket
import sys
import threading
import time
import tomllib
from array import array
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from service.formats import mesh
from service.sequences.caches import pc2_of
from service.sequences.options import Options
from store import starter
from store.lookup import ShapeTable

from .._asking import ROOT
from .._shapes import RAISIN_AT

HERE = ROOT / "service" / "blender"


@pytest.fixture(scope="module")
def parts() -> Any:
    """The extension as a package of another name, without its own beginning, which imports Blender."""
    package = ModuleType("wizen_parts")
    package.__path__ = [str(HERE)]
    sys.modules["wizen_parts"] = package
    from importlib import import_module

    names = ("client", "lattice", "caches", "work")
    yield {name: import_module(f"wizen_parts.{name}") for name in names}
    for name in ("wizen_parts", *(f"wizen_parts.{n}" for n in names)):
        del sys.modules[name]


def test_the_standard_library_and_blender_are_all_it_needs() -> None:
    for path in HERE.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level:
                names = [str(node.module)]
            for name in names:
                root = name.partition(".")[0]
                assert root == "bpy" or root in sys.stdlib_module_names, (path.name, name)


def test_the_manifest_is_what_blender_4_2_reads() -> None:
    said = tomllib.loads((HERE / "blender_manifest.toml").read_text())
    assert said["schema_version"] == "1.0.0"
    assert said["blender_version_min"] == "4.2.0"
    assert said["id"].isidentifier()
    assert len(said["tagline"]) <= 64
    assert not said["tagline"].endswith(".")
    for why in said["permissions"].values():
        assert len(why) <= 64


def test_points_are_the_tables_shape_turned_upright(parts: Any, tmp_path: Path) -> None:
    from ..conftest import client_of

    with client_of(starter.ROOT) as http:
        service = parts["client"].Service("http://nowhere")
        service.ask = lambda path, data=None, method=None: http.get(path).raise_for_status().content
        assert {one["name"] for one in service.maps()} >= {"default", "raisin"}
        found = service.shape("dehydration", "raisin", {**RAISIN_AT, "s": 0.2}, 32)
    from solver.registry import surface

    shape = ShapeTable.open(starter.ROOT, "raisin", surfaces=surface).at(RAISIN_AT, 0.2, resolution=32)
    truth = mesh.vertices(*mesh.surface(shape))
    assert np.abs(np.array(found.positions).reshape(-1, 3) - truth).max() < 1e-6
    up = np.array(parts["lattice"].upright(found.positions)).reshape(-1, 3)
    assert np.array_equal(up, np.array(found.positions).reshape(-1, 3)[:, [0, 2, 1]] * np.float32([1, -1, 1]))
    assert np.linalg.det(np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])) == 1  # turned, not mirrored


@pytest.mark.parametrize(
    ("family", "values", "wanted"),
    [
        ("prolate-01", {"r4": 0.8}, {"r2": 0.9363, "r3": 0.8386, "r8": 0.8, "te": 0.01, "rs1": 0.3, "mirrors": "xz"}),
        ("stone-radius", {"rs1": 0.5, "te": 0.035}, {"rs2": 0.5, "r4": 1.0, "te": 0.035}),
        ("sphere-01", {"gamma": 20.0}, {"te": 0.01, "rs1": 0.4, "gamma": 20.0, "mirrors": "xz"}),
        ("raisin", {**RAISIN_AT}, {"r2": 0.7, "r4": 0.45, **RAISIN_AT}),
    ],
)
def test_a_run_is_of_the_familys_fruit_and_not_of_defaults(
    parts: Any, family: str, values: dict[str, float], wanted: dict[str, Any]
) -> None:
    from solver import registry

    from ..conftest import client_of

    with client_of(starter.ROOT) as http:
        service = parts["client"].Service("http://nowhere")
        service.ask = lambda path, data=None, method=None: http.get(path).raise_for_status().content
        found = service.parameters("dehydration", family, {**values, "s": 0.1})
    assert wanted.items() <= found.items()
    registry.get("dehydration").parse(found)  # as a job takes them


@pytest.mark.parametrize("n", [4, 9])
def test_the_mesh_is_the_lattice_s_triangles(parts: Any, n: int) -> None:
    """Of quads, Blender would choose the diagonal: one along which folded shapes cross themselves."""
    corners = parts["lattice"].triangles(n)
    assert np.array_equal(np.reshape(corners, (-1, 3)), mesh.triangles(n))


def test_a_cache_is_read_as_it_was_written_and_a_broken_one_refused(parts: Any) -> None:
    frames = np.random.default_rng(1).normal(size=(3, 5, 3)).astype("f4")
    data = pc2_of(list(frames), Options())
    found = parts["caches"].read(data)
    assert (found.vertices, found.start, found.rate) == (5, 1.0, Options().step)
    assert np.array_equal(np.array(found.frames, "f4").reshape(3, 5, 3), frames)
    for broken in (data[:-1], b"", b"POINTCACHE2", data[:12] + bytes(20)):
        with pytest.raises(parts["client"].Refused):
            parts["caches"].read(broken)


def test_nobody_waits_for_a_service_that_does_not_answer(parts: Any) -> None:
    said: list[str] = []
    with socket.create_server(("127.0.0.1", 0)) as mute:
        service = parts["client"].Service(f"http://127.0.0.1:{mute.getsockname()[1]}")
        work = parts["work"].Work()
        start = time.monotonic()
        work.begin("maps", service.maps, said.append, said.append)
        assert work.settle() == 0
        assert time.monotonic() - start < 25  # a call that waited would have waited for 30 s
        assert work.busy == 1
        work.forget()
    with pytest.raises(parts["client"].Refused, match="wizen serve"):
        service.maps()
    assert not said


def test_of_many_questions_under_one_name_the_first_and_the_last_are_asked(parts: Any) -> None:
    work, gate, asked, came = parts["work"].Work(), threading.Event(), [], []

    def call(k: int) -> int:
        asked.append(k)
        gate.wait(10)
        return k

    for k in range(6):
        work.begin("one", lambda k=k: call(k), came.append, came.append)
    gate.set()
    end = time.monotonic() + 10
    while work.busy and time.monotonic() < end:
        time.sleep(0.01)
    work.settle()
    assert asked == came == [0, 5]
    work.begin("one", lambda: 1 / 0, came.append, came.append)
    while work.busy and time.monotonic() < end:
        time.sleep(0.01)
    work.settle()
    assert came[-1] == "ZeroDivisionError: division by zero"


def test_what_is_no_answer_is_refused_in_words(parts: Any) -> None:
    for data in (b"", b"WIZP" + bytes(12), b"glTF" + bytes(40)):
        with pytest.raises(parts["client"].Refused):
            parts["client"].points(data)
    assert isinstance(parts["lattice"].upright(array("f", [1, 2, 3])), array)
