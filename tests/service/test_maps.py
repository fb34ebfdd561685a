"""Maps of a result's fields, read back by readers that are not ours."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import numpy as np
import OpenEXR
import png
import pytest
from PIL import Image
from scipy.special import sph_harm_y

from service.errors import InvalidQuery, UnfitFormat
from service.sequences.bake import baked
from solver.fruit import lattice

from ._runs import made, rotting, shrinking, splitting


def test_a_map_lies_where_its_field_lies() -> None:
    """Real spherical harmonics have a value everywhere: bilinear reaches it in second order, over poles and seam."""
    size, errors = 96, []
    theta, phi = np.meshgrid(*((np.arange(size) + 0.5) / size * top for top in (np.pi, 2 * np.pi)), indexing="ij")
    for n in (16, 32, 64):
        field = sph_harm_y(5, 3, *lattice(n)).real
        errors.append(np.abs(baked(field, size) - sph_harm_y(5, 3, theta, phi).real).max())
    assert errors[-1] < 3e-3
    assert np.log2(errors[0] / errors[2]) / 2 == pytest.approx(2, abs=0.3)


def test_png_is_sixteen_bits_and_says_its_range() -> None:
    data = made(rotting(16), "png", map="rot", size=40)
    width, height, rows, info = png.Reader(bytes=data).read()
    assert (width, height, info["bitdepth"], info["greyscale"]) == (40, 40, 16, True)
    levels = np.vstack([np.frombuffer(row, np.uint16) for row in map(bytes, rows)])
    assert np.abs(levels / 65535 - baked(rotting(16)["rot"].values[2], 40)).max() < 1e-5
    said = json.loads(Image.open(io.BytesIO(data)).text["wizen"])
    assert (said["low"], said["high"], said["field"], said["stage"]) == (0, 1, "rot", 5.0)
    other = made(rotting(16), "png", map="rot", size=40, low=0.5, high=0.75)
    assert np.asarray(Image.open(io.BytesIO(other))).max() == 65535
    with pytest.raises(InvalidQuery, match="not above"):
        made(rotting(16), "png", low=1, high=0)
    with pytest.raises(InvalidQuery, match="no field"):
        made(rotting(16), "png", map="moss")


def test_exr_holds_the_values_themselves(tmp_path: Path) -> None:
    path = tmp_path / "maps.exr"
    path.write_bytes(made(rotting(16), "exr", size=48, stage=2.0))
    with OpenEXR.File(str(path)) as file:
        channels = file.channels()
        assert set(channels) == {"rot", "mould", "mould_active"}
        assert np.array_equal(channels["rot"].pixels, baked(rotting(16)["rot"].values[1], 48))


def test_one_call_gives_a_set_of_maps_per_stage_at_a_size_of_its_own() -> None:
    run = rotting(16)
    archive = zipfile.ZipFile(io.BytesIO(made(run, "png-zip", size=40)))
    said = json.loads(archive.read("stages.json"))
    fields = ["rot", "mould", "mould_active"]
    assert sorted(said["fields"]) == sorted(fields)
    assert list(said["files"].values()) == run["stage"].values.tolist()
    assert len(archive.namelist()) == 1 + len(fields) * run.sizes["stage"]
    for number, (folder, stage) in enumerate(said["files"].items()):
        for name in fields:
            data = archive.read(f"{folder}/{name}.png")
            width, height, rows, info = png.Reader(bytes=data).read()
            assert (width, height, info["bitdepth"]) == (40, 40, 16)
            levels = np.vstack([np.frombuffer(row, np.uint16) for row in map(bytes, rows)])
            assert np.abs(levels / 65535 - baked(run[name].values[number], 40)).max() < 1e-5
            assert json.loads(Image.open(io.BytesIO(data)).text["wizen"])["stage"] == stage
    only = zipfile.ZipFile(io.BytesIO(made(run, "png-zip", size=8, map="rot")))
    assert len(only.namelist()) == 1 + run.sizes["stage"]
    with pytest.raises(InvalidQuery, match="no field"):
        made(run, "png-zip", map="moss")


def test_what_is_no_share_has_one_range_for_all_stages() -> None:
    run = rotting(16)
    grown = run["rot"] * (1 + np.arange(run.sizes["stage"]))[:, None, None]
    run = run.drop_vars(["rot", "mould", "mould_active"]).assign(roughness=grown)
    archive = zipfile.ZipFile(io.BytesIO(made(run, "png-zip", size=16)))
    tops = [np.asarray(Image.open(archive.open(n))).max() for n in sorted(archive.namelist()) if n.endswith("png")]
    assert tops[0] < tops[1] < tops[2] <= 65535


@pytest.mark.parametrize("most", [1.0, 1.3])
def test_a_share_that_goes_beyond_one_is_not_cut_off(most: float) -> None:
    """Fresh nutrient is uneven about 1; the range is that of all stages, and still begins at 0."""
    run = rotting(16)
    values = 0.2 + (most - 0.2) * run["rot"] / float(run["rot"].max())
    run = run.drop_vars(["rot", "mould", "mould_active"]).assign(nutrient=values)
    archive = zipfile.ZipFile(io.BytesIO(made(run, "png-zip", size=40)))
    for number in range(run.sizes["stage"]):
        data = archive.read(f"stage_{number + 1:04d}/nutrient.png")
        said = json.loads(Image.open(io.BytesIO(data)).text["wizen"])
        assert (said["low"], said["high"]) == (0, pytest.approx(most, rel=1e-6))
        levels = np.asarray(Image.open(io.BytesIO(data)))
        wanted = baked(run["nutrient"].values[number], 40)
        assert np.abs(levels / 65535 * said["high"] - wanted).max() < 1e-5 * most


@pytest.mark.parametrize("name", ["png", "png-zip", "exr"])
def test_maps_need_texture_coordinates_and_a_field(name: str) -> None:
    with pytest.raises(UnfitFormat, match="triangles that stay"):
        made(splitting(), name)
    with pytest.raises(UnfitFormat, match="no field"):
        made(shrinking(), name)
