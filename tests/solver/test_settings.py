"""What a quality means, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

from solver import registry
from solver.contract import InvalidInput
from solver.dehydration.fresh.mesh import build_mesh
from solver.dehydration.settings import choose

SOLVER = registry.get("dehydration")


def _chosen(params, quality):
    try:
        return choose(params, quality, 0.3)
    except InvalidInput:
        return None


@pytest.mark.parametrize("quality", ["preview", "default", "fine"])
@pytest.mark.parametrize("mirrors", ["", "xyz"])
@pytest.mark.parametrize("te", [0.2, 0.04, 0.01, 0.005, 0.002])
@pytest.mark.parametrize("gamma", [3.0, 10.0, 100.0])
def test_no_quality_runs_below_four_elements_a_wave(quality, mirrors, te, gamma):
    """Flat film: 2 pi te (gamma / 3)^(1/3), on an edge of the cube of a quarter turn."""
    params = SOLVER.parse({"te": te, "gamma": gamma, "mirrors": mirrors})
    wave = 2 * np.pi * te * (gamma / 3) ** (1 / 3)
    settings = _chosen(params, quality)
    if settings is None:
        assert te <= 0.005
        assert not mirrors or (te, gamma) == (0.002, 3.0)
    else:
        assert settings.n * wave / (np.pi / 2) >= 4 - 1e-9


def test_a_stage_that_is_still_smooth_needs_no_waves():
    params = SOLVER.parse({"te": 0.002})
    smooth = choose(params, "preview", 0.005)
    assert smooth.start > 0.005
    assert smooth.elements < 300_000
    with pytest.raises(InvalidInput, match=r"te = 0\.002 .* elements") as refused:
        choose(params, "preview", 0.3)
    assert "mirrors" in refused.value.advice


@pytest.mark.parametrize(
    ("changes", "mirrors"),
    [
        ({}, "xyz"),
        ({"mirrors": "xz"}, "xyz"),
        ({"mirrors": "xyz"}, None),
        ({"light": (0.0, 0.0, 1.0)}, "xy"),
        ({"wx": 0.1, "mirrors": "yz"}, None),
        ({"r2": 0.99}, "xz"),
        ({"light_map": [[0.5, 0.6]]}, None),
    ],
)
def test_a_refusal_for_elements_names_the_mirrors_that_are_left(changes, mirrors):
    with pytest.raises(InvalidInput, match="elements") as refused:
        choose(SOLVER.parse({"te": 0.002, "gamma": 1.0, **changes}), "preview", 0.3)
    begin = f"Set mirrors to {mirrors} (each halves the elements), or take" if mirrors else "Take"
    assert refused.value.advice == f"{begin} a thicker or stiffer exocarp."


@pytest.mark.parametrize(
    ("quality", "width", "growth", "first"),
    [("preview", 2.1, 1.7, (0.03, 0.05)), ("default", 1.46, 1.6, (0.02, 0.04)), ("fine", 1.0, 1.3, (0.02, 0.04))],
)
def test_elements_of_the_skin_are_as_wide_as_it_is_thick_at_fine(quality, width, growth, first):
    """Liu et al. 2014 mesh with elements of the exocarp of about te, that grow inwards: at gamma = 10 fine does."""
    params = SOLVER.parse({"te": 0.04, "gamma": 10.0})
    settings = choose(params, quality, 0.3)
    mesh = build_mesh(params, settings.n, settings.core)
    columns = mesh.positions.reshape(len(mesh.rays), mesh.levels, 3)
    corners = columns[:, -1][mesh.sphere.quads]
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    assert edges.mean() == pytest.approx(width * 0.04, rel=0.03)
    heights = np.linalg.norm(np.diff(columns, axis=1), axis=2)
    assert heights[:, -2:] == pytest.approx(0.02, rel=1e-6)
    assert heights[:, :-3] == pytest.approx(growth * heights[:, 1:-2], rel=1e-6)
    assert first[0] < heights[0, -3] < first[1]


@pytest.mark.parametrize(
    ("te", "gamma", "quality", "wide"),
    [
        (0.04, 50.0, "preview", True),
        (0.01, 5.0, "preview", True),
        (0.05, 30.0, "preview", False),
        (0.005, 10.0, "preview", False),
        (0.04, 100.0, "preview", False),
        (0.04, 3.0, "preview", False),
        (0.04, 10.0, "default", True),
        (0.05, 30.0, "default", False),
        (0.04, 10.0, "fine", True),
        (0.05, 30.0, "fine", False),
    ],
)
def test_rungs_stand_apart_where_that_was_tried(te, gamma, quality, wide):
    settings = choose(SOLVER.parse({"te": te, "gamma": gamma}), quality, 0.3)
    assert (0.15 in settings.rungs) is not wide
    assert {0.05, 0.1, 0.2, 0.3} <= set(settings.rungs)


@pytest.mark.parametrize(("te", "thinner"), [(0.2, 1), (0.04, 1), (0.02, 1), (0.016, 1.25), (0.01, 2), (0.005, 4)])
def test_volumes_of_thin_skins_are_held_the_more_stiffly(te, thinner):
    """While stages settle; and they are eased the more heavily, from farther off."""
    settings = choose(SOLVER.parse({"te": te, "mirrors": "xyz"}), "preview", 0.3)
    assert settings.skin_march_kappa_ratio == pytest.approx(30 * thinner)
    assert settings.march_kappa_ratio == pytest.approx(max(30 * thinner, 8 * 10 * te))
    assert settings.easing_damping == pytest.approx(20 * thinner * settings.swing_damping)
    assert settings.near == pytest.approx(3 * thinner * settings.residual)


def test_a_stage_has_the_mesh_that_it_has_beside_others():
    """Also where wrinkles take more elements than the quality has; where they would be refused it has the quality's."""
    thin = SOLVER.parse({"te": 0.012})
    smooth, wrinkled = (choose(thin, "preview", last).n for last in (0.01, 0.3))
    assert smooth == wrinkled > choose(SOLVER.parse({"te": 0.02}), "preview").n
    thinnest = SOLVER.parse({"te": 0.002})
    assert choose(thinnest, "preview", 0.01).n == 48
    with pytest.raises(InvalidInput, match="more than 2,500,000"):
        choose(thinnest, "preview", 0.3)
