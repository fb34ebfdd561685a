"""The command line, called in this process."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from typer.testing import CliRunner, Result

from service.cli import app

Write = Callable[..., Path]

ROOT = Path(__file__).parents[2]


def wizen(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


def document(result: Result) -> Any:
    """The one JSON document on stdout, which must hold nothing else."""
    assert result.stdout.strip(), result.output
    return json.loads(result.stdout)
