"""All rooms of the built page in a real browser, at three sizes, by keys alone, beside each other, and the gallery."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import pytest

from .._browser import Visit
from ._rooms import AXE, ROOMS, SIZES, SLOW, arrived, at

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytestmark = SLOW


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
