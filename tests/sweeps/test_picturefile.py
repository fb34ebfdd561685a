"""Pictures as painted maps."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from solver import registry
from solver.painted import painted
from sweeps.commands.terminal.options import assignments
from sweeps.errors import InvalidOption


def test_a_picture_lies_around_the_body_as_maps_do(tmp_path: Path) -> None:
    """White at the top, dark below, a grey spot at z > 0: found there, whatever the picture's size."""
    pixels = np.zeros((180, 360), np.uint8)
    pixels[:20] = 255
    pixels[80:100, 70:110] = 128
    Image.fromarray(pixels).save(tmp_path / "a.png")
    rows = assignments([f"light_map=@{tmp_path}/a.png"])["light_map"]
    assert np.shape(rows) == (64, 128)
    assert np.mean(rows) == pytest.approx(pixels.mean() / 255, abs=1e-3)
    rays = np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [1, 0, 0]], float)
    assert painted(tuple(map(tuple, rows)), rays) == pytest.approx([1, 0, 128 / 255, 0, 0], abs=1e-3)
    params = registry.get("dehydration").parse({"light_map": rows})
    assert params.light_map.bright == 2  # type: ignore[attr-defined]


@pytest.mark.parametrize(("name", "data"), [("a.png", b"no picture"), ("b.jpg", b""), ("none.png", None)])
def test_what_is_no_picture_is_refused(name: str, data: bytes | None, tmp_path: Path) -> None:
    if data is not None:
        (tmp_path / name).write_bytes(data)
    with pytest.raises(InvalidOption, match=name):
        assignments([f"wound_map=@{tmp_path}/{name}"])


def test_a_picture_of_the_wrong_size_is_refused(tmp_path: Path) -> None:
    Image.new("L", (1, 40)).save(tmp_path / "thin.png")
    with pytest.raises(InvalidOption, match="1 x 40 pixels"):
        assignments([f"wound_map=@{tmp_path}/thin.png"])
