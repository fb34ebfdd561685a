"""A real `wizen serve`, a real browser, and what a visit of a page saw."""

from __future__ import annotations

import io
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from matplotlib import image
from numpy.typing import NDArray

from service.page import BUILT

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

__all__ = ["CHROMIUM", "FLAGS", "MARKS", "ROOT", "Visit", "pixels", "serving"]

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
ROOT = BUILT.parents[2]

MARKS = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: apt-get install chromium"),
    pytest.mark.skipif(not (BUILT / "index.html").exists(), reason="the page is not built: make page"),
]


@contextmanager
def serving(data: Path, *options: str, **environment: str) -> Iterator[str]:
    """Run `wizen serve` with `data` as the user's data directory and return its address, or the studio's."""
    env = {**os.environ, "PYTHONPATH": str(ROOT), "XDG_DATA_HOME": str(data), **environment}
    env.pop("WIZEN_STORE", None)
    command = [sys.executable, "-m", "service.cli", "serve", "--port", "0", *options]
    wanted = r"http://\S+:\d+/#token=\S+$" if "--studio" in options else r"http://\S+:\d+$"
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=env, text=True) as server:
        try:
            assert server.stdout is not None
            for line in server.stdout:
                if found := re.search(wanted, line.strip()):
                    yield found[0]
                    break
            else:
                pytest.fail("the server did not say where it listens")
        finally:
            server.terminate()


class Visit:
    """A page, what its console said, and whom it asked."""

    def __init__(self, browser: Browser, **options: Any) -> None:
        self.page: Page = browser.new_page(**options)
        self.complaints: list[str] = []
        self.asked: list[str] = []
        self.page.on("console", lambda m: self.complaints.append(m.text) if m.type in ("error", "warning") else None)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))

    def shown(self, condition: str = "true", timeout: float = 180_000) -> dict[str, Any]:
        """Return what is shown as soon as it meets a condition on `shown`: n, the stage and the axes."""
        script = "() => { const t = document.getElementById('view').dataset.shown; if (!t) return false; "
        script += f"const shown = JSON.parse(t); return ({condition}) && t; }}"
        found: dict[str, Any] = json.loads(self.page.wait_for_function(script, timeout=timeout).json_value())
        return found

    def picture(self) -> bytes:
        """Return the canvas as drawn, two frames after now."""
        self.page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        return self.page.locator("#view").screenshot()

    def hosts(self) -> set[str]:
        """Return whom it asked."""
        return {urlsplit(url).netloc for url in self.asked if not url.startswith(("data:", "blob:"))}


def pixels(picture: bytes) -> NDArray[np.float32]:
    """Return a screenshot's colours (rows, columns, 3), 0 to 1."""
    return image.imread(io.BytesIO(picture))[..., :3]
