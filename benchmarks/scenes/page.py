"""How often the page changes what it shows, in a browser that draws in software: python -m benchmarks.scenes.page.

Each row is driven as a hand would (a slider that never rests, a growth that plays, a brush) for some seconds, thrice:
drawn by SwiftShader on the processor, in the plain look that the page takes on there and in the full one, and with the
draw calls left out, so that what remains is the page's own work and the service's. A graphics card draws what
SwiftShader needs seconds for: the last figure is the bound that it leaves. First of all, how long the first picture
takes from the address on, by a service that has just begun: until what is shown is there, and until a frame of it is
drawn. Draw calls are counted in the browser's own WebGL functions,
instanced ones apart. Page and service: processor seconds of the page's thread and of the server, over the updates;
both together are the least time from one update to the next.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import psutil

from benchmarks.figures import Sheet
from benchmarks.scenes.picture import FLAGS
from benchmarks.service.__main__ import running
from service.commands.studio import fit_out

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

#: Counts draw calls and frames; where `drawn` is false the calls are left out.
_COUNT = """() => {
  window.counted = { single: 0, instanced: 0, copies: 0, renders: 0, shown: 0 };
  const gl = WebGL2RenderingContext.prototype;
  for (const [name, kind] of [["drawElements", "single"], ["drawArrays", "single"],
      ["drawElementsInstanced", "instanced"], ["drawArraysInstanced", "instanced"]]) {
    const real = gl[name];
    gl[name] = function (...words) {
      counted[kind]++;
      if (kind === "instanced") counted.copies += words[words.length - 1];
      if (window.drawn) real.apply(this, words);
    };
  }
  let before = 0;
  const count = () => {
    const calls = counted.single + counted.instanced;
    if (calls > before) counted.renders++;
    before = calls;
    requestAnimationFrame(count);
  };
  requestAnimationFrame(count);
}"""
#: Notes when something is shown first, and when a frame that was begun after it is over, since the address was gone to.
_FIRST = """() => {
  const look = () => {
    if (!document.getElementById("view")?.dataset.shown) return setTimeout(look, 5);
    window.first = { shown: performance.now() };
    requestAnimationFrame(() => setTimeout(() => (window.first.drawn = performance.now()), 0));
  };
  look();
}"""
#: Moves a slider to and fro for some milliseconds, and counts what is shown meanwhile.
_DRIVE = """async ([selector, milliseconds, label]) => {
  const view = document.getElementById("view");
  const seen = new MutationObserver((all) => (counted.shown += all.length));
  seen.observe(view, { attributes: true, attributeFilter: ["data-shown"] });
  const input = selector && document.querySelector(selector);
  const press = label && [...document.querySelectorAll("button")].find((one) => one.textContent === label);
  let held = -1;
  const begin = performance.now();
  Object.assign(counted, { single: 0, instanced: 0, copies: 0, renders: 0, shown: 0 });
  while (performance.now() - begin < milliseconds) {
    // as a screen's frames come, not faster
    await new Promise((done) => setTimeout(done, 16));
    if (input) {
      const share = 0.5 + 0.45 * Math.sin((performance.now() - begin) / 700);
      input.value = Number(input.min) + share * (Number(input.max) - Number(input.min));
      input.dispatchEvent(new Event("input", { bubbles: true }));
    }
    const now = press ? JSON.parse(view.dataset.shown).input : held;
    if (now !== held) press.click();
    held = now;
  }
  seen.disconnect();
  return { ...counted, seconds: (performance.now() - begin) / 1000, at: JSON.parse(view.dataset.shown) };
}"""


class _Row(NamedTuple):
    name: str
    words: str
    #: What is moved; what is chosen and clicked first.
    slider: str = ""
    quality: str = ""
    clicks: tuple[str, ...] = ()
    #: A button that is pressed whenever what is shown holds what the last press did.
    press: str = ""


#: Words of a table -> whether draw calls are made, and the look.
_DRAWING = {
    "in software, plain look": (True, "plain"),
    "in software, full look": (True, "full"),
    "left out": (False, "full"),
}
_DAB = "Dab in the middle"
_ROWS = (
    _Row("dry: one fruit, s moves", "s=0.2", "#axis-s"),
    _Row("scene: 1,000 fruits on the floor, all dried", "room=scene&rule=scatter&count=1000", "#dry"),
    _Row("grow: live, playing", "room=growth&live=1&preset=mushroom", quality="default", clicks=("Begin", "Grow")),
    _Row("grow: live, painted", "room=growth&live=1&preset=sphere-spot", "", "default", ("Begin",), _DAB),
)


def _prepared(drawing: str) -> str:
    """Return the script that chooses the look before the page does, and counts what it draws."""
    is_drawn, look = _DRAWING[drawing]
    return f"sessionStorage.setItem('wizen-look', '{look}'); window.drawn = {str(is_drawn).lower()}; ({_COUNT})()"


@contextmanager
def _opened(browser: Browser, address: str, row: _Row, drawing: str) -> Iterator[Page]:
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.add_init_script(_prepared(drawing))
    page.goto(address)
    if row.quality:
        page.locator("#quality").select_option(row.quality)
    for label in row.clicks[:1]:
        page.get_by_role("button", name=label).first.click()
    page.wait_for_function("() => document.getElementById('view').dataset.shown", timeout=300_000)
    page.wait_for_timeout(1500)
    for label in row.clicks[1:]:
        page.get_by_role("button", name=label).first.click()
    yield page
    page.close()


def _first(browser: Browser, server: psutil.Process, address: str, drawing: str) -> dict[str, Any]:
    """Return how long the first picture takes, in a browser that keeps nothing."""
    page = browser.new_context(viewport={"width": 1280, "height": 800}).new_page()
    page.add_init_script(f"{_prepared(drawing)}; ({_FIRST})()")
    spent = sum(server.cpu_times()[:4])
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable", {"timeDomain": "threadTicks"})
    page.goto(f"{address}&s=0.2")
    page.wait_for_function("() => window.first?.drawn", timeout=300_000)
    first = page.evaluate("window.first")
    busy = _metrics(session)["TaskDuration"]
    spent = sum(server.cpu_times()[:4]) - spent
    page.context.close()
    return {"what": "first picture", "drawing": drawing, **first, "page_s": busy, "service_cpu_s": spent}


def _metrics(session: Any) -> dict[str, float]:
    return {one["name"]: one["value"] for one in session.send("Performance.getMetrics")["metrics"]}


def _measure(browser: Browser, server: psutil.Process, address: str, row: _Row, drawing: str, seconds: float) -> Any:
    """Return what was shown a second, and what one change took of the page's thread and of the service."""
    with _opened(browser, f"{address}&{row.words}", row, drawing) as page:
        page.evaluate(_DRIVE, [row.slider, 1500, row.press])  # what is compiled and opened once
        session = page.context.new_cdp_session(page)
        session.send("Performance.enable", {"timeDomain": "threadTicks"})
        before, spent = _metrics(session), sum(server.cpu_times()[:4])
        seen = page.evaluate(_DRIVE, [row.slider, 1000 * seconds, row.press])
        after, spent = _metrics(session), sum(server.cpu_times()[:4]) - spent
    count = max(1, seen["shown"])
    task = 1000 * (after["TaskDuration"] - before["TaskDuration"]) / count
    served = 1000 * spent / count
    return {
        "what": row.name,
        "drawing": drawing,
        "updates_s": seen["shown"] / seen["seconds"],
        "frames_s": seen["renders"] / seen["seconds"],
        "page_ms": task,
        "script_ms": 1000 * (after["ScriptDuration"] - before["ScriptDuration"]) / count,
        "service_cpu_ms": served,
        "calls_frame": seen["single"] / max(1, seen["renders"]),
        "instanced_frame": seen["instanced"] / max(1, seen["renders"]),
        "copies_frame": seen["copies"] / max(1, seen["renders"]),
        "at": seen["at"],
    }


def _begin(driver: Any, chromium: str, command: list[str], folder: Path, secret: str) -> None:
    """Measure first pictures, each by a service and a browser of their own and then again, and keep them."""
    sheet = Sheet("page-first", ["first picture", "drawing", "there", "drawn", "page's thread", "service"])
    for drawing in _DRAWING:
        with running(command, "/healthz", WIZEN_STORE=str(folder / "store")) as (server, port, _):
            browser = driver.chromium.launch(executable_path=chromium, args=FLAGS)
            for turn in ("service and browser just begun", "again", "once more"):
                run = _first(browser, psutil.Process(server.pid), f"http://127.0.0.1:{port}/#token={secret}", drawing)
                times = [f"{run[name] / 1000:.2f} s" for name in ("shown", "drawn")]
                sheet.add(
                    [turn, drawing, *times, f"{run['page_s']:.2f} s", f"{run['service_cpu_s']:.2f} s"], turn=turn, **run
                )
            browser.close()
    sheet.keep()


def main() -> None:
    """Measure all rows, and keep them."""
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=8.0, help="for each row [s]")
    parser.add_argument("--first", action="store_true", help="the first picture alone")
    given = parser.parse_args()
    seconds = given.seconds
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        sys.exit("Chromium is needed: apt-get install chromium")
    sheet = Sheet(
        "page",
        [
            "room",
            "drawing",
            "frames a second",
            "updates a second",
            "page, each",
            "service, each",
            "bound",
            "draw calls a frame",
            "of them instanced",
        ],
    )
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        secret = fit_out(Path(folder) / "store")
        command = [sys.executable, "-m", "service.cli", "serve", "--port", "{port}"]
        _begin(driver, chromium, command, Path(folder), secret)
        if given.first:
            return
        with running(command, "/healthz", WIZEN_STORE=str(Path(folder) / "store")) as (server, port, _):
            browser = driver.chromium.launch(executable_path=chromium, args=FLAGS)
            for row in _ROWS:
                for drawing in _DRAWING:
                    address = f"http://127.0.0.1:{port}/#token={secret}"
                    run = _measure(browser, psutil.Process(server.pid), address, row, drawing, seconds)
                    calls = run["calls_frame"] + run["instanced_frame"]
                    cells = [
                        row.name,
                        drawing,
                        f"{run['frames_s']:.1f}" if _DRAWING[drawing][0] else "",
                        f"{run['updates_s']:.1f}",
                        f"{run['page_ms']:.1f} ms",
                        f"{run['service_cpu_ms']:.1f} ms",
                        f"{1000 / (run['page_ms'] + run['service_cpu_ms']):.0f} a second",
                        f"{calls:.0f}",
                        f"{run['instanced_frame']:.0f}, of {run['copies_frame']:.0f} copies",
                    ]
                    sheet.add(cells, **run)
            browser.close()
    sheet.keep()


if __name__ == "__main__":
    main()
