"""Answers that are kept: the same bytes, the same headers, never those of an old generation, never too many."""

from __future__ import annotations

import httpx
import pytest

from service.shapes.answers import Answer, Answers
from store.store import Store

from ._asking import until
from .conftest import QUERY, SHAPE, build, client_of

KEPT = "kept;desc=answered-before"


def test_who_asks_again_gets_the_same(own: Store) -> None:
    with client_of(own.root) as client, client_of(own.root, cache_bytes=0) as forgetful:
        query = {**QUERY, "format": "points"}
        first, again, other = client.get(SHAPE, params=query), client.get(SHAPE, params=query), forgetful.get
        assert "lookup;dur" in first.headers["server-timing"]
        assert again.headers["server-timing"] == KEPT
        assert again.content == first.content == other(SHAPE, params=query).content
        assert "lookup;dur" in other(SHAPE, params=query).headers["server-timing"]
        own_way = {"x-request-id", "server-timing", "date"}
        told = [{k: v for k, v in answer.headers.items() if k not in own_way} for answer in (first, again)]
        assert told[0] == told[1]
        # other words for the same question, and the tag of it
        assert client.get(SHAPE, params={**query, "te": "0.0300"}).headers["server-timing"] == KEPT
        known = client.get(SHAPE, params=query, headers={"If-None-Match": first.headers["etag"]})
        assert (known.status_code, known.content, known.headers["etag"]) == (304, b"", first.headers["etag"])
        head = client.head(SHAPE, params=query)
        assert head.content == b""
        assert head.headers["content-length"] == str(len(first.content))


@pytest.mark.parametrize("kind", ["npz", "json"])
def test_whoever_takes_any_tag_has_what_is_there_and_not_what_is_refused(own: Store, kind: str) -> None:
    anything = {"If-None-Match": "*"}
    with client_of(own.root) as client:
        query = {**QUERY, "format": kind}
        for _ in range(2):  # looked up, then kept
            answer = client.get(SHAPE, params=query, headers=anything)
            assert (answer.status_code, answer.content) == (304, b"")
            assert answer.headers["etag"] == client.get(SHAPE, params=query).headers["etag"]
        for wrong in ({"max_error": "0.0000001"}, {"te": "9"}):
            assert client.get(SHAPE, params={**query, **wrong}, headers=anything).status_code == 422
        page = client.get("/", headers={"Accept": "text/html", **anything})
        assert page.status_code == 304


def test_the_accept_header_is_part_of_the_question(own: Store) -> None:
    with client_of(own.root) as client:
        for kind in ("model/gltf-binary", "application/x-npz", "model/gltf-binary", "application/x-npz"):
            assert client.get(SHAPE, params=QUERY, headers={"Accept": kind}).headers["content-type"] == kind


def test_a_new_generation_is_not_answered_with_an_old_shape(own: Store) -> None:
    with client_of(own.root, reload_interval=0) as client:
        query = {**QUERY, "format": "npz"}
        old = [client.get(SHAPE, params=query) for _ in range(2)][1]
        assert old.headers["server-timing"] == KEPT
        build(own, resolution=8)
        until(lambda: client.get(SHAPE, params=query).headers["etag"] != old.headers["etag"])
        new = client.get(SHAPE, params=query)
        assert new.content != old.content


def test_kept_answers_need_the_token_too(own: Store) -> None:
    with client_of(own.root, public_read=False) as client:
        answer: httpx.Response = client.get(SHAPE, params={**QUERY, "format": "npz"})
        assert answer.status_code == 401


@pytest.mark.parametrize("room", [0, 1000, 10_000])
def test_no_more_is_kept_than_there_is_room_for(room: int) -> None:
    answers = Answers(room)
    for i in range(100):
        answers.keep(Answer(f'"{i}"', (), bytes(200)))
        assert answers.held == 200 * len(answers) <= room
    answers.keep(Answer('"large"', (), bytes(5000)))
    assert answers.get('"large"') is None
    assert (answers.get('"99"') is not None) == (room > 0)
    assert answers.get('"0"') is None
