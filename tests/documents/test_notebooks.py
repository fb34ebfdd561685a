"""The notebooks run as they stand, and end in a picture."""

from __future__ import annotations

import base64
import io
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ._blocks import ROOT

NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))


def test_there_are_some() -> None:
    assert {path.stem for path in NOTEBOOKS} == {"batch", "decay", "map", "refine", "scene"}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_nothing_that_was_run_is_kept(path: Path) -> None:
    """Outputs are of one machine and one day: whoever runs the notebook sees his own."""
    code = [cell for cell in json.loads(path.read_text())["cells"] if cell["cell_type"] == "code"]
    assert not any(cell["outputs"] or cell["execution_count"] for cell in code)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_runs_and_ends_in_a_picture(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nbclient = pytest.importorskip("nbclient", reason="pip install -e '.[notebooks]'")
    nbformat = pytest.importorskip("nbformat")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    page = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(page, timeout=1800, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = page.cells[-1]["outputs"]
    pictures = [output["data"]["image/png"] for output in outputs if "image/png" in output.get("data", {})]
    assert pictures, outputs
    with Image.open(io.BytesIO(base64.b64decode(pictures[-1]))) as picture:
        picture.save(tmp_path / f"{path.stem}.png")
        grey = np.asarray(picture.convert("L"))
    # something is drawn, and not a single flat colour
    assert min(grey.shape) > 150
    assert grey.std() > 8
