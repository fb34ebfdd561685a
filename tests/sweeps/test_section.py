"""Cuts through known solids, and the picture that shows them."""

import io

import numpy as np
import pytest
import trimesh
from matplotlib.image import imread

from solver import registry
from solver.contract import Need
from sweeps.errors import InvalidOption
from sweeps.pictures import section


@pytest.mark.parametrize("word", ["0", "35", "equator"])
def test_a_ball_is_cut_in_a_circle(word: str) -> None:
    ball = trimesh.creation.icosphere(4)
    points = np.array(ball.vertices)
    segments, values = section.cut(points, ball.faces, section.plane(word), points[:, 1:2])
    assert np.abs(np.linalg.norm(segments, axis=2) - 1).max() < 2e-3
    assert np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).sum() == pytest.approx(2 * np.pi, rel=2e-3)
    height = np.zeros(len(segments)) if word == "equator" else segments[:, :, 1].mean(axis=1)
    assert np.allclose(values[:, 0], height, atol=1e-9)


def test_a_cut_agrees_with_another_library_on_a_box_off_the_middle() -> None:
    box = trimesh.creation.box([1, 2, 3])
    box.apply_translation([0.2, 0.1, 0.3])
    where = section.plane("40")
    segments, _ = section.cut(np.array(box.vertices), box.faces, where)
    theirs = trimesh.intersections.mesh_plane(box, np.cross(where.right, where.up), [0, 0, 0])
    length = np.linalg.norm(theirs[:, 1] - theirs[:, 0], axis=1).sum()
    assert np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).sum() == pytest.approx(length)


@pytest.mark.parametrize("word", ["", "x", "nan", "inf"])
def test_other_words_are_no_plane(word: str) -> None:
    with pytest.raises(InvalidOption, match="no plane"):
        section.plane(word)


def test_a_picture_shows_stone_and_colours() -> None:
    solver = registry.get("decay")
    need = Need(quality="preview", resolution=24, stages=(0.0,), fields=("position", "rot"))
    # without bloom, which is a haze over the skin's own colour
    apple = solver.parse({"peel": {**solver.parse({}, "apple").peel.model_dump(), "bloom": 0.0}}, "apple")
    run = solver.solve(apple, need)
    image = imread(io.BytesIO(section.picture(run, section.plane("0"), title="apple")))[..., :3]
    middle = image[84 + 160, 16 + 160]
    assert np.allclose(middle, np.array([0x8A, 0x6A, 0x4C]) / 255, atol=0.02)
    skin = section.colours.encoded(np.array(apple.skin_colour)) / 255
    assert (np.abs(image - skin).max(axis=2) < 0.02).sum() > 500
    # a fruit that keeps its shape is where it was fresh; where one that moves has gone to nobody knows
    still = run.drop_vars("position")
    assert section.picture(still, section.plane("0")) == section.picture(run, section.plane("0"))
    moves = solver.parse({"body": "quasi-static"}, "apple").model_dump_json()
    with pytest.raises(InvalidOption, match="no surface"):
        section.picture(still.assign_attrs(params=moves), section.plane("0"))
