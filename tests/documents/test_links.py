"""What documents and help texts name is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXTS = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("s*/**/cli*.py"), *ROOT.glob("examples/**/*.toml")]


@pytest.mark.parametrize("text", TEXTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_named_files_exist(text: Path) -> None:
    words = text.read_text()
    links = re.findall(r"\]\((?!https?:)([\w/.-]+)\)", words) if text.suffix == ".md" else []
    plans = [ROOT / name for name in re.findall(r"\bexamples/[\w/.-]+\.(?:toml|py)\b", words)]
    modules = [ROOT / name.replace(".", "/") for name in re.findall(r"python -m (benchmarks[.\w]*\w)", words)]
    missing = [path for path in [*(text.parent / link for link in links), *plans] if not path.exists()]
    missing += [path for path in modules if not (path.is_dir() or path.with_suffix(".py").exists())]
    assert not missing
