"""What operators are given: files that their programs read, and that speak of what there is."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
import yaml
from prometheus_client import generate_latest
from typer.main import get_command

from service.cli import app
from service.settings import Settings
from service.telemetry import Metrics

DEPLOY = Path(__file__).parents[2] / "deploy"
FILES = sorted(path for path in DEPLOY.rglob("*") if path.is_file())
VARIABLES = {f"WIZEN_{name.upper()}" for name in Settings.model_fields} | {"WIZEN_SITE"}


@pytest.mark.parametrize("path", [*FILES, DEPLOY.parent / "docs" / "operating.md"], ids=lambda path: path.name)
def test_only_settings_that_there_are(path: Path) -> None:
    named = set(re.findall(r"\bWIZEN_[A-Z_]+\b", path.read_text()))
    assert named <= VARIABLES, named - VARIABLES


def test_only_commands_that_there_are() -> None:
    known = set(get_command(app).commands)  # type: ignore[attr-defined]
    said = (DEPLOY.parent / "docs" / "operating.md").read_text() + (DEPLOY / "wizen.service").read_text()
    assert set(re.findall(r"(?:`|/)wizen ([a-z]+)", said)) <= known
    compose = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
    assert compose["services"]["worker"]["command"][0] in known
    entry = re.search(r'^CMD \["(\w+)"\]$', (DEPLOY / "Dockerfile").read_text(), re.M)
    assert entry is not None
    assert entry[1] in known


def test_the_board_asks_for_metrics_that_there_are() -> None:
    metrics = Metrics()
    metrics.requests.labels("/", "GET", "200").inc()
    metrics.seconds.labels("/").observe(1)
    metrics.jobs.labels("done").set(1)
    there = set(re.findall(r"^(wizen_\w+)", generate_latest(metrics.registry).decode(), re.M))
    board = json.loads((DEPLOY / "grafana" / "wizen.json").read_text())
    asked = {
        name
        for panel in board["panels"]
        for target in panel["targets"]
        for name in re.findall(r"\bwizen_\w+", target["expr"])
    }
    assert asked
    assert asked <= there
    assert {"requests", "jobs"} <= {panel["title"].split()[0].lower() for panel in board["panels"]}


def test_yaml_is_yaml_and_volumes_are_mounted_from_files_that_there_are() -> None:
    for path in FILES:
        if path.suffix in (".yaml", ".yml"):
            yaml.safe_load(path.read_text())
    compose = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
    for service in compose["services"].values():
        for volume in service.get("volumes", ()):
            source = volume.split(":")[0]
            assert source in compose["volumes"] or (DEPLOY / source).is_file(), volume
    extras = tomllib.loads((DEPLOY.parent / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    (asked,) = re.findall(r"'\.\[([a-z,]+)\]'", (DEPLOY / "Dockerfile").read_text())
    assert set(asked.split(",")) <= set(extras)


@pytest.mark.parametrize(
    ("command", "file"),
    [
        ("systemd-analyze verify --man=no", "wizen-backup.timer"),
        ("caddy validate --adapter caddyfile --config", "Caddyfile"),
        ("hadolint", "Dockerfile"),
        ("docker-compose --file", "compose.yaml"),
    ],
    ids=lambda value: value.split()[0],
)
def test_their_own_programs_read_them(command: str, file: str) -> None:
    program = command.split()[0]
    if shutil.which(program) is None:
        pytest.skip(f"there is no {program} here")
    words = [*command.split(), str(DEPLOY / file), *(["config", "--quiet"] if program == "docker-compose" else [])]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
