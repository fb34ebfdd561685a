"""The room *rot*: wounds where one clicks, a fruit cut open, weather that is drawn."""

from __future__ import annotations

import io
import json
import re
from typing import TYPE_CHECKING
from urllib.parse import parse_qs, urlsplit

import httpx
import pytest
import trimesh

from .._browser import Visit
from ._rooms import AXE, SLOW, at

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytestmark = SLOW


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
