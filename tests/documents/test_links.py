"""What documents and help texts name is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXTS = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("s*/**/cli*.py"), *ROOT.glob("examples/**/*.toml")]


#: Where a document may begin the path of a module: at the root, or in the room that it speaks of.
_ROOMS = (ROOT, *(path.parent for path in ROOT.glob("solver/*/__init__.py")))


@pytest.mark.parametrize("text", [path for path in TEXTS if path.suffix == ".md"], ids=lambda path: path.name)
def test_named_modules_exist(text: Path) -> None:
    words = text.read_text()
    files = re.findall(r"`([\w/]+\.(?:py|toml))`", words)
    missing = [name for name in files if not any((room / name).is_file() for room in (*_ROOMS, ROOT / "examples"))]
    dotted = re.findall(r"`((?:benchmarks|examples|tests)(?:\.\w+)+)", words)
    missing += [name for name in dotted if not any(ROOT.glob(name.replace(".", "/") + "*"))]
    assert not missing


@pytest.mark.parametrize("text", TEXTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_named_files_exist(text: Path) -> None:
    words = text.read_text()
    links = re.findall(r"\]\((?!https?:)([\w/.-]+)\)", words) if text.suffix == ".md" else []
    plans = [ROOT / name for name in re.findall(r"\bexamples/[\w/.-]+\.(?:toml|py)\b", words)]
    modules = [ROOT / name.replace(".", "/") for name in re.findall(r"python -m (benchmarks[.\w]*\w)", words)]
    missing = [path for path in [*(text.parent / link for link in links), *plans] if not path.exists()]
    missing += [path for path in modules if not (path.is_dir() or path.with_suffix(".py").exists())]
    assert not missing
