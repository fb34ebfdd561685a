"""An environment that sees what the tests' one has installed, wizen itself left out: nothing is fetched."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).parents[2]
FLOORS = ("solver", "store", "sweeps", "service")

_BUILD = """
import sys
from setuptools import build_meta
print(getattr(build_meta, sys.argv[1])(sys.argv[2]))
"""


def copied(to: Path) -> Path:
    """Copy what the wheel is built from: as a person's checkout holds it, without what earlier builds left."""
    skipped = shutil.ignore_patterns("__pycache__", "node_modules", "*.egg-info")
    for name in FLOORS:
        shutil.copytree(ROOT / name, to / name, ignore=skipped)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, to / name)
    return to


def built(tree: Path, to: Path, kind: str = "build_wheel") -> Path:
    """Build the wheel of a tree, or with `build_editable` the one that points at it."""
    to.mkdir(parents=True, exist_ok=True)
    made = subprocess.run(
        [sys.executable, "-P", "-c", _BUILD, kind, str(to)], cwd=tree, capture_output=True, text=True, check=False
    )
    assert made.returncode == 0, made.stdout + made.stderr
    return to / made.stdout.splitlines()[-1]


class Environment:
    """A virtual environment with one wheel in it."""

    def __init__(self, at: Path, wheel: Path) -> None:
        venv.create(at, with_pip=False, symlinks=True)
        self.bin = at / "bin"
        self.packages = next(at.glob("lib/python*/site-packages"))
        # paths in a .pth are not searched for further .pth files, so that an editable wizen in them stays unseen
        others = [path for path in sys.path if Path(path).name in ("site-packages", "dist-packages")]
        (self.packages / "others.pth").write_text("\n".join(others) + "\n", encoding="utf-8")
        pip = [sys.executable, "-m", "pip", "--python", str(self.bin / "python"), "install", "--quiet"]
        options = ["--no-index", "--no-deps", "--ignore-installed", "--disable-pip-version-check"]
        done = subprocess.run([*pip, *options, str(wheel)], cwd=at, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr

    @staticmethod
    def variables() -> dict[str, str]:
        """Return our variables without those that would lead a command to another wizen."""
        return {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "WIZEN_"))}

    def run(self, *words: str, cwd: Path, **variables: str) -> subprocess.CompletedProcess[str]:
        """Run a command of the environment: `python` or `wizen`."""
        return subprocess.run(
            [str(self.bin / words[0]), *words[1:]],
            cwd=cwd,
            env=self.variables() | variables,
            capture_output=True,
            text=True,
            check=False,
            timeout=240,
        )
