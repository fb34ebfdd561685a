"""What the page leaves out where no graphics card draws: a browser that draws in software is one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ._browser import MARKS, Visit, pixels, serving

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytestmark = MARKS


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with serving(tmp_path_factory.mktemp("data")) as found:
        yield found


def test_a_browser_without_a_graphics_card_draws_plainly_and_may_be_asked_for_more(
    browser: Browser, address: str
) -> None:
    visit = Visit(browser, viewport={"width": 640, "height": 480})
    visit.page.goto(f"{address}/#s=0.2&te=0.035&gamma=20")
    visit.shown("shown.n >= 96")
    canvas, choice = visit.page.locator("#view"), visit.page.get_by_role("button", name="Full look")
    assert canvas.get_attribute("data-look") == "plain"
    assert choice.get_attribute("aria-pressed") == "false"
    plain = pixels(visit.picture())

    choice.click()
    assert canvas.get_attribute("data-look") == "full"
    assert choice.get_attribute("aria-pressed") == "true"
    full = pixels(visit.picture())
    assert np.abs(full - plain).mean() > 0.005

    visit.page.reload()  # what was chosen stays, as long as the tab is open
    visit.shown("shown.n >= 96")
    assert canvas.get_attribute("data-look") == "full"
    choice.click()
    assert canvas.get_attribute("data-look") == "plain"
    assert np.abs(pixels(visit.picture()) - plain).mean() < 0.005
    assert visit.complaints == []
    visit.page.close()


def test_a_graphics_card_is_not_asked_about(browser: Browser, address: str) -> None:
    visit = Visit(browser, viewport={"width": 640, "height": 480})
    named = "WebGL2RenderingContext.prototype.getParameter"
    visit.page.add_init_script(
        f"const asked = {named}; {named} = function (name) {{"
        " return name === 0x9246 || name === 0x1F01 ? 'ANGLE (Some Card)' : asked.call(this, name); }"
    )
    visit.page.goto(f"{address}/#s=0.2&te=0.035&gamma=20")
    visit.shown()
    assert visit.page.locator("#view").get_attribute("data-look") == "full"
    assert visit.page.get_by_role("button", name="Full look").count() == 0
    visit.page.close()
