"""What an operator sees: one record per request, ids, and counts per route."""

from __future__ import annotations

import logging
import re
import time
from pathlib import Path

import httpx
import pytest

from .conftest import QUERY, SHAPE, client_of


def test_every_request_is_logged_once(client: httpx.Client, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "wizen.service"):
        answer = client.get(SHAPE, params=QUERY)
        # the server writes it once the answer is on its way
        deadline = time.monotonic() + 60
        while not any(r.name == "wizen.service" for r in caplog.records) and time.monotonic() < deadline:
            time.sleep(0.01)
    (record,) = [r for r in caplog.records if r.name == "wizen.service"]
    assert record.request_id == answer.headers["x-request-id"]  # type: ignore[attr-defined]
    assert record.route == "/v1/shapes/{solver}"  # type: ignore[attr-defined]
    assert (record.method, record.status) == ("GET", 200)  # type: ignore[attr-defined]
    assert record.bytes == len(answer.content)  # type: ignore[attr-defined]
    assert re.search(r"GET '/v1/shapes/dehydration' 200 \d+\.\d ms", record.getMessage())


@pytest.mark.parametrize("given", ["", "a" * 65, "two words", "x;y"])
def test_dishonest_ids_are_replaced(client: httpx.Client, given: str) -> None:
    answer = client.get("/", headers={"X-Request-ID": given})
    assert re.fullmatch("[0-9a-f]{32}", answer.headers["x-request-id"])


def test_metrics_count_routes_not_paths(built: Path) -> None:
    with client_of(built) as client:
        for path in ("/v1/tables/a", "/v1/tables/b", "/nothing"):
            client.get(path)
        client.head("/")
        text = client.get("/metrics").text
    assert 'wizen_requests_total{method="GET",route="/v1/tables/{name}",status="404"} 2.0' in text
    assert 'wizen_requests_total{method="GET",route="none",status="404"} 1.0' in text
    assert 'wizen_requests_total{method="HEAD",route="/",status="200"} 1.0' in text
    assert "wizen_request_seconds_bucket" in text


def test_metrics_can_be_left_out(built: Path) -> None:
    with client_of(built, metrics=False) as client:
        assert client.get("/metrics").status_code == 404
