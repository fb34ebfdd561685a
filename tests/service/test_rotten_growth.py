"""A decay run whose map grows a sheet, by the command line alone: what is read where is asked of the files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import RegularGridInterpolator
from scipy.spatial import KDTree
from typer.testing import CliRunner

from service.cli import app
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from sweeps.commands.terminal.options import parameters

from .test_grown_textures import written

#: Stretch of what has rotted whole, in a unit of growth time, and the time that is grown.
STRETCH, TIME = 1.6, 0.5
#: Thickness [l], and thickness and bending stiffness of what has rotted whole, over those of what has not.
THICK, TIMES, SOFT = 0.05, 0.5, 0.2
PREVIEW = "--quality", "preview"


def told(*words: object) -> None:
    found = CliRunner().invoke(app, [str(word) for word in words])
    assert found.exit_code == 0, found.output


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return where an orange has rotted for a week, and files of growth that name its maps."""
    path = tmp_path_factory.mktemp("rotten")
    run = path / "orange.h5"
    wound = "wounds=[{colatitude=65,azimuth=50}]"
    told("solve", "decay", "--preset", "orange", "--set", wound, *PREVIEW, "--stages", "7", "--out", run)
    told("export", run, "--map", "rot", "--out", path / "rot.exr")
    told("export", run, "--map", "rot", "--out", path / "rot.png")
    for kind in ("exr", "png"):
        place = f'{{kind = "texture", picture = "@rot.{kind}", projection = "sphere"}}'
        (path / f"{kind}.toml").write_text(
            f'shape = "sphere"\nthickness = {THICK}\nstep = 0.1\nimperfection = 0\n'
            f"tools = [{{kind = 'surface', where = {place}, stretch = [{STRETCH}, {STRETCH}]}}]\n"
            f"colours = [{{colour = [1, 1, 1]}}, {{colour = [0, 0, 0], where = {place}}}]\n"
            f"thicknesses = [{{where = {place}, times = {TIMES}}}]\nribs = [{{where = {place}, stiffness = {SOFT}}}]\n"
        )
    return path


def grown(folder: Path, kind: str) -> xr.Dataset:
    out = folder / f"{kind}.h5"
    words = *PREVIEW, "--stages", f"0,{TIME}", "--fields", "mesh_position,red,rest_area,sheet_thickness"
    told("solve", "growth", "--params", folder / f"{kind}.toml", *words, "--out", out)
    return xr.load_dataset(out, engine="h5netcdf")


def lattice(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return decay's own rot (n, 2n), and colatitudes and azimuths, radians."""
    run = xr.load_dataset(folder / "orange.h5", engine="h5netcdf")
    rot = run["rot"].isel(stage=-1)
    degrees = [rot[name].values * (np.pi / 180 if rot[name].values.max() > 10 else 1) for name in rot.dims]
    return rot.values.astype(float), degrees[0], degrees[1]


def own(folder: Path, points: np.ndarray) -> np.ndarray:
    """Return decay's rot at points of a sphere whose pole is on y, bilinear on its lattice."""
    rot, colatitude, azimuth = lattice(folder)
    colatitude = np.concatenate([-colatitude[:1], colatitude, 2 * np.pi - colatitude[-1:]])
    half = rot.shape[1] // 2
    rot = np.concatenate([np.roll(rot[:1], half, 1), rot, np.roll(rot[-1:], half, 1)])
    rot, azimuth = np.concatenate([rot, rot[:, :1]], axis=1), np.append(azimuth, azimuth[0] + 2 * np.pi)
    x, y, z = (points / np.linalg.norm(points, axis=1, keepdims=True)).T
    found = RegularGridInterpolator((colatitude, azimuth), rot)
    return np.asarray(found(np.stack([np.arccos(np.clip(y, -1, 1)), np.arctan2(z, x) % (2 * np.pi)], -1)))


@pytest.mark.parametrize("kind", ["exr", "png"])
def test_growth_follows_the_rot_of_a_decay_run(folder: Path, kind: str) -> None:
    run = grown(folder, kind)
    count = int(run.vertex_count[0])
    x, y, z = run.mesh_position.values[:count].astype(float).T
    there = own(folder, np.stack([x, z, -y], -1))
    assert there.max() > 0.9
    assert there.min() < 0.01
    shares = 1 - run.red.values[:count]
    # the map is drawn bilinear between the lattice's samples, read at half its pixels and bilinear between those
    assert np.abs(shares - there).max() < 0.02
    # not upside down, nor the other way round, nor as a mirror has it
    for wrong in ((x, -z, -y), (-x, z, y), (x, z, y)):
        assert np.abs(shares - own(folder, np.stack(wrong, -1))).max() > 0.5
    # logarithms of lengths grow as the rot says: so does the rest area, over decay's own lattice
    rot, colatitude, _ = lattice(folder)
    weights = np.broadcast_to(np.sin(colatitude)[:, None], rot.shape)
    wanted = float((STRETCH ** (2 * TIME * rot) * weights).sum() / weights.sum())
    assert wanted > 1.05
    assert float(run.rest_area[1] / run.rest_area[0]) == pytest.approx(wanted, rel=0.005)


@pytest.mark.parametrize("kind", ["exr", "png"])
def test_thickness_and_stiffness_are_what_decays_own_field_says(folder: Path, kind: str) -> None:
    """By value, at every vertex: h = t (1 + rot (times - 1)), and stiffness in its logarithm."""
    run = grown(folder, kind)
    x, y, z = run.mesh_position.values[: int(run.vertex_count[0])].astype(float).T
    rot = own(folder, np.stack([x, z, -y], -1))
    found = run.sheet_thickness.values[: len(rot)]
    assert found.min() < 0.55 * THICK < 0.99 * THICK < found.max()
    # as much as the map is off: .02 of the way from whole to rotten
    assert np.abs(found - THICK * (1 + rot * (TIMES - 1))).max() < 0.02 * THICK * (1 - TIMES)
    params = GrowthParams.parse(parameters(folder / f"{kind}.toml"))
    state = Engine(params, len(rot)).state
    x, y, z = state.x.T
    rot = own(folder, np.stack([x, z, -y], -1))
    assert np.abs(state.matter["stiff"] - rot * np.log(SOFT)).max() < 0.02 * abs(np.log(SOFT))


def test_in_files_the_grown_lies_as_the_rotten_does(folder: Path) -> None:
    """Written as PLY, both with y up, what has rotted at a place grows at that place."""
    trimesh = pytest.importorskip("trimesh")
    grown(folder, "exr")
    told("export", folder / "orange.h5", "--out", folder / "orange.ply")
    told("export", folder / "exr.h5", "--stage", "0", "--out", folder / "exr.ply")
    rotten, sheet = (
        trimesh.load_mesh(folder / f"{name}.ply", process=False).metadata["_ply_raw"]["vertex"]["data"]
        for name in ("orange", "exr")
    )
    places = [np.stack([rows[axis] for axis in "xyz"], -1).astype(float) for rows in (rotten, sheet)]
    near = KDTree(places[0] / np.linalg.norm(places[0], axis=1, keepdims=True)).query(places[1])[1]
    rot, red = np.asarray(rotten["rot"], float)[near], np.asarray(sheet["red"], float)
    assert np.abs(rot - (1 - red)).mean() < 0.02
    assert np.corrcoef(rot, 1 - red)[0, 1] > 0.98


def apart(chart: int, x: float, y: float) -> tuple[float, float]:
    """Return the coordinates of a place on one of two charts, the second of which lies on its side, further up."""
    return (0.5 + 0.4 * x, 0.25 + 0.2 * y) if chart == 0 else (0.5 - 0.4 * y, 0.55 + 0.4 * x)


def test_on_a_mesh_of_one_s_own_the_map_lies_by_its_coordinates(tmp_path: Path) -> None:
    """Decay and growth of one file, in two charts: its vertices are those of both results, in one order."""
    written(tmp_path / "leaf.obj", 15, apart)
    run = tmp_path / "leaf.h5"
    words = "--set", f"mesh=@{tmp_path}/leaf.obj", "--set", "wounds=[{vertex=33}]", "--set", "seeds=wounds"
    told("solve", "decay", "--preset", "orange", *words, *PREVIEW, "--stages", "4", "--out", run)
    told("export", run, "--map", "rot", "--out", tmp_path / "rot.png")
    (tmp_path / "leaf.toml").write_text(
        'mesh = "@leaf.obj"\nimperfection = 0\nstep = 0.1\n'
        'tools = [{kind = "surface", where = {kind = "everywhere"}}]\n'
        'colours = [{colour = [1, 1, 1]}, {colour = [0, 0, 0], where = {kind = "texture", picture = "@rot.png", '
        'projection = "uv"}}]\n'
    )
    out = tmp_path / "grown.h5"
    words = "--params", str(tmp_path / "leaf.toml"), "--fields", "mesh_position,red"
    told("solve", "growth", *words, *PREVIEW, "--stages", "0", "--out", out)
    rotten, sheet = (xr.load_dataset(path, engine="h5netcdf") for path in (run, out))
    rot, share = rotten["rot"].isel(stage=-1).values.ravel(), 1 - sheet["red"].values
    assert rot.shape == share.shape == (15 * 15,)
    assert rot.max() > 0.9
    assert rot.min() < 0.1
    assert np.abs(share - rot).max() < 0.08
    assert np.abs(share - rot).mean() < 0.01


def test_a_map_without_coordinates_to_lie_by_is_refused_before_any_work(folder: Path) -> None:
    text = (folder / "png.toml").read_text().replace('"sphere"}', '"uv"}')
    (folder / "unmapped.toml").write_text(text)
    words = ["solve", "growth", "--params", str(folder / "unmapped.toml"), "--json"]
    found = CliRunner().invoke(app, words)
    assert found.exit_code == 2, found.output
    assert "has no texture coordinates" in found.output
    assert "sphere" in found.output
