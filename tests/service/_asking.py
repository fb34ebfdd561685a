"""What tests ask of a service: a problem as promised, and patience until something has happened."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import httpx

from service import problems

ROOT = Path(__file__).resolve().parents[2]


def checked(answer: httpx.Response, status: int, code: str) -> dict:
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    problems.Problem.model_validate(problem)
    assert (problem["status"], problem["type"]) == (status, f"urn:wizen:problem:{code}")
    assert problem["request_id"] == answer.headers["x-request-id"]
    assert "Traceback" not in answer.text
    return problem


def until(happened: Callable[[], bool], seconds: float = 60) -> None:
    deadline = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.02)


def answers(client: httpx.Client) -> bool:
    try:
        return client.get("/").status_code == 200
    except httpx.TransportError:
        return False
