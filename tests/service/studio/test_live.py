"""What moves under the hand: a thousand fruits that dry together, and a shape that is painted while it grows."""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING

from .._browser import Visit
from ._rooms import SLOW, at

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytestmark = SLOW


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
    # the brush of the form is the one of the schema: the second stroke thickens as it grows
    thickening = page.locator("#tools-live details").first.get_by_label("Thickening", exact=True)
    thickening.fill("4")
    thickening.press("Enter")
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
    assert [stroke.get("thickening", 1) for stroke in strokes] == [1, 4]
    page.get_by_role("button", name="Undo").click()
    page.wait_for_function("() => document.getElementById('view').dataset.undo === '1'")
    assert visit.complaints == []
    page.close()
