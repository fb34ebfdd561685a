"""Answers on the wire: which coding, under which tag, and what a page from elsewhere may read."""

from __future__ import annotations

import gzip
from collections.abc import Iterator
from pathlib import Path

import brotli
import httpx
import pytest
import zstandard
from pydantic import ValidationError

from service import coding
from service.formats import FORMATS
from service.sequences import EXPORTS
from service.settings import Settings

from .conftest import QUERY, SHAPE, client_of

UNPACK = {
    "gzip": gzip.decompress,
    "br": brotli.decompress,
    "zstd": lambda b: zstandard.ZstdDecompressor().decompressobj().decompress(b),
}


@pytest.fixture(scope="module")
def client(built: Path) -> Iterator[httpx.Client]:
    with client_of(built, compress="always", cors_origins="https://a.example, https://b.example:8443") as client:
        yield client


def raw(client: httpx.Client, coding: str, **headers: str) -> tuple[httpx.Response, bytes]:
    """Return an answer and its body as it was on the wire."""
    words = {"Accept-Encoding": coding, **headers}
    with client.stream("GET", SHAPE, params={**QUERY, "format": "obj"}, headers=words) as answer:
        return answer, b"".join(answer.iter_raw())


@pytest.mark.parametrize("name", UNPACK)
def test_a_coded_answer_is_the_plain_one_under_another_tag(client: httpx.Client, name: str) -> None:
    plain, body = raw(client, "identity")
    assert "content-encoding" not in plain.headers
    for _ in range(2):  # the second time the answer comes from those kept
        answer, packed = raw(client, name)
        assert answer.headers["content-encoding"] == name
        assert "accept-encoding" in answer.headers["vary"].lower()
        assert UNPACK[name](packed) == body
        assert len(packed) < 0.6 * len(body)
        tag = answer.headers["etag"]
        assert tag == f'{plain.headers["etag"][:-1]}-{name}"'
    again, nothing = raw(client, name, **{"If-None-Match": f'"other", {tag}'})
    assert (again.status_code, nothing, again.headers["etag"]) == (304, b"", tag)
    assert again.headers["vary"] == answer.headers["vary"]
    # the same shape, whichever coding it came in
    assert raw(client, "identity", **{"If-None-Match": tag})[0].status_code == 304
    assert raw(client, name, **{"If-None-Match": '"other-gzip"'})[0].status_code == 200


def test_every_format_is_compressed_or_packed_already() -> None:
    known = {each.media_type.partition(";")[0] for each in (*FORMATS.values(), *EXPORTS.values())}
    packed = {"application/zip", "application/x-npz", "model/vnd.usdc", "model/vnd.usdz+zip"}
    packed.add("application/vnd.wizen.points")
    packed |= {"image/png", "image/x-exr"}
    assert known - packed <= {"application/json", *coding._TYPES}
    assert set(coding._TYPES) <= known | {"application/x-ndjson"}  # of batches
    assert not packed & set(coding._TYPES)


def test_refused_codings_are_not_used(client: httpx.Client) -> None:
    assert "content-encoding" not in raw(client, "gzip;q=0, deflate")[0].headers
    assert raw(client, "gzip, br, zstd")[0].headers["content-encoding"] == "zstd"


def test_clients_on_this_machine_get_plain_bytes_unless_told_otherwise(built: Path) -> None:
    for compress in ("elsewhere", "off"):
        with client_of(built, compress=compress) as client:
            assert "content-encoding" not in raw(client, "gzip")[0].headers


def test_a_page_from_a_listed_origin_may_ask_and_read(client: httpx.Client) -> None:
    for origin, may in (("https://a.example", True), ("https://b.example:8443", True), ("https://c.example", False)):
        asked = {
            "Origin": origin,
            "Access-Control-Request-Method": "GET",
            "Access-Control-Request-Headers": "Authorization",
        }
        before = client.options(SHAPE, headers=asked)
        assert (before.status_code == 200) is may
        answer = client.get(SHAPE, params=QUERY, headers={"Origin": origin})
        assert answer.headers.get("access-control-allow-origin") == (origin if may else None)
    answer = client.get(SHAPE, params=QUERY, headers={"Origin": "https://a.example"})
    shown = {name.strip().lower() for name in answer.headers["access-control-expose-headers"].split(",")}
    assert {"etag", "content-disposition", *(name for name in answer.headers if name.startswith("wizen-"))} <= shown
    assert "wizen-tier" in answer.headers


def test_no_page_from_elsewhere_may_by_default(built: Path) -> None:
    with client_of(built) as client:
        answer = client.get(SHAPE, params=QUERY, headers={"Origin": "https://a.example"})
        assert "access-control-allow-origin" not in answer.headers


@pytest.mark.parametrize("wrong", ["a.example", "https://a.example/path", "ftp://a.example"])
def test_what_is_no_origin_is_refused_with_an_example(wrong: str) -> None:
    with pytest.raises(ValidationError, match="is no origin: write scheme, host and port"):
        Settings(cors_origins=wrong)


def test_origins_come_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WIZEN_CORS_ORIGINS", "https://a.example,*")
    assert Settings().cors_origins == ("https://a.example", "*")
