"""What one worker makes of one job."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from conftest import Solves

from solver import registry
from solver.contract import Need
from store import starter
from store.ledger.jobs import JobSpec
from store.store import Store
from sweeps.running.work import Task, work


@pytest.mark.parametrize("other", ["0", "2", "1.0"])
def test_a_worker_of_another_version_refuses(shrinking: Solves, store: Store, other: str) -> None:
    """Before it computes anything: its numbers would stand under the key of others. Once more does not help."""
    solver = registry.get("shrinking")
    params, need = solver.parse({"te": 0.03}, "sphere"), solver.settle(Need(stages=(0.1,), quality="preview"))
    specs = [JobSpec.of(replace(solver, version=version), params, need) for version in (other, solver.version)]
    store.ledger.want(specs, "both")
    found = {}
    for spec in specs:
        job = store.ledger.claim("somebody", 60.0, [spec.key])
        assert job is not None
        found[spec.version] = work(Task(store.root, job, 60.0))
    refused, done = found[other], found[solver.version]
    assert (refused.state, refused.retry) == ("failed", False)
    assert refused.error is not None
    assert refused.error["code"] == "other-version"
    assert f"version {other}, this worker has 1" in refused.error["message"]
    assert done.state == "done"
    assert list(store.keys()) == [specs[1].key]
    assert len(shrinking) == 1


@pytest.mark.parametrize(("trouble", "again"), [("breaks", False), ("refuses", False), ("diverges", True)])
def test_what_would_come_out_the_same_is_not_tried_again(
    shrinking: Solves, store: Store, trouble: str, again: bool
) -> None:
    """A run that blew up gives the same bytes, and takes as long."""
    solver = registry.get("shrinking")
    params, need = solver.parse({"trouble": trouble}), solver.settle(Need(stages=(0.1,), quality="preview"))
    spec = JobSpec.of(solver, params, need)
    store.ledger.want([spec], "one")
    job = store.ledger.claim("somebody", 60.0, [spec.key])
    assert job is not None
    failed = work(Task(store.root, job, 60.0))
    assert (failed.state, failed.retry) == ("failed", again)


def test_what_comes_with_the_package_is_taken_over(
    shrinking: Solves, store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pattern just past its onset might come out otherwise on this processor."""
    solver, package = registry.get("shrinking"), Store.open(tmp_path / "package", create=True)
    params, need = solver.parse({"te": 0.03}, "sphere"), solver.settle(Need(stages=(0.1,), quality="preview"))
    spec = JobSpec.of(solver, params, need)
    package.put(spec.key, solver.solve(params, need))
    solved = len(shrinking)
    monkeypatch.setattr(starter, "ROOT", package.root)
    assert store.find(spec.key) is not None
    assert not store.has(spec.key)
    store.ledger.want([spec], "one")
    job = store.ledger.claim("somebody", 60.0, [spec.key])
    assert job is not None
    done = work(Task(store.root, job, 60.0))
    assert done.state == "done"
    assert store.get(spec.key).attrs["digest"] == done.digest == package.get(spec.key).attrs["digest"]
    assert len(shrinking) == solved
