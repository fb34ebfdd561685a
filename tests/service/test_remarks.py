"""What is worth knowing before a run of growth or wood, at every door: command line, jobs and live sessions."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest
from typer.testing import CliRunner

from service.cli import app
from service.jobs import views
from solver import registry
from solver.growth.shapes import start
from store.ledger.queue import Queue
from store.store import Store

from ._asking import checked
from ._live import Served, live, one_service

__all__ = ["live", "one_service"]

AWAY: dict[str, Any] = {
    "shape": "square",
    "tools": [{"kind": "surface", "where": {"kind": "ball", "centre": [3, 3, 3], "radius": 0.5}}],
}
SAID = "tools[0] (ball) touches none of the"
NEED = {"stages": [0.05], "quality": "preview"}


def own(width: float) -> dict[str, Any]:
    mesh = start("sphere", 200, 1.0)
    return {"mesh": {"points": (mesh.x * width / 2).tolist(), "faces": mesh.triangles.tolist()}}


def test_the_command_line_says_it_before_work_and_with_the_result(tmp_path: Path) -> None:
    file = tmp_path / "away.json"
    file.write_text(json.dumps(AWAY))
    words = ["solve", "growth", "--params", str(file), "--quality", "preview", "--stages", "0.05"]
    found = CliRunner().invoke(app, words)
    assert found.exit_code == 0, found.output
    assert f"note: {SAID}" in found.stderr
    assert SAID in found.stdout
    told = CliRunner().invoke(app, [*words, "--json"])
    assert json.loads(told.stdout)["note"].startswith(SAID)


def test_a_job_says_it_at_once_and_a_list_of_jobs_does_not(queue_only: httpx.Client) -> None:
    asked = queue_only.post("/v1/jobs", json={"solver": "growth", "params": AWAY, "need": NEED})
    assert asked.status_code == 202
    assert asked.json()["note"].startswith(SAID)
    assert "take a finer quality" in asked.json()["note"]
    assert queue_only.get(asked.json()["links"]["self"]).json()["note"] == asked.json()["note"]
    assert [job["note"] for job in queue_only.get("/v1/jobs").json()["jobs"]] == [""]
    plain = queue_only.post("/v1/jobs", json={"solver": "growth", "params": {"shape": "square"}, "need": NEED})
    assert plain.json()["note"] == ""
    # of solvers that remark nothing there is nothing to say
    other = queue_only.post("/v1/jobs", json={"solver": "decay", "preset": "orange", "need": {"quality": "preview"}})
    assert other.json()["note"] == ""


@pytest.mark.parametrize(
    ("params", "detail", "advice"),
    [
        (own(1e-3), "scale it by 2000", ""),
        ({"tools": [{"kind": "surface", "where": {"kind": "rim", "width": 0.2}}]}, "no rim", "Start from a disc"),
        (
            {"shape": "disc", "tools": [{"kind": "surface", "where": {"kind": "painted", "values": [1.0, 0.5]}}]},
            "2 values are painted on",
            "Paint each vertex once",
        ),
    ],
)
def test_what_the_run_would_refuse_at_once_is_no_job(
    queue_only: httpx.Client, store: Store, params: dict[str, Any], detail: str, advice: str
) -> None:
    answer = queue_only.post("/v1/jobs", json={"solver": "growth", "params": params, "need": NEED})
    assert answer.status_code == 422
    problem = checked(answer, 422, answer.json()["type"].rpartition(":")[2])
    assert detail in problem["detail"]
    assert advice in problem.get("advice", "")
    assert Queue(store.ledger).waiting() == []


def test_a_mesh_in_millimetres_is_told_what_to_scale_it_by(queue_only: httpx.Client) -> None:
    asked = queue_only.post("/v1/jobs", json={"solver": "growth", "params": own(1000.0), "need": NEED})
    assert asked.status_code == 202
    assert "scale it by 0.002" in asked.json()["note"]


def test_a_session_says_what_its_tools_do_not_touch(live: Served) -> None:
    client = live.client({**AWAY, "step": 0.05})
    assert client.opened()["note"].startswith(SAID)
    between = [0.012, 0.007, 0.0]
    said = client.ask("brush", at=between, radius=0.003)
    assert said["say"] == "done"
    assert "touches no vertex, the nearest being 0.0071 away" in said["note"]
    assert "note" not in client.ask("brush", at=between, radius=0.3)
    spot = {"kind": "spot", "at": between, "radius": 0.003}
    assert "(spot) touches none" in client.ask("add", tool=spot)["note"]
    assert "note" not in client.ask("add", tool={**spot, "radius": 0.3})
    # of what starts later nobody knows yet
    assert "note" not in client.ask("add", tool={**spot, "start": 50.0})
    other = live.client({"shape": "square", "tools": [], "step": 0.05})
    assert "note" not in other.opened()


def test_what_is_said_of_a_job_is_found_out_once_and_not_for_lists(
    queue_only: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[Any] = []

    def remarks(params: Any, need: Any) -> str:
        told.append(params)
        return "Mind the step."

    growth = registry.get("growth")
    monkeypatch.setattr(registry, "get", lambda name: replace(growth, remarks=remarks))
    params = {"shape": "disc", "seed": 12345}
    asked = queue_only.post("/v1/jobs", json={"solver": "growth", "params": params, "need": NEED}).json()
    assert asked["note"] == "Mind the step."
    for _ in range(2):
        assert queue_only.get(asked["links"]["self"]).json()["note"] == "Mind the step."
    assert len(told) == 1
    # as another process of the service, which did not hear the question
    views._KNOWN.clear()
    [listed] = queue_only.get("/v1/jobs").json()["jobs"]
    assert listed["expected"] == asked["expected"]
    assert len(told) == 1
    assert queue_only.get(asked["links"]["self"]).json()["note"] == "Mind the step."
    assert queue_only.delete(asked["links"]["self"]).json()["note"] == "Mind the step."
    assert len(told) == 2


def test_a_wood_job_says_which_cuts_do_nothing_and_none_begins_with_a_grip_beside_it(queue_only: httpx.Client) -> None:
    plain = {"rods": 3, "vertices": 30}
    cuts = [{"low": [0.2, -1, -1], "high": [0.2, 1, 1]}]
    asked = queue_only.post("/v1/jobs", json={"solver": "wood", "params": {**plain, "cuts": cuts}, "need": NEED})
    assert asked.status_code == 202
    assert "cuts[0] meets nothing of the branch" in asked.json()["note"]
    grips = [{"low": [0.2, -1, -1], "high": [1, 1, 1]}]
    refused = queue_only.post("/v1/jobs", json={"solver": "wood", "params": {**plain, "grips": grips}, "need": NEED})
    problem = checked(refused, 422, "invalid-geometry")
    assert "grip 0 holds no vertex" in problem["detail"]
    assert "Move its box into the branch" in problem["advice"]
