"""The built page in a real browser over a real `wizen serve` on the table that comes with wizen.

Needs `make page`, Chromium and playwright (`pip install -e '.[browser]'`); draws in software, so no GPU is needed.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import httpx
import numpy as np
import pytest

from solver import __version__
from store.store import Store
from store.tokens import Tokens

from ..store.conftest import fill
from ._browser import MARKS, ROOT, Visit, pixels, serving
from .conftest import AXES, SHAPE, build

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytestmark = MARKS


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with serving(tmp_path_factory.mktemp("data")) as found:
        yield found


@pytest.fixture
def visit(browser: Browser) -> Iterator[Visit]:
    found = Visit(browser, viewport={"width": 1000, "height": 640})
    yield found
    found.page.close()


def test_a_slider_changes_the_mesh(visit: Visit, address: str) -> None:
    visit.page.goto(f"{address}/#s=0&te=0.035&gamma=20")
    fresh = visit.shown("shown.n >= 192")
    assert fresh == {"n": 192, "s": 0, "te": 0.035, "gamma": 20}
    smooth = visit.picture()
    assert "exact" in visit.page.locator(".badge").inner_text()

    slider = visit.page.get_by_label("Shrinkage s", exact=True)
    slider.focus()
    visit.page.keyboard.press("End")
    assert visit.shown("shown.n >= 192 && shown.s > 0")["s"] == 0.3
    wrinkled = visit.picture()
    assert wrinkled != smooth
    assert "expected error" in visit.page.locator(".badge").inner_text()
    assert slider.get_attribute("aria-valuetext") == "0.3"
    assert np.abs(pixels(wrinkled) - pixels(smooth)).mean() > 0.05

    visit.page.get_by_label("Skin stiffness γ", exact=True).press("ArrowRight")
    assert visit.shown("shown.n >= 192 && shown.gamma != 20")["gamma"] > 20
    assert re.search(r"gamma=20\.\d", visit.page.evaluate("location.hash"))
    assert visit.complaints == []
    assert {urlsplit(url).netloc for url in visit.asked} == {urlsplit(address).netloc}


def test_drying_is_a_film(visit: Visit, address: str) -> None:
    visit.page.goto(f"{address}/#s=0")
    visit.shown()
    visit.page.get_by_role("button", name="Dry", exact=True).click()
    seen = [visit.shown(f"shown.s > {s}")["s"] for s in (0.02, 0.1, 0.2)]
    assert seen == sorted(seen)
    visit.page.get_by_role("button", name="Stop").click()
    still = visit.shown("shown.n >= 192")
    assert visit.page.get_by_label("Shrinkage, exactly").input_value() == f"{still['s']:.4g}"
    assert visit.complaints == []


def test_looks_and_skins(visit: Visit, address: str) -> None:
    visit.page.goto(address)
    visit.shown("shown.n >= 192")
    visit.page.get_by_role("button", name="Furrowed").click()
    assert visit.shown("shown.n >= 192 && shown.s == 0.25")["gamma"] == 50
    before = visit.picture()
    visit.page.get_by_role("button", name="plum", exact=True).click()
    assert visit.picture() != before
    assert "skin=plum" in visit.page.url
    assert visit.page.get_by_role("button", name="plum", exact=True).get_attribute("aria-pressed") == "true"
    assert visit.complaints == []


def test_the_method_can_be_chosen(visit: Visit, address: str) -> None:
    visit.page.goto(f"{address}/#s=0.25&te=0.035&gamma=20")
    visit.shown("shown.n >= 192")
    assert visit.page.get_by_role("button", name="Default").get_attribute("aria-pressed") == "true"
    before = visit.picture()
    visit.page.get_by_role("button", name="Paper's IDW").click()
    visit.page.wait_for_function("() => document.getElementById('view').dataset.method === 'idw'")
    visit.shown("shown.n >= 192")
    assert visit.picture() != before
    assert "idw" in visit.page.locator("#trust").inner_text()
    assert "method=idw" in visit.page.url
    assert "method=idw" in str(visit.page.get_by_role("link", name="Download GLB").get_attribute("href"))
    assert visit.complaints == []


def test_the_badge_tells_the_error_to_expect(browser: Browser, tmp_path: Path) -> None:
    store = Store.open(tmp_path / "store", create=True)
    fill(store, **AXES)
    build(store)
    with serving(tmp_path, "--store", str(store.root)) as address:
        visit = Visit(browser)
        visit.page.goto(f"{address}/#s=0.25&te=0.03&gamma=7")
        visit.shown("shown.n >= 192")
        query = {"te": 0.03, "gamma": 7, "s": 0.25}
        said = httpx.get(f"{address}{SHAPE}", params=query).json()["expected_error"]
        assert re.search(r"expected error ([\d.]+) %", visit.page.locator(".badge").inner_text())
        shown = visit.page.locator("#trust").inner_text()
        assert f"{float(format(said['dB'], '.2g')):g} dB" in shown
        assert re.search(r"Between runs\s+yes", shown)
        visit.page.close()


def test_the_view_turns_with_the_keys(visit: Visit, address: str) -> None:
    visit.page.goto(address)
    visit.shown("shown.n >= 192")
    before = visit.picture()
    visit.page.locator("#view").focus()
    visit.page.keyboard.press("ArrowRight")
    assert visit.picture() != before


def test_what_people_take_away_works(visit: Visit, address: str) -> None:
    visit.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    visit.page.goto(f"{address}/#s=0.2&te=0.035&gamma=20")
    visit.shown("shown.n >= 192")
    visit.page.get_by_role("button", name="Copy as curl").click()
    visit.page.get_by_text("Command copied.").wait_for()
    command = visit.page.evaluate("navigator.clipboard.readText()")
    (url,) = re.findall("'(.+)'", command)
    assert command.startswith("curl ")
    body = httpx.get(url).content
    assert body[:4] == b"glTF"
    with visit.page.expect_download() as download:
        visit.page.get_by_role("link", name="Download GLB").click()
    assert download.value.path().read_bytes() == body
    assert download.value.suggested_filename == "dehydration-te0.035-gamma20-s0.2.glb"


def test_a_narrow_screen_needs_no_sideways_scrolling(browser: Browser, address: str) -> None:
    visit = Visit(browser, viewport={"width": 360, "height": 740}, has_touch=True)
    visit.page.goto(address)
    visit.shown()
    assert visit.page.evaluate("document.documentElement.scrollWidth") <= 360
    view = visit.page.locator("#view").bounding_box()
    slider = visit.page.get_by_label("Shrinkage s", exact=True).bounding_box()
    assert view is not None
    assert slider is not None
    assert view["height"] > 300
    assert slider["y"] + slider["height"] < 740  # the fruit and its first slider are seen together
    visit.page.close()


def test_errors_of_the_service_are_shown_with_advice_until_they_pass(browser: Browser, tmp_path: Path) -> None:
    store = tmp_path / "store"
    with serving(tmp_path, "--store", str(store)) as address:
        visit = Visit(browser)
        visit.page.goto(address)
        problem = visit.page.get_by_role("alert")
        problem.wait_for()
        assert "there is no store" in problem.inner_text()
        shutil.copytree(ROOT / "store" / "starter", store)
        visit.shown()
        assert problem.is_hidden()
        visit.page.close()


def test_a_service_that_allows_little_detail_is_asked_for_no_more(browser: Browser, tmp_path: Path) -> None:
    with serving(tmp_path, WIZEN_MAX_RESOLUTION="100") as address:
        visit = Visit(browser)
        visit.page.goto(address)
        assert visit.shown("shown.n >= 100")["n"] == 100
        assert all("resolution=192" not in url for url in visit.asked)
        assert visit.complaints == []
        visit.page.close()


@pytest.fixture
def shrinking(tmp_path: Path) -> tuple[Store, str]:
    """A store with a table of the solver `shrinking`, whose runs take no time, and Python's path to it."""
    info = tmp_path / "site" / "shrinking-1.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: shrinking\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[wizen.solvers]\nshrinking = shrinking:SOLVER\n")
    path = os.pathsep.join(map(str, (ROOT, ROOT / "tests" / "sweeps", info.parent)))
    plan, store = tmp_path / "plan.toml", tmp_path / "store"
    plan.write_text(
        'solver = "shrinking"\n[set]\npause = 0.5\n[axes]\nte = [0.02, 0.04]\ngamma = [10, 30]\n'
        '[need]\nstages = [0.2]\nquality = "preview"\n'
    )
    for command in (["sweep", plan, "--store", store], ["table", "build", "--store", store, "--solver", "shrinking"]):
        words = [sys.executable, "-m", "service.cli", *map(str, command)]
        subprocess.run(words, env={**os.environ, "PYTHONPATH": path}, check=True, capture_output=True)
    return Store.open(store), path


def test_what_the_table_only_guesses_is_run_exactly(
    browser: Browser, tmp_path: Path, shrinking: tuple[Store, str]
) -> None:
    store, path = shrinking
    secret = Tokens(store.root).create("visitor", ["run"])[1]
    with serving(tmp_path, "--store", str(store.root), PYTHONPATH=path) as address:
        visit = Visit(browser)
        visit.page.goto(f"{address}/#s=0.13&te=0.03&gamma=17&method=idw")
        visit.shown("shown.s == 0.13")
        run = visit.page.get_by_role("button", name="Run exactly")
        run.click()
        dialog = visit.page.get_by_role("dialog")
        dialog.get_by_label("Token").fill("nonsense")
        dialog.get_by_role("button", name="Run", exact=True).click()
        visit.page.get_by_text("the token is not known here").wait_for()
        assert visit.complaints == ["Failed to load resource: the server responded with a status of 401 (Unauthorized)"]
        run.click()  # asks again
        dialog.get_by_label("Token").fill(secret)
        dialog.get_by_role("button", name="Run", exact=True).click()
        visit.page.get_by_text("Computed for this very point.").wait_for(timeout=120_000)
        assert "a stored run" in visit.page.locator(".badge").inner_text()
        assert any(url.endswith("/events") for url in visit.asked)
        (job,) = [job for job in store.ledger.jobs("done") if job.need["stages"] == [0.13]]
        assert (job.params["exocarp_thickness"], job.params["modulus_ratio"]) == (0.03, 17.0)
        assert visit.page.locator("#view").get_attribute("data-exact") == "true"
        # the run goes with its point; the token stays where it is
        visit.page.get_by_role("button", name="Nearest run").click()
        visit.page.wait_for_function("() => document.getElementById('view').dataset.exact === 'false'")
        assert visit.page.evaluate("JSON.stringify([localStorage, sessionStorage])") == "[{},{}]"
        assert len(visit.complaints) == 1
        visit.page.close()


def test_the_documentation_is_our_own(visit: Visit, address: str) -> None:
    visit.page.goto(f"{address}/docs")
    visit.page.get_by_text("One shape, interpolated from a table").wait_for()
    assert __version__ in visit.page.locator(".version").first.inner_text()
    assert {urlsplit(url).netloc for url in visit.asked if not url.startswith("data:")} == {urlsplit(address).netloc}
    assert visit.complaints == []
