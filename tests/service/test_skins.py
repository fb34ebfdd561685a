"""A raisin is brown and a plum is purple, whichever way it leaves: pictures, GLB, USD, and runs that nobody named."""

from __future__ import annotations

import colorsys
import io
import zipfile
from pathlib import Path

import httpx
import numpy as np
import pytest
import xarray as xr
from PIL import Image
from pxr import Usd, UsdGeom, UsdShade
from typer.testing import CliRunner

from service.cli import app
from service.errors import UnfitFormat
from solver import registry
from store import starter
from sweeps import outputs
from sweeps.formats import Made
from sweeps.pictures.colours import encoded
from sweeps.pictures.render import View

from . import _materialx
from ._gltf import parsed
from ._runs import made, shrinking
from .conftest import client_of

FRUITS = ("raisin", "wolfberry", "jujube1", "jujube2", "plum1", "plum2")
#: Hues [degree] that a person would call such a fruit's, dried: brown to olive, orange red, brown red, purple.
HUES = {"raisin": (5, 60), "wolfberry": (5, 25), "jujube": (0, 20), "plum": (270, 330)}


def hue(linear: list[float] | np.ndarray) -> float:
    return 360 * colorsys.rgb_to_hsv(*(float(c) ** (1 / 2.2) for c in linear[:3]))[0]


def expected(preset: str) -> tuple[float, float]:
    return next(limits for name, limits in HUES.items() if preset.startswith(name))


def material(data: bytes) -> dict:
    document, _ = parsed(data)
    (only,) = document["materials"]
    assert set(document.get("extensionsUsed", [])) >= set(only.get("extensions", {}))
    return only


def test_shapes_over_http_wear_their_fruit_s_skin_and_darken_as_they_dry() -> None:
    with client_of(starter.ROOT) as client:

        def base(**asked: object) -> list[float]:
            answer = client.get("/v1/shapes/dehydration", params={"format": "glb", "resolution": 16, **asked})
            assert answer.status_code == 200
            colour: list[float] = material(answer.content)["pbrMetallicRoughness"]["baseColorFactor"]
            return colour

        for preset in FRUITS:
            fresh, dry = base(preset=preset, s=0.05), base(preset=preset, s=0.3)
            low, high = expected(preset)
            assert low <= hue(fresh) <= high, preset
            assert low <= hue(dry) <= high, preset
            assert sum(dry[:3]) < sum(fresh[:3])
        # whoever names the numbers of a raisin gets a raisin
        named = registry.get("dehydration").parse({}, "raisin")
        numbers = {name: named.axis(name) for name in named.axes if name not in ("wx", "wy", "wz", "ax", "ay", "az")}
        assert base(**numbers, s=0.2) == base(preset="raisin", s=0.2)
        # spheres are nobody's fruit, and look as they always did
        assert base(te=0.035, gamma=20, s=0.2)[:3] == [0.45, 0.09, 0.06]


def test_a_batch_wears_it_too() -> None:
    body = {"solver": "dehydration", "points": [{"s": 0.2}], "preset": "plum2", "resolution": 16, "format": "glb"}
    with client_of(starter.ROOT) as client:
        answer: httpx.Response = client.post("/v1/shapes:batch", json=body)
    part = answer.content[answer.content.index(b"glTF") :]
    assert 270 <= hue(material(part)["pbrMetallicRoughness"]["baseColorFactor"]) <= 330


@pytest.mark.parametrize("preset", FRUITS)
def test_pictures_of_what_is_looked_up_have_the_fruit_s_hue(preset: str, tmp_path: Path) -> None:
    out = tmp_path / "fruit.png"
    done = CliRunner().invoke(app, ["query", "--preset", preset, "--stages", "0.2", "--out", str(out)])
    assert done.exit_code == 0, done.output
    levels = np.asarray(Image.open(out).convert("RGB"), float) / 255
    # what is much darker than the paper is the fruit
    fruit = levels[levels.sum(axis=-1) < 1.5].mean(axis=0)
    low, high = expected(preset)
    assert low - 5 <= 360 * colorsys.rgb_to_hsv(*fruit)[0] <= high + 10


def dried(preset: str, **more: object) -> xr.Dataset:
    """A made-up run of a preset, whose name is nowhere in it."""
    solver = registry.get("dehydration")
    run = shrinking().assign_coords(stage=[0.1, 0.2, 0.3], converged=("stage", [True] * 3))
    run.attrs |= {"solver": "dehydration", "params": solver.parse(more, preset).model_dump_json()}
    return run


def test_a_run_is_known_by_its_fresh_shape() -> None:
    solver = registry.get("dehydration")
    names = {preset: solver.shade(solver.parse({}, preset).model_dump(mode="json")) for preset in solver.presets}
    shades = solver.looks.shades
    assert names.pop("sphere") is None
    for preset, shade in names.items():
        assert shade is next(one for name, one in shades.items() if preset.startswith(name)), preset
    # a thinner skin makes no other fruit of it; a stone in a sphere is not a passion fruit
    assert solver.shade(solver.parse({"te": 0.02}, "raisin").model_dump(mode="json")) is shades["raisin"]
    assert solver.shade(solver.parse({"te": 0.02}, "sphere").model_dump(mode="json")) is None


def test_runs_leave_in_it_and_usd_changes_it_from_stage_to_stage() -> None:
    plum = material(made(dried("plum2"), "animation"))
    assert 270 <= hue(plum["pbrMetallicRoughness"]["baseColorFactor"]) <= 330
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(made(dried("raisin"), "usda", step=6).decode())
    prim = next(one for one in stage.Traverse() if one.IsA(UsdGeom.Mesh))
    colour = UsdGeom.Mesh(prim).GetDisplayColorPrimvar()
    assert colour.GetInterpolation() == UsdGeom.Tokens.constant
    found = np.array([colour.Get(at)[0] for at in colour.GetTimeSamples()])
    assert len(found) == 3
    assert (np.diff(found.sum(axis=1)) < 0).all()
    assert all(5 <= hue(one) <= 60 for one in found)
    assert UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
    # what nobody knows stays bare
    bare = Usd.Stage.CreateInMemory()
    bare.GetRootLayer().ImportFromString(made(dried("sphere"), "usda").decode())
    prim = next(one for one in bare.Traverse() if one.IsA(UsdGeom.Mesh))
    assert not UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]


def test_usdz_has_a_small_picture_of_the_skin_for_each_stage(tmp_path: Path) -> None:
    path = tmp_path / "raisin.usdz"
    path.write_bytes(made(dried("raisin"), "usdz", step=6, full=True))
    stage = Usd.Stage.Open(str(path))
    prim = next(one for one in stage.Traverse() if one.IsA(UsdGeom.Mesh))
    material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
    assert _materialx.complaints(material) == ""
    files = UsdShade.Shader(stage.GetPrimAtPath(f"{material.GetPath()}/diffuseColor")).GetInput("file").GetAttr()
    assert list(files.GetTimeSamples()) == [1, 7, 13]
    kept = UsdGeom.Mesh(prim).GetDisplayColorPrimvar()
    with zipfile.ZipFile(path) as archive:
        for at in files.GetTimeSamples():
            pixels = np.asarray(Image.open(io.BytesIO(archive.read(files.Get(at).path)))).reshape(-1, 3)
            assert np.ptp(pixels, axis=0).max() == 0
            assert pixels[0] == pytest.approx(encoded(np.array(kept.Get(at)[0])), abs=1)
    # what nobody knows stays bare, as in usdc; pictures of it cannot be had
    path = tmp_path / "sphere.usdz"
    path.write_bytes(made(dried("sphere"), "usdz"))
    with zipfile.ZipFile(path) as archive:
        assert archive.namelist() == ["result.usdc"]
    stage = Usd.Stage.Open(str(path))
    prim = next(one for one in stage.Traverse() if one.IsA(UsdGeom.Mesh))
    assert UsdGeom.Mesh(prim).GetPointsAttr().GetNumTimeSamples() == 3
    assert not UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
    with pytest.raises(UnfitFormat, match="textures need colours"):
        made(dried("sphere"), "usdz", textures=64)


def test_a_picture_of_a_run_has_its_fruit_s_hue() -> None:
    run = dried("plum1")
    panel = outputs.panels(Made([outputs.of_result(run, {}, 2)], {}, "", "dehydration", run=run))[0]
    levels = panel.image(96, View()) / 255
    fruit = levels[levels.sum(axis=-1) < 1.5].mean(axis=0)
    assert 260 <= 360 * colorsys.rgb_to_hsv(*fruit)[0] <= 340
