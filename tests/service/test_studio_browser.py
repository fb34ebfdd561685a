"""All rooms of the built page in a real browser, at three sizes, over a `wizen serve --studio` that runs their jobs."""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

import httpx
import pytest
import trimesh

from ._browser import MARKS, ROOT, Visit, serving

if TYPE_CHECKING:
    from playwright.sync_api import Browser

AXE = ROOT / "service" / "viewer" / "node_modules" / "axe-core" / "axe.min.js"
SIZES = {"desktop": (1440, 900), "tablet": (1024, 768), "phone": (390, 844)}
ROOMS = {
    "gallery": "room=gallery",
    "dry": "s=0.2",
    "rot": "room=decay",
    "grow": "room=growth",
    "live": "room=growth&live=1",
    "break": "room=wood",
    "scene": "room=scene&rule=scatter&count=9",
}
#: Small runs, so that rooms of jobs have something to show.
RUNS: tuple[dict[str, Any], ...] = (
    {
        "solver": "decay",
        "preset": "apple",
        "need": {"stages": [0, 2, 4], "quality": "preview", "fields": ["position", "rot", "mould", "rotten_share"]},
    },
    {"solver": "growth", "preset": "mushroom", "need": {"stages": [0.25, 0.5], "quality": "preview"}},
    {
        "solver": "wood",
        "preset": "twig",
        "params": {"rods": 7, "vertices": 10},
        "need": {
            "stages": [0.005, 0.01, 0.02],
            "quality": "preview",
            "fields": ["mesh_position", "inside", "body", "body_impulse", "broken_bonds"],
        },
    },
)

# shaders are compiled and scenes drawn in software here: beside other work that takes minutes
pytestmark = [*MARKS, pytest.mark.timeout(900)]


@pytest.fixture(scope="module")
def studio(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The studio's address, with its token, over a store in which `RUNS` are done."""
    data = tmp_path_factory.mktemp("data")
    with serving(data, "--studio", "--store", str(data / "store")) as address:
        root, secret = address.split("/#token=")
        allowed = {"Authorization": f"Bearer {secret}"}
        for run in RUNS:
            job = httpx.post(f"{root}/v1/jobs", json=run, headers=allowed, timeout=60).raise_for_status().json()
            with httpx.stream("GET", f"{root}{job['links']['events']}", timeout=300) as events:
                last = [line for line in events.iter_lines() if line.startswith("data: ")][-1]
            assert json.loads(last.removeprefix("data: "))["state"] == "done"
        yield address


def at(studio: str, words: str) -> str:
    return f"{studio}&{words}"


def arrived(visit: Visit, room: str) -> None:
    """Wait until a room shows what it is for."""
    if room == "live":
        visit.page.get_by_role("button", name="Begin").click()
    if room == "gallery":
        visit.page.locator(".cards li").first.wait_for()
    else:
        visit.shown()


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("room", ROOMS)
def test_every_room_fits_every_screen_and_everybody(browser: Browser, studio: str, room: str, size: str) -> None:
    width, height = SIZES[size]
    # the checker is a script of its own, which the page's policy rightly refuses
    visit = Visit(browser, viewport={"width": width, "height": height}, bypass_csp=True)
    visit.page.goto(at(studio, ROOMS[room]))
    arrived(visit, room)
    assert "token" not in visit.page.url
    assert visit.page.evaluate("document.documentElement.scrollWidth") <= width
    tab = visit.page.locator("#rooms [aria-current]")
    assert tab.count() == 1
    last = visit.page.locator("#rooms a").last.bounding_box()
    assert last is not None
    assert last["x"] + last["width"] <= width, "all rooms are in sight"
    if room != "gallery":
        # how far to trust it is in sight without scrolling, and so is how it came about
        for one in (".badge", ".tier"):
            box = visit.page.locator(one).bounding_box()
            assert box is not None
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= width
            assert 0 <= box["y"] <= height - box["height"]
        view = visit.page.locator("#view").bounding_box()
        assert view is not None
        assert view["height"] > 0.4 * height
    visit.page.add_script_tag(path=AXE)
    found = visit.page.evaluate("async () => (await axe.run()).violations.map(v => [v.id, v.nodes.map(n => n.html)])")
    assert found == []
    assert visit.hosts() == {urlsplit(studio).netloc}
    assert visit.complaints == []
    visit.page.close()


def test_rooms_are_reached_by_keys_alone(browser: Browser, studio: str) -> None:
    visit = Visit(browser, viewport={"width": 1000, "height": 700})
    visit.page.goto(at(studio, "s=0.2"))
    visit.shown()
    names = []
    for _ in range(6):
        visit.page.keyboard.press("Tab")
        names.append(visit.page.evaluate("document.activeElement.textContent"))
    assert names == ["Gallery", "Dry", "Rot", "Grow", "Break", "Scene"]
    for _ in range(2):
        visit.page.keyboard.press("Shift+Tab")
    visit.page.keyboard.press("Enter")
    visit.shown("shown.of")
    assert "mushroom" in visit.page.locator("#caption").inner_text()
    scrub = visit.page.locator("#scrub")
    scrub.focus()
    visit.page.keyboard.press("Home")
    assert visit.shown("shown.of && shown.stage == 0.25")
    assert visit.complaints == []
    visit.page.close()


def test_a_run_is_asked_for_followed_shown_and_taken_away(browser: Browser, studio: str, tmp_path: Path) -> None:
    visit = Visit(browser, viewport={"width": 1200, "height": 800})
    page = visit.page
    page.goto(at(studio, "room=decay&preset=apple"))
    visit.shown("shown.of")
    page.get_by_label("Temperature", exact=True).fill("99")
    assert "99 is out of range, -10 to 60 degC" in page.locator("#controls").inner_text()
    assert page.get_by_role("button", name="Run", exact=True).is_disabled()
    page.get_by_label("Temperature", exact=True).fill("10")
    page.get_by_role("textbox", name=re.compile("^Stages")).fill("1, 500")
    assert "500 is out of range, 0 to 120 day" in page.locator("#controls").inner_text()
    page.get_by_role("textbox", name=re.compile("^Stages")).fill("1, 3")
    command = page.locator("#actions code").inner_text()
    assert "--set 'temperature=10'" in command
    page.get_by_role("button", name="Run", exact=True).click()
    page.get_by_text(re.compile(r"Done in [\d.]+ s\.|of 2 stages")).first.wait_for(timeout=120_000)
    visit.shown("shown.of == 2 && shown.stage == 3")
    # what the page shows is what the service has: the very run, and the command that makes it
    (job,) = parse_qs(urlsplit(page.url).fragment)["job"]
    root = studio.split("/#")[0]
    found = httpx.get(f"{root}/v1/jobs/{job}", timeout=60).json()
    assert (found["params"]["temperature"], found["need"]["stages"]) == (10, [1, 3])
    assert re.search(r"apple, changed, t = 3 day", page.locator("#caption").inner_text())
    assert page.get_by_role("img", name=re.compile("at 3 day")).count() >= 1
    with page.expect_download() as download:
        page.get_by_role("link", name="Download GLB").click()
    assert download.value.path().read_bytes()[:4] == b"glTF"
    page.get_by_text("Map", exact=True).click()
    page.wait_for_function("() => document.querySelector('.map').naturalWidth === 256")
    said = json.loads(
        subprocess.run(
            [sys.executable, "-m", "service.cli", *_words(command, tmp_path / "apple.h5"), "--json"],
            check=True,
            capture_output=True,
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
        ).stdout
    )
    assert said["params"] == found["params"]
    assert visit.complaints == []
    page.close()


def _words(command: str, out: Path) -> list[str]:
    """Return the words of a shown command, its output elsewhere."""
    import shlex

    words = shlex.split(command)
    assert words[0] == "wizen"
    return [*words[1:-1], str(out)]


def test_a_wound_is_put_where_the_shape_is_clicked(browser: Browser, studio: str) -> None:
    visit = Visit(browser, viewport={"width": 1200, "height": 800})
    visit.page.goto(at(studio, "room=decay&preset=apple"))
    visit.shown("shown.of")
    visit.page.get_by_role("button", name="Place wounds").click()
    box = visit.page.locator("#view").bounding_box()
    assert box is not None
    visit.page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    visit.page.get_by_text("Added at colatitude").wait_for()
    assert visit.page.get_by_text("Wounds (3)").count() == 1
    (said,) = re.findall(r"'wounds=(\[.*?\])'", visit.page.locator("#actions code").inner_text())
    wounds = json.loads(said)
    # the camera looks from above, from between x and z
    assert 40 < wounds[2]["colatitude"] < 110
    assert 0 < wounds[2]["azimuth"] < 90
    visit.page.close()


def test_a_rotten_fruit_is_cut_open_where_one_likes(browser: Browser, studio: str) -> None:
    """What is shown is what the service cuts: half of it, on the stage where it was, and so is what is taken away."""
    visit = Visit(browser, viewport={"width": 1200, "height": 900}, bypass_csp=True)
    page = visit.page
    page.goto(at(studio, "room=decay&preset=apple&stages=0,2,4"))
    visit.shown("shown.of == 3 && shown.stage == 4")
    scrub = page.locator("#scrub")
    scrub.focus()
    page.keyboard.press("Home")
    visit.shown("shown.stage == 0")
    assert not page.locator("#cut-depth").is_visible()
    choice = page.get_by_label("Cut open")
    choice.focus()
    with page.expect_response(lambda answer: "cut=" in answer.url and "stage=0" in answer.url) as cut:
        choice.select_option("front")
    assert parse_qs(urlsplit(cut.value.url).query)["cut"] == ["0,0,0,0,0,1"]
    visit.shown("shown.stage == 0 && !shown.blended")
    # the hand stays on what it holds, and the stage where it was
    assert page.evaluate("document.activeElement.id") == "cut"
    with page.expect_response(lambda answer: "cut=" in answer.url) as cut:
        page.locator("#cut-depth").focus()
        page.keyboard.press("ArrowRight")
        page.keyboard.press("Tab")
    assert parse_qs(urlsplit(cut.value.url).query)["cut"] == ["0,0,0.05,0,0,1"]
    page.get_by_text("stages fetched").wait_for(state="hidden")
    with page.expect_download() as download:
        page.get_by_role("link", name="Download GLB").click()
    taken = trimesh.load(io.BytesIO(download.value.path().read_bytes()), file_type="glb", force="mesh")
    assert taken.vertices[:, 2].max() < 0.06 < 0.8 < -taken.vertices[:, 2].min()
    with page.expect_response(lambda answer: "cut" not in answer.url and "threads=" in answer.url):
        choice.select_option("")
        page.get_by_label("Threads of mould").check()
    page.get_by_text("stages fetched").wait_for(state="hidden")
    page.add_script_tag(path=AXE)
    assert page.evaluate("async () => (await axe.run()).violations.map(v => v.id)") == []
    assert visit.complaints == []
    page.close()
    # where nothing is known of the inside nothing is offered
    other = Visit(browser, viewport={"width": 1200, "height": 900})
    other.page.goto(at(studio, "room=growth"))
    other.shown()
    assert other.page.get_by_label("Cut open").count() == 0
    other.page.close()


def test_a_frost_is_drawn_and_stops_the_rot(browser: Browser, studio: str) -> None:
    visit = Visit(browser, viewport={"width": 1200, "height": 900}, bypass_csp=True)
    page = visit.page
    page.goto(at(studio, "room=decay&preset=apple&stages=0,4"))
    visit.shown()
    warm = page.locator("#seen dl").text_content()
    page.locator("summary", has_text="Weather").click()
    field = page.locator(".course .field-of").first  # of the temperature
    box = field.bounding_box()
    assert box is not None
    field.click(position={"x": 3, "y": box["height"] / 2})
    field.click(position={"x": 0.5 * box["width"], "y": box["height"] - 1})
    points = page.locator(".course svg").first.get_by_role("slider")
    assert points.count() == 2
    # by hand to the ground, then by keys a little up and back again
    first, plot = points.nth(0).bounding_box(), field.bounding_box()
    assert first is not None
    assert plot is not None
    page.mouse.move(first["x"] + first["width"] / 2, first["y"] + first["height"] / 2)
    page.mouse.down()
    page.mouse.move(plot["x"] + 4, plot["y"] + plot["height"] + 20, steps=4)
    page.mouse.up()
    points.nth(0).focus()
    page.keyboard.press("ArrowUp")
    assert "-9.3 degC" in (points.nth(0).get_attribute("aria-valuetext") or "")
    page.keyboard.press("ArrowDown")
    assert "-10 degC" in (points.nth(0).get_attribute("aria-valuetext") or "")
    said = page.locator("code", has_text="wizen solve").inner_text()
    [weather] = re.findall(r"--set 'weather=([^']*)'", said)
    assert [each["temperature"] for each in json.loads(weather)] == pytest.approx([-10, -10], abs=1.5)
    page.get_by_role("button", name="Run").click()
    page.locator("#controls .note", has_text="Done in").wait_for(timeout=120_000)
    visit.shown("shown.of == 2")
    job = parse_qs(urlsplit(page.url).fragment)["job"][0]
    done = httpx.get(f"{studio.split('/#')[0]}/v1/jobs/{job}").json()
    assert [each["temperature"] for each in done["params"]["weather"]] == pytest.approx([-10, -10], abs=1.5)
    fields = httpx.get(f"{studio.split('/#')[0]}/v1/jobs/{job}/fields?names=rotten_share").json()["fields"]
    shares = fields["rotten_share"]["values"]
    assert shares[-1] == pytest.approx(shares[0], abs=1e-6), "nothing grows in frost"
    assert page.locator("#seen dl").text_content() != warm
    page.add_script_tag(path=AXE)
    assert page.evaluate("async () => (await axe.run()).violations.map(v => [v.id, v.nodes.map(n => n.html)])") == []
    # taken away again, the steady air holds
    points.nth(1).focus()
    page.keyboard.press("Delete")
    page.locator(".course svg").first.get_by_role("slider").nth(0).focus()
    page.keyboard.press("Delete")
    assert "weather" not in page.locator("code", has_text="wizen solve").inner_text()
    assert visit.complaints == []
    page.close()


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
        # the mushroom's tools are where this ring is not: the solver says so, in the page
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


def test_breaking_has_a_load_curve_in_newtons(browser: Browser, studio: str) -> None:
    visit = Visit(browser, viewport={"width": 1200, "height": 800})
    visit.page.goto(at(studio, "room=wood"))
    visit.shown("shown.of == 3")
    said = visit.page.get_by_role("img", name=re.compile(r"^Load: mean force")).get_attribute("aria-label")
    (most,) = re.findall(r"at most ([\d.e-]+)", str(said))
    root = studio.split("/#")[0]
    jobs = httpx.get(f"{root}/v1/jobs", params={"state": "done"}, timeout=60).json()["jobs"]
    (job,) = [one for one in jobs if one["solver"] == "wood"]
    got = httpx.get(f"{root}/v1/jobs/{job['id']}/fields", params={"names": "stage,body_impulse"}, timeout=60).json()[
        "fields"
    ]
    times, impulses = got["stage"]["values"], got["body_impulse"]["values"]
    sizes = [0.0, *(sum(x * x for x in one[0]) ** 0.5 for one in impulses)]
    forces = [abs(b - a) / (t - s) for a, b, s, t in zip(sizes, sizes[1:], [0.0, *times], times, strict=False)]
    assert float(most) == pytest.approx(max(forces), rel=1e-3)
    visit.page.close()


def test_two_shapes_stand_side_by_side(browser: Browser, studio: str) -> None:
    visit = Visit(browser, viewport={"width": 1000, "height": 640})
    visit.page.goto(at(studio, "s=0.2"))
    visit.shown("shown.n >= 192")
    visit.page.get_by_role("button", name="Compare").click()
    assert "s = 0.2" in visit.page.locator("#beside").inner_text()
    visit.page.get_by_role("link", name="Rot").click()
    visit.shown("shown.of")
    assert "s = 0.2" in visit.page.locator("#beside").inner_text()
    assert "apple" in visit.page.locator("#caption").inner_text()
    visit.page.get_by_role("button", name="Stop comparing").click()
    assert visit.page.locator("#beside").is_hidden()
    assert visit.complaints == []
    visit.page.close()


def test_a_thousand_fruits_dry_together(browser: Browser, studio: str) -> None:
    visit = Visit(browser, viewport={"width": 700, "height": 500})
    visit.page.goto(at(studio, "room=scene&rule=scatter&count=1000&stage=0.1"))
    assert visit.shown("shown.copies")["copies"] == 1000
    before = visit.picture()
    visit.page.locator("#dry").focus()
    visit.page.keyboard.press("End")
    assert visit.shown("shown.stage == 0.3")["copies"] == 1000
    assert "dried in place" in visit.page.locator(".badge").inner_text()
    assert visit.picture() != before
    scenes = [url for url in visit.asked if "/v1/scenes" in url]
    assert len(scenes) == 1  # the shapes alone were asked for anew
    visit.page.get_by_label("jujube 1").fill("5000")
    visit.page.get_by_label("jujube 1").press("Enter")
    assert "out of range, 1 to 1000" in visit.page.get_by_role("alert").inner_text()
    assert visit.complaints == []
    visit.page.close()


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


def test_the_gallery_leads_to_what_it_shows(browser: Browser, studio: str) -> None:
    visit = Visit(browser, viewport={"width": 1000, "height": 700})
    visit.page.goto(at(studio, "room=gallery"))
    names = visit.page.locator(".cards a").all_inner_texts()
    assert len(names) == len(set(names)), "no two cards say the same"
    visit.page.get_by_role("link", name=re.compile("^apple a run")).click()
    assert visit.shown("shown.of")["of"] >= 2
    visit.page.get_by_role("link", name="Gallery").click()
    visit.page.get_by_role("link", name=re.compile("^raisin live")).click()
    visit.shown("shown.n")
    assert "raisin" in visit.page.locator("#caption").inner_text()
    visit.page.get_by_role("link", name="Gallery").click()
    visit.page.get_by_role("link", name=re.compile("^potato not computed")).click()
    visit.page.locator("#caption").get_by_text("not computed yet").wait_for()
    assert "--preset potato" in visit.page.locator("#actions code").inner_text()
    assert visit.complaints == []
    visit.page.close()


def test_numbers_outside_of_a_table_are_said_to_be(browser: Browser, studio: str) -> None:
    visit = Visit(browser, viewport={"width": 1000, "height": 700})
    visit.page.goto(at(studio, "s=0.2&te=0.035&gamma=20"))
    visit.shown("shown.n >= 192")
    exactly = visit.page.get_by_label("Skin thickness, exactly")
    exactly.fill("0.5")
    exactly.press("Enter")
    visit.page.get_by_text("0.5 is out of range, this table holds 0.03 to 0.04 r1").wait_for()
    assert visit.shown("shown.te == 0.04")
    visit.page.close()


def test_a_shape_is_painted_while_it_grows(browser: Browser, studio: str) -> None:
    visit = Visit(browser, viewport={"width": 1000, "height": 700})
    page = visit.page
    page.goto(at(studio, "room=growth"))
    page.get_by_role("link", name="work on it live").click()
    page.get_by_label("Begin with", exact=True).select_option("sphere-spot")
    page.get_by_role("button", name="Begin").click()
    begun = visit.shown("shown.vertices")
    assert begun["stage"] == 0
    # by keys alone, then with the pointer
    page.get_by_role("button", name="Dab in the middle").press("Enter")
    # the next dab is taken once this one is at rest
    dabbed = visit.shown("shown.stage > 0 && !shown.underway")
    box = page.locator("#view").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x - 40, y)
    page.mouse.down()
    for step in range(20):
        page.mouse.move(x - 40 + 4 * step, y + step % 2)
        page.wait_for_timeout(50)
    page.mouse.up()
    visit.shown(f"shown.stage > {dabbed['stage']}")
    page.wait_for_function("() => document.getElementById('view').dataset.undo === '2'")
    page.get_by_role("button", name="Save as TOML").click()
    saved = tomllib.loads(page.locator(".toml").inner_text(timeout=60_000))
    strokes = [tool for tool in saved["tools"] if tool["kind"] == "stroke"]
    assert len(strokes) == 2
    page.get_by_role("button", name="Undo").click()
    page.wait_for_function("() => document.getElementById('view').dataset.undo === '1'")
    assert visit.complaints == []
    page.close()
