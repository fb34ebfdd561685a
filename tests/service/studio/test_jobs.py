"""Rooms of jobs: a run is asked for, followed, shown and taken away; wood has a load curve."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import parse_qs, urlsplit

import httpx
import pytest

from .._browser import ROOT, Visit
from ._rooms import SLOW, at

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytestmark = SLOW


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


@pytest.mark.parametrize("room", ["decay", "growth", "wood"])
def test_every_preset_can_be_run_as_it_is(browser: Browser, studio: str, room: str) -> None:
    visit = Visit(browser, viewport={"width": 1200, "height": 800})
    page = visit.page
    page.goto(at(studio, f"room={room}"))
    visit.shown()
    presets = page.locator("#preset option").evaluate_all("all => all.map(one => one.value)")
    assert len(presets) > 5
    run = page.get_by_role("button", name="Run", exact=True)
    for preset in presets:
        page.locator("#preset").select_option(preset)
        assert run.is_enabled(), preset
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
