"""The page over HTTP: who is shown it, how long it may be kept, what it may load, and what stands in for it unbuilt."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import httpx
import numpy as np
import pytest

from service import page
from service.formats import mesh, write

from ._shapes import ABOUT, HALF_AXES, ellipsoid, points, polyhedron_volume
from .conftest import QUERY, SHAPE, client_of

BROWSER = {"Accept": "text/html,application/xhtml+xml,application/xml;q=0.9,image/avif,image/webp,*/*;q=0.8"}
SOURCES = Path(page.__file__).parent / "viewer"


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A page as the build lays it out."""
    root = tmp_path / "dist"
    (root / "assets").mkdir(parents=True)
    (root / "index.html").write_text("<!doctype html><title>viewer</title>")
    (root / "docs.html").write_text("<!doctype html><title>docs</title>")
    (root / "assets" / "index-abc123.js").write_text("// a script\n" * 500)
    return root


def test_browsers_are_shown_the_page_and_programs_the_index(built: Path, site: Path) -> None:
    with client_of(built, page=site) as client:
        shown = client.get("/", headers=BROWSER)
        assert "viewer" in shown.text
        assert shown.headers["content-type"].startswith("text/html")
        for accept in ("*/*", "application/json"):
            index = client.get("/", headers={"Accept": accept})
            assert index.json()["name"] == "wizen"
        assert shown.headers["vary"] == index.headers["vary"] == "Accept"


def test_pages_are_asked_for_again_and_assets_never(built: Path, site: Path) -> None:
    with client_of(built, page=site) as client:
        first = client.get("/", headers=BROWSER)
        assert first.headers["cache-control"] == "no-cache"
        again = {**BROWSER, "If-None-Match": first.headers["etag"]}
        assert client.get("/", headers=again).status_code == 304
        (site / "index.html").write_text("<!doctype html><title>another build</title>")
        assert "another build" in client.get("/", headers=again).text
        asset = client.get("/assets/index-abc123.js")
        assert asset.headers["cache-control"] == "public, max-age=31536000, immutable"
        assert asset.headers["content-type"].startswith("text/javascript")
        assert asset.headers["content-encoding"] == "gzip"
        assert asset.headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize("name", ["none.js", "..%2Findex.html", "../docs.html", "%2e%2e/index.html"])
def test_what_is_no_asset_is_a_problem(built: Path, site: Path, name: str) -> None:
    with client_of(built, page=site) as client:
        missing = client.get(f"/assets/{name}")
        assert missing.status_code == 404
        assert missing.headers["content-type"] == "application/problem+json"
        assert missing.headers["cache-control"] == "no-store"


def test_nothing_may_come_from_elsewhere(built: Path, site: Path) -> None:
    with client_of(built, page=site) as client:
        for path in ("/", "/docs"):
            policy = client.get(path, headers=BROWSER).headers["content-security-policy"]
            rules = dict(rule.split(" ", 1) for rule in policy.split("; "))
            assert rules["default-src"] == "'none'"
            assert rules["script-src"] == rules["connect-src"] == "'self'"
            assert "http" not in policy
        assert client.get("/redoc").status_code == 404


def test_without_a_build_the_page_says_what_to_run(built: Path, tmp_path: Path) -> None:
    with client_of(built, page=tmp_path / "<none>") as client:
        for path in ("/", "/docs"):
            plain = client.get(path, headers=BROWSER)
            assert plain.status_code == 200
            assert "make page" in plain.text
            assert "&lt;none&gt;" in plain.text
            for link in re.findall('href="([^"]+)"', plain.text):
                assert client.get(f"/{link}").status_code == 200
        # the build may come after the service
        (tmp_path / "<none>").mkdir()
        (tmp_path / "<none>" / "index.html").write_text("built meanwhile")
        assert client.get("/", headers=BROWSER).text == "built meanwhile"


def test_sources_name_no_other_host_and_no_inline_code() -> None:
    class Reader(HTMLParser):
        def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            given = dict(attrs)
            for name in ("src", "href"):
                assert not (given.get(name) or "").startswith(("http:", "https:", "//", "data:"))
            assert "style" not in given
            assert tag != "script" or given.get("src")
            assert not any(name.startswith("on") for name in given)

    for source in ("index.html", "docs.html"):
        Reader().feed((SOURCES / source).read_text())
    scripts = list((SOURCES / "src").rglob("*.ts"))
    assert scripts
    for script in scripts:
        assert not re.search(r"https?://(?!www\.w3\.org/)|innerHTML|\beval\(", script.read_text()), script


def test_points_are_the_vertices_of_the_closed_mesh() -> None:
    blob = ellipsoid(16)
    data = write(blob, "points", ABOUT)
    assert data == write(blob, "points", ABOUT)
    about, found = points(data)
    assert about["weights"] == blob.weights
    a, b, c = found[mesh.triangles(16)].astype(float).transpose(1, 0, 2)
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    assert volume == pytest.approx(polyhedron_volume(16) * HALF_AXES.prod(), rel=1e-5)


def test_points_over_http_say_how_far_to_trust_them(client: httpx.Client) -> None:
    answer = client.get(SHAPE, params={**QUERY, "format": "points"})
    assert answer.headers["content-type"] == "application/vnd.wizen.points"
    about, found = points(answer.content)
    numbers = client.get(SHAPE, params={**QUERY, "format": "json"}).json()
    for name in ("exact", "converged", "nearest", "weights", "descriptors", "stage"):
        assert about[name] == numbers[name]
    assert np.isfinite(found).all()
    # the same question is answered by the same bytes, whatever the time it took
    assert client.get(SHAPE, params={**QUERY, "format": "points"}).content == answer.content
