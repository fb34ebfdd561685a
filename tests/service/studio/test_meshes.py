"""Meshes of one's own: sent, run and shown, or stood upon."""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import parse_qs, urlsplit

import httpx
import pytest
import trimesh

from .._browser import ROOT, Visit
from ._rooms import AXE, SLOW, at

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytestmark = SLOW


@pytest.mark.parametrize("room", ["decay", "growth"])
def test_a_mesh_of_ones_own_is_sent_run_and_shown(browser: Browser, studio: str, tmp_path: Path, room: str) -> None:
    ring = tmp_path / "ring.obj"
    trimesh.creation.torus(20.0, 8.0, major_sections=32, minor_sections=16).export(ring)
    visit = Visit(browser, viewport={"width": 1200, "height": 900}, bypass_csp=True)
    page = visit.page
    page.goto(at(studio, f"room={room}"))
    visit.shown()
    page.locator("summary", has_text=re.compile("^Mesh$")).click()
    chooser = page.locator(".meshfile input")
    # a file that promises two thousand million points is refused beside the button, and nothing of it is sent on
    evil = tmp_path / "evil.ply"
    evil.write_bytes(
        b"ply\nformat binary_little_endian 1.0\nelement vertex 2000000000\nproperty float x\nproperty float y\n"
        b"property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n" + bytes(64)
    )
    chooser.set_input_files(evil)
    page.locator(".meshfile .wrong", has_text="2000000000").wait_for()
    # the browser itself says that a request was refused
    assert [text for text in visit.complaints if "422" not in text] == []
    visit.complaints.clear()
    assert "mesh" not in page.locator("code", has_text="wizen solve").inner_text()
    chooser.set_input_files(ring)
    page.locator(".meshfile .note", has_text="512 points, 1024 triangles, closed").wait_for()
    assert page.locator(".meshfile .wrong").inner_text() == ""
    page.locator("#stages").fill("0, 4" if room == "decay" else "0.1, 0.2")
    page.add_script_tag(path=AXE)
    assert page.evaluate("async () => (await axe.run()).violations.map(v => [v.id, v.nodes.map(n => n.html)])") == []
    run = page.get_by_role("button", name="Run", exact=True)
    if room == "growth":
        # the spot is where this ring is not: the solver says so, in the page
        page.locator("#preset").select_option("sphere-spot")
        chooser.set_input_files(ring)
        page.locator(".meshfile .note", has_text="512 points, 1024 triangles, closed").wait_for()
        page.locator("#stages").fill("0.1, 0.2")
        run.click()
        page.get_by_text("off the surface, further than it reaches").first.wait_for()
        visit.complaints.clear()
        page.locator("#preset").select_option("pumpkin")
        chooser.set_input_files(ring)
        page.locator(".meshfile .note", has_text="512 points, 1024 triangles, closed").wait_for()
        page.locator("#stages").fill("0.1, 0.2")
    run.click()
    page.locator("#controls .note", has_text="Done in").wait_for(timeout=180_000)
    visit.shown("shown.of == 2")
    root = studio.split("/#")[0]
    job = parse_qs(urlsplit(page.url).fragment)["job"][0]
    assert len(httpx.get(f"{root}/v1/jobs/{job}").json()["params"]["mesh"]["points"]) == 512
    shape = trimesh.load_scene(
        io.BytesIO(httpx.get(f"{root}/v1/jobs/{job}/result?format=glb", timeout=60).content), file_type="glb"
    )
    assert len(shape.to_mesh().faces) >= 1024
    rounded = {"decay": 0.1, "growth": 0.3}[room]
    assert shape.extents.max() / shape.extents.min() == pytest.approx(3.5, rel=rounded), "a ring, as it was drawn"
    with page.expect_download() as taken:
        page.locator("a", has_text="Job as JSON").click()
    assert len(json.loads(Path(taken.value.path()).read_text())["params"]["mesh"]["faces"]) == 1024
    assert visit.complaints == []
    page.close()


def test_fruits_stand_on_a_mesh_of_ones_own(browser: Browser, studio: str, tmp_path: Path) -> None:
    ball = tmp_path / "ball.obj"
    trimesh.creation.icosphere(subdivisions=3, radius=7).export(ball)
    visit = Visit(browser, viewport={"width": 1000, "height": 800})
    page = visit.page
    page.goto(at(studio, "room=scene&rule=scatter&count=12"))
    visit.shown("shown.copies == 12")
    page.get_by_label("Placed").select_option("mesh")
    assert "no mesh to stand on yet" in page.get_by_role("alert").inner_text()
    page.get_by_label("Mesh: a file").set_input_files(ball)
    page.locator(".meshfile .note", has_text="642 points, 1280 triangles, closed").wait_for()
    page.locator("#trust", has_text="12 of 12 shown").wait_for()
    page.get_by_label("Longest side").fill("14")
    with page.expect_response("**/v1/scenes?*") as answer:
        page.get_by_label("Longest side").press("Enter")
    assert answer.value.status == 200
    page.get_by_text("At rest").wait_for()
    with page.expect_download() as taken:
        page.get_by_role("link", name="Scene as TOML").click()
    scene = tomllib.loads(Path(taken.value.path()).read_text())
    (place,) = scene["places"]
    assert (place["rule"], len(place["mesh"]["faces"])) == ("scatter", 1280)
    sizes = [sum(x * x for x in point) ** 0.5 for point in place["mesh"]["points"]]
    assert sizes == pytest.approx([7.0] * 642, rel=1e-4), "half of 14 cm, in the scene's centimetres"
    # the very file, as the command takes it
    (tmp_path / "scene.toml").write_text(Path(taken.value.path()).read_text())
    said = subprocess.run(
        [sys.executable, "-m", "service.cli", "scene", "scene.toml", "--json"],
        check=True,
        capture_output=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert json.loads(said.stdout)["instances"] == 12
    assert visit.complaints == []
    page.close()


def test_a_mesh_is_a_solid_that_a_cloth_falls_over(browser: Browser, studio: str, tmp_path: Path) -> None:
    ring = tmp_path / "ring.stl"
    trimesh.creation.torus(20.0, 8.0, major_sections=32, minor_sections=16).export(ring)
    visit = Visit(browser, viewport={"width": 1200, "height": 900})
    page = visit.page
    page.goto(at(studio, "room=growth"))
    visit.shown()
    page.locator("#preset").select_option("cloth")
    page.locator("summary", has_text=re.compile("^Solids")).click()
    page.get_by_role("button", name="Add to Solids").click()
    page.get_by_label("Solids 1: kind").select_option("mesh")
    page.get_by_label(re.compile("Mesh: a file")).last.set_input_files(ring)
    page.locator(".meshfile .note", has_text="512 points, 1024 triangles, closed").wait_for()
    page.locator("#stages").fill("0.05")
    page.get_by_role("button", name="Run", exact=True).click()
    page.locator("#controls .note", has_text="Done in").wait_for(timeout=180_000)
    root = studio.split("/#")[0]
    job = parse_qs(urlsplit(page.url).fragment)["job"][0]
    [solid] = httpx.get(f"{root}/v1/jobs/{job}").json()["params"]["solids"]
    assert (solid["kind"], len(solid["mesh"]["points"])) == ("mesh", 512)
