"""One question, one parse: whatever the format, the method, the size, and whether it is answered or refused."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from service.formats import FORMATS
from service.shapes import asking, detail

from .conftest import QUERY, SHAPE, client_of


class Counted:
    """Counts the readings of a query and of its level of detail."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.queries = self.details = 0
        parse, read = asking.parse, detail.read

        def counted_parse(*values: Any) -> Any:
            self.queries += 1
            return parse(*values)

        def counted_read(*values: Any) -> Any:
            self.details += 1
            return read(*values)

        patch.setattr(asking, "parse", counted_parse)
        patch.setattr(detail, "read", counted_read)


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Counted:
    return Counted(monkeypatch)


@pytest.fixture(scope="module")
def fresh(built: Path) -> Iterator[httpx.Client]:
    """A service that keeps no answers, so that every question is read."""
    with client_of(built, cache_bytes=0) as client:
        assert client.get(SHAPE, params=QUERY).status_code == 200  # from here on, the table is open
        yield client


@pytest.mark.parametrize("method", ["GET", "HEAD"])
@pytest.mark.parametrize("resolution", [16, 160])
@pytest.mark.parametrize("name", list(FORMATS))
def test_every_format_is_read_once(
    fresh: httpx.Client, counted: Counted, name: str, resolution: int, method: str
) -> None:
    answer = fresh.request(method, SHAPE, params={**QUERY, "resolution": resolution, "format": name})
    assert answer.status_code == 200, answer.text
    assert bool(answer.content) == (method == "GET")
    assert (counted.queries, counted.details) == (1, 1)


@pytest.mark.parametrize(
    ("change", "status"),
    [
        ({"te": "x"}, 422),
        ({"te": 9}, 422),
        ({"te": 9, "format": "glb"}, 422),
        ({"beauty": 1}, 422),
        ({"max_error": 0.0000001}, 422),
        ({"te": 9, "exact": "run"}, 401),
    ],
)
def test_what_is_refused_is_read_once(fresh: httpx.Client, counted: Counted, change: dict, status: int) -> None:
    assert fresh.get(SHAPE, params={**QUERY, **change}).status_code == status
    assert (counted.queries, counted.details) == (1, 1)


def test_a_validated_answer_is_read_once(fresh: httpx.Client, counted: Counted) -> None:
    tag = fresh.get(SHAPE, params={**QUERY, "format": "glb"}).headers["etag"]
    again = fresh.get(SHAPE, params={**QUERY, "format": "glb"}, headers={"If-None-Match": tag})
    assert again.status_code == 304
    assert counted.queries == 2  # one for each of the two


def test_the_first_question_opens_the_table_and_is_read_once(built: Path, counted: Counted) -> None:
    with client_of(built, cache_bytes=0) as client:
        assert client.get(SHAPE, params=QUERY).status_code == 200
    assert counted.queries == 1
