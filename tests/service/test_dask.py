"""`wizen serve --scheduler`: jobs run on the workers of a Dask cluster that was there before."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import httpx
import pytest

from store.store import Store

from ._asking import ROOT, answers, until
from ._jobs import bearer, body

pytestmark = [
    pytest.mark.slow,
    pytest.mark.usefixtures("shrinking"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning:distributed", "ignore::ResourceWarning"),
]


def test_jobs_run_on_a_dask_cluster(store: Store, log: Path) -> None:
    distributed = pytest.importorskip("distributed")
    # its workers are processes of their own, which take the environment as it is now
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, worker_dashboard_address=None
    ) as cluster:
        command = [sys.executable, "-m", "service.cli", "serve", "--store", str(store.root), "--port", "0"]
        command += ["--scheduler", cluster.scheduler_address]
        environment = {**os.environ, "WIZEN_JOBS_WORKERS": "0"}  # nobody else could run them
        running = subprocess.Popen(command, cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True)
        try:
            assert running.stderr is not None
            address = running.stderr.readline().split()[-1]
            with httpx.Client(base_url=address, headers=bearer(store), timeout=120) as client:
                until(lambda: answers(client))
                asked = [client.post("/v1/jobs", json=body(0.02 + 0.01 * i)) for i in range(4)]
                assert {answer.status_code for answer in asked} == {202}
                bad = client.post("/v1/jobs", json=body(0.08, trouble="refuses"))
                until(lambda: len(client.get("/v1/jobs?state=done").json()["jobs"]) == 4, 120)
                for answer in asked:
                    result = client.get(f"{answer.headers['location']}/result", params={"format": "glb"})
                    assert result.content[:4] == b"glTF"
                until(lambda: client.get(bad.headers["location"]).json()["state"] == "failed")
                assert "something else" in client.get(bad.headers["location"]).json()["problem"]["advice"]
        finally:
            running.send_signal(signal.SIGTERM)
            running.communicate(timeout=120)
    assert len(log.read_text().splitlines()) == 5
