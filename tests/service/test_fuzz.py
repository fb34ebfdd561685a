"""The OpenAPI page taken at its word: what it allows and what it forbids is sent, and no answer breaks it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from service.app import create_app
from service.settings import Settings
from store.store import Store
from store.tokens import Tokens

from ..store.conftest import fill
from .conftest import AXES, build, served

#: Not checked is whether all that the page allows is accepted: numbers that are fine one by one may make no fruit, or
#: lie off the table, and no schema can say that.
CHECKS = (
    "not_a_server_error",
    "status_code_conformance",
    "content_type_conformance",
    "response_headers_conformance",
    "response_schema_conformance",
    "negative_data_rejection",
    "unsupported_method",
    "ignored_auth",
)


#: What refuses a question: a list longer than the page allows may make a query longer than any may be, and a scene's
#: individuals are counted before they are looked at.
REFUSED = ["400", "401", "403", "404", "405", "406", "409", "413", "414", "415", "422", "428", "429", "5xx"]


def fuzz(
    store: Store, folder: Path, *options: str, examples: int = 60, phases: str = "coverage,fuzzing", more: str = ""
) -> None:
    """Send what the page of a service over a store allows and forbids."""
    (folder / "schemathesis.toml").write_text(
        f"{more}[checks.negative_data_rejection]\nexpected-statuses = {REFUSED}\n"
    )
    secret = Tokens(store.root).create("fuzz", ["run"])[1]
    many = {"max_jobs": 10**6, "max_jobs_per_token": 10**6}
    # its jobs stay in the queue
    app = create_app(Settings(store=store.root, jobs_workers=0, max_resolution=64, **many))
    with served(app) as client:
        command = [sys.executable, "-m", "schemathesis.cli", "run", f"{client.base_url}/openapi.json"]
        command += ["--header", f"Authorization: Bearer {secret}", "--checks", ",".join(CHECKS)]
        command += ["--max-examples", str(examples), "--phases", phases]
        # bodies that are meshes alone are not made up: tests/service/test_meshes_sent.py sends them
        command += ["--exclude-path", "/v1/meshes"]
        command += ["--continue-on-failure", "--seed", "1", "--no-color", *options]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    print(done.stdout)
    assert done.returncode == 0, done.stdout[-20000:] + done.stderr


@pytest.fixture
def store(tmp_path: Path) -> Store:
    store = Store.open(tmp_path / "store", create=True)
    fill(store, **AXES)
    build(store)
    return store


def test_three_hundred_answers_are_as_the_page_says(store: Store, tmp_path: Path) -> None:
    """Some twenty questions to each operation whose answers end: the quick part of what follows."""
    fuzz(store, tmp_path, "--exclude-path-regex", "events$", examples=24, phases="fuzzing")


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_every_answer_is_as_the_page_says(store: Store, tmp_path: Path) -> None:
    fuzz(store, tmp_path)


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_so_are_results_in_every_format(store: Store, tmp_path: Path) -> None:
    """The id of a job that is done, which nobody would guess."""
    key = store.ledger.jobs("done")[0].key
    parameters = f'[parameters]\n"path.id" = "{key}"\n'
    fuzz(store, tmp_path, "--include-path-regex", "jobs/.*id", examples=200, more=parameters)
