"""Pictures as painted maps."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from solver import registry
from solver.painted import painted
from sweeps.commands.terminal.options import assignments, parameters
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


@pytest.mark.parametrize("size", [(4, 2), (16, 8), (512, 256)])
def test_a_pictures_left_edge_lies_at_x(size: tuple[int, int], tmp_path: Path) -> None:
    """White from the left edge half-way around: the middle of that is a quarter turn on, whatever the size."""
    wide, tall = size
    pixels = np.zeros((tall, wide), np.uint8)
    pixels[:, : wide // 2] = 255
    Image.fromarray(pixels).save(tmp_path / "half.png")
    rows = np.array(assignments([f"light_map=@{tmp_path}/half.png"])["light_map"])
    turns = 2 * np.pi * np.arange(rows.shape[1]) / rows.shape[1]
    middle = np.rad2deg(np.angle((rows.mean(axis=0) * np.exp(1j * turns)).sum()))
    assert middle == pytest.approx(90, abs=1e-3)


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


def laid_out(folder: Path, name: str) -> np.ndarray:
    """Return what a params file in a folder has for a texture of a picture."""
    (folder / "leaf.toml").write_text(f'[[ribs]]\nwhere = {{kind = "texture", picture = "@{name}"}}\n')
    return np.array(parameters(folder / "leaf.toml")["ribs"][0]["where"]["picture"])


def test_a_texture_is_the_picture_as_it_is_with_all_its_bits(tmp_path: Path) -> None:
    """Sixteen bits, the first row on top, its own shape; read as a map it keeps them too."""
    levels = np.linspace(0, 65535, 15).astype(np.uint16).reshape(3, 5)
    Image.fromarray(levels).save(tmp_path / "deep.png")
    found = laid_out(tmp_path, "deep.png")
    assert np.abs(found - levels / 65535).max() < 6e-7
    wide = np.repeat(levels[:, :1], 6, axis=1)
    Image.fromarray(wide).save(tmp_path / "map.png")
    rows = assignments([f"light_map=@{tmp_path}/map.png"])["light_map"]
    assert np.abs(np.array(rows) - wide / 65535).max() < 6e-7
    Image.fromarray((levels >> 8).astype(np.uint8)).save(tmp_path / "flat.png")
    assert np.abs(laid_out(tmp_path, "flat.png") - (levels >> 8) / 255).max() < 6e-5


def test_a_large_picture_is_averaged(tmp_path: Path) -> None:
    levels = (np.random.default_rng(0).random((512, 1024)) * 65535).astype(np.uint16)
    Image.fromarray(levels).save(tmp_path / "large.png")
    mean = levels.reshape(256, 2, 512, 2).mean(axis=(1, 3)) / 65535
    assert np.abs(laid_out(tmp_path, "large.png") - mean).max() < 6e-7


def exr(path: Path, **channels: np.ndarray) -> None:
    OpenEXR = pytest.importorskip("OpenEXR")
    head = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(head, {name: values.astype(np.float32) for name, values in channels.items()}) as file:
        file.write(str(path))


def test_a_texture_may_be_the_one_channel_of_an_exr_picture(tmp_path: Path) -> None:
    values = np.random.default_rng(1).random((4, 7))
    exr(tmp_path / "rot.exr", rot=values)
    assert np.abs(laid_out(tmp_path, "rot.exr") - values).max() < 6e-7
    exr(tmp_path / "both.exr", rot=values, mould=values)
    with pytest.raises(InvalidOption, match=r"channels.*mould.*a texture has one") as told:
        laid_out(tmp_path, "both.exr")
    assert "--map NAME" in told.value.advice
    exr(tmp_path / "warm.exr", temperature=20 + values)
    with pytest.raises(InvalidOption, match=r"temperature goes from 20\.\d+ to 2") as told:
        laid_out(tmp_path, "warm.exr")
    assert "--low" in told.value.advice
    exr(tmp_path / "nan.exr", rot=np.full((4, 4), np.nan))
    (tmp_path / "none.exr").write_bytes(b"no picture")
    for name in ("nan.exr", "none.exr", "absent.exr"):
        with pytest.raises(InvalidOption, match=name):
            laid_out(tmp_path, name)
