"""What a run says before it begins: places that no vertex sees, pictures finer than the mesh, meshes in other units."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from solver import registry
from solver.contract import InvalidGeometry, InvalidInput, Need, Params
from solver.growth.params import GrowthParams
from solver.growth.shapes import Ground, start
from solver.growth.told import note
from solver.growth.tooling.places import Ball, Painted, Texture
from solver.growth.tooling.seen import seen
from sweeps.commands.terminal.options import parameters

GROWTH = registry.get("growth")
EXAMPLES = sorted((Path(__file__).parents[3] / "examples" / "growth").glob("*.toml"))
BETWEEN = (0.012, 0.007, 0.0)  # of no vertex of the square


def said(quality: str = "preview", **values: Any) -> str:
    return note(GrowthParams.parse({"shape": "square", "tools": [], **values}), quality)  # type: ignore[arg-type]


def told(params: Params, need: Need) -> str:
    """Return what the solver says at the door."""
    assert GROWTH.remarks is not None
    return GROWTH.remarks(params, need)


def stripes(waves: float) -> Texture:
    """Return stripes, so many to the width, along x."""
    row = tuple((0.5 + 0.5 * np.sin(2 * np.pi * waves * np.arange(1024) / 1023)).tolist())
    return Texture(picture=(row, row))


@pytest.mark.parametrize(
    "values",
    [
        {"tools": [{"kind": "surface", "where": {"kind": "ball", "centre": (3, 3, 3), "radius": 0.5}}]},
        {"tools": [{"kind": "surface", "where": {"kind": "painted", "values": (0.0,) * 660}}]},
        {"attached": [{"where": {"kind": "ball", "centre": (3, 3, 3), "radius": 0.5}}]},
        {"attached": [{"where": {"kind": "band", "along": "x", "low": 0.4, "high": 0.7}}]},  # a share of .35 at most
        {"thicknesses": [{"where": {"kind": "ball", "centre": BETWEEN, "radius": 0.004}, "times": 2}]},
        {"ribs": [{"where": {"kind": "ball", "centre": (0, 0, 2), "radius": 1}}]},
        {"colours": [{"colour": (1, 0, 0), "where": {"kind": "ball", "centre": (0, 0, 2), "radius": 1}}]},
        {"bed": {"wavelength": 1.0, "where": {"kind": "ball", "centre": (0, 0, 2), "radius": 1}}},
        {"tools": [{"kind": "spot", "at": BETWEEN, "radius": 0.005}]},
        {"tools": [{"kind": "stroke", "points": [BETWEEN], "radius": 0.005}]},
        {"tools": [{"kind": "curve", "points": [BETWEEN, (0.02, 0.007, 0)], "radius": 0.004}]},
    ],
    ids=lambda values: f"{next(iter(values))}",
)
def test_a_place_that_touches_no_vertex_is_told_of(values: dict[str, Any]) -> None:
    if "painted" in str(values):
        values["tools"][0]["where"]["values"] = (0.0,) * len(start("square", 600, 1).x)
    name = next(iter(values))
    told = said(**values)
    assert f"{name}{'' if name == 'bed' else '[0]'}" in told
    assert ("holds none of the" if name == "attached" else "touches none of the") in told
    assert "take a finer quality" in told
    assert not said()


def test_what_a_tool_does_later_is_not_told() -> None:
    away = {"kind": "ball", "centre": (3, 3, 3), "radius": 0.5}
    assert said(tools=[{"kind": "surface", "where": away, "start": 0.02}])
    assert not said(tools=[{"kind": "surface", "where": away, "start": 0.5}])


def test_a_curve_about_the_spot_that_it_follows_is_looked_at_where_it_begins() -> None:
    spot = {"kind": "spot", "at": (0, 0, 0), "radius": 0.4}
    assert not said(tools=[spot, {"kind": "curve", "apex": {"tool": 0}, "closed": True, "radius": 0.2}])
    told = said(tools=[spot, {"kind": "curve", "apex": {"tool": 0}, "closed": True, "radius": 0.002}])
    assert told.startswith("tools[1] (curve)")


@pytest.mark.parametrize("projection", ["z", "uv"])
def test_a_picture_that_is_finer_than_the_mesh_is_told_of(projection: str) -> None:
    mesh = start("square", 600, 1.0)
    # so that by `uv` the picture lies as it does along z
    uv = {"uv": (mesh.x[:, :2] + 0.5).tolist(), "uv_faces": mesh.triangles.tolist()}
    given = {"points": mesh.x.tolist(), "faces": mesh.triangles.tolist(), **uv}

    def of(waves: float) -> str:
        where = {"kind": "texture", "picture": stripes(waves).picture, "projection": projection}
        return said(mesh=given, tools=[{"kind": "surface", "where": where}])

    edge = 1 / 25
    assert not of(1 / (4 * edge))
    assert "tools[0] (texture) is finer than the mesh" in of(1 / edge)
    # another quality is no other mesh of one's own
    assert "give a mesh of finer triangles" in of(1 / edge)


def test_what_is_missed_falls_as_waves_get_longer_and_of_nothing_is_nothing_missed() -> None:
    mesh = start("square", 2500, 1.0)
    ground = Ground(mesh, np.zeros(0, np.int64))
    missed = []
    for edges in (1, 2, 3, 4, 8):
        found = seen(stripes(50 / edges), ground, 0)
        assert found is not None
        missed.append(found.lost)
    # the sheet is about 50 edges wide; what is written in `seen`
    assert missed[0] > 1
    assert 0.45 < missed[1] < 0.65
    assert 0.2 < missed[2] < 0.35
    assert 0.12 < missed[3] < 0.2
    assert missed[4] < 0.06
    flat = seen(Texture(picture=((0.3, 0.3), (0.3, 0.3))), ground, 0)
    assert flat is not None
    assert flat.lost < 1e-6
    painted = seen(Painted(values=tuple(np.arange(len(mesh.x)) % 2)), ground, 0)
    assert painted == (1.0, 0.0)  # it is known at vertices, and nothing of it lies between


def test_what_all_lies_about_one_vertex_is_narrower_than_the_mesh() -> None:
    mesh = start("square", 2500, 1.0)
    found = seen(Ball(centre=tuple(mesh.x[1200]), radius=1e-3), Ground(mesh, np.zeros(0, np.int64)), 0)
    assert found is not None
    assert found.most == 1
    assert found.lost > 1


@pytest.mark.parametrize("quality", ["preview", "default"])
def test_the_gallery_has_nothing_to_be_told(quality: str) -> None:
    assert EXAMPLES
    for path in EXAMPLES:
        assert not note(GROWTH.parse(parameters(path)), quality), path.name  # type: ignore[arg-type]


def test_a_result_says_it_and_its_numbers_are_the_same() -> None:
    away = {"kind": "surface", "where": {"kind": "ball", "centre": (3, 3, 3), "radius": 0.5}}
    need = Need.parse({"stages": [0.05], "quality": "preview"})
    silent = GROWTH.solve(GrowthParams.parse({"shape": "square", "tools": []}), need)
    told = GROWTH.solve(GrowthParams.parse({"shape": "square", "tools": [away]}), need)
    assert "note" not in silent.attrs
    assert told.attrs["note"] == said(tools=[away])
    assert silent["mesh_position"].values.tobytes() == told["mesh_position"].values.tobytes()


def own(width: float, **more: Any) -> dict[str, Any]:
    mesh = start("sphere", 200, 1.0)
    return {"mesh": {"points": (mesh.x * width / 2).tolist(), "faces": mesh.triangles.tolist()}, **more}


def test_a_mesh_thinner_than_its_sheet_is_refused_with_what_to_scale_it_by() -> None:
    with pytest.raises((InvalidInput, InvalidGeometry), match=r"scale it by 2000,"):
        GrowthParams.parse(own(1e-3))
    with pytest.raises((InvalidInput, InvalidGeometry), match=r"scale it by 70,"):
        GrowthParams.parse(own(0.0287))
    GrowthParams.parse(own(0.0301))
    GrowthParams.parse(own(0.002, thickness=0.001))


def test_a_mesh_in_millimetres_is_told_what_to_scale_it_by() -> None:
    told = said(**own(1000.0))
    assert "The mesh is 1000 wide" in told
    assert "scale it by 0.002," in told
    assert "take a finer" not in told  # that is about places
    assert not said(**own(2.0))
    assert not said(**own(70.0))


def test_a_place_that_the_shape_does_not_have_is_refused_before_work() -> None:
    rim = {"kind": "surface", "where": {"kind": "rim", "width": 0.2}}
    params = GrowthParams.parse({"shape": "sphere", "tools": [rim]})
    with pytest.raises(InvalidInput, match="no rim"):
        told(params, GROWTH.settle(Need()))
    with pytest.raises(InvalidInput, match="no rim"):
        GROWTH.solve(params, Need.parse({"quality": "preview"}))


def test_lines_that_would_take_long_are_left_alone() -> None:
    rng = np.random.default_rng(0)
    lines = rng.uniform(-1, 1, (200, 50, 3)).tolist()
    assert not said(tools=[{"kind": "surface", "where": {"kind": "lines", "lines": lines, "width": 1e-3}}])
    assert said(tools=[{"kind": "surface", "where": {"kind": "lines", "lines": lines[:1], "width": 1e-3}}])


def lying(away: float, **more: Any) -> GrowthParams:
    """A square of two triangles, 2 wide, so far along x and z."""
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) + np.array([away, 0, away])
    mesh = {"points": square.tolist(), "faces": [[0, 1, 2], [0, 2, 3]]}
    return GrowthParams.parse({"mesh": mesh, "tools": [], "step": 1.0, **more})


@pytest.mark.parametrize(("away", "dtype"), [(1e3, "float32"), (1e5, "float32"), (1e6, "float64"), (1e9, "float64")])
def test_a_mesh_as_near_as_digits_want_it_is_as_at_the_origin(away: float, dtype: Any) -> None:
    assert note(lying(away), "preview", dtype) == ""


def test_a_mesh_so_far_that_its_digits_show_is_told_of() -> None:
    told = note(lying(1e6), "preview")
    assert told.startswith("The mesh lies 1e+06 from the origin, where positions in float32 are 0.062 apart")
    assert told.endswith("Move it to the origin, by (-1e+06, 0, -1e+06), or ask for float64 positions.")


@pytest.mark.parametrize(("away", "dtype"), [(1e8, "float32"), (1e15, "float64")])
def test_a_mesh_of_which_nothing_would_be_left_is_refused_before_work(away: float, dtype: Any) -> None:
    """At 1e9 all x of a square 2 wide came out as one number, and the run said that it had converged."""
    need = Need(stages=(0.0,), quality="preview", dtype=dtype)
    with pytest.raises(InvalidGeometry, match=r"the mesh lies .* from the origin") as caught:
        GROWTH.solve(lying(away), need)
    assert "Move it to the origin" in caught.value.advice
    assert ("float64" in caught.value.advice) == (dtype == "float32")
    with pytest.raises(InvalidGeometry, match="from the origin"):
        told(lying(away), need)


def test_of_parts_that_only_unevenness_lets_cross_it_is_said_so() -> None:
    """Two squares a thousandth apart, which pass through each other nowhere, were told to be mended."""
    square = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 0]]
    faces = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    above = [[x, y, 1e-4] for x, y, _ in square]
    near = {"points": square + above, "faces": faces + [[a + 5, b + 5, c + 5] for a, b, c in faces]}
    across = {**near, "points": square + [[x, 0.1 + y / 2, x] for x, y, _ in square]}
    need = Need(stages=(0.0,), quality="preview")
    for mesh, said, advice in ((near, "made uneven", "`imperfection`"), (across, "start shape passes", "Mend")):
        with pytest.raises(InvalidGeometry, match=said) as caught:
            GROWTH.solve(GrowthParams.parse({"mesh": mesh, "tools": [], "thickness": 0.3, "step": 1.0}), need)
        assert advice in caught.value.advice
