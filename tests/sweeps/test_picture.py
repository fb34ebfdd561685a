from __future__ import annotations

import io

import numpy as np
import pytest
from matplotlib.image import imread
from scipy.ndimage import gaussian_filter

from solver.fruit import directions, lattice
from sweeps.pictures.render import View, mesh, render
from sweeps.pictures.sheet import Panel, sheet


def ball(n: int = 24, amplitude: float = 0.0) -> np.ndarray:
    theta, phi = lattice(n)
    radius = 1 + amplitude * np.cos(8 * theta) * (1 + np.cos(8 * phi))
    return radius[..., None] * directions(theta, phi)


@pytest.mark.parametrize("resolution", [None, 40])
def test_the_mesh_is_closed_and_wound_outwards(resolution: int | None) -> None:
    vertices, faces = mesh(ball(), resolution=resolution)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    # every edge belongs to two triangles, which run along it in opposite directions
    assert len(np.unique(edges, axis=0)) == len(edges)
    assert {tuple(edge) for edge in edges} == {tuple(edge[::-1]) for edge in edges}
    corners = vertices[faces]
    volume = np.einsum("fc,fc->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(4 / 3 * np.pi, rel=0.01)


def test_a_sphere_is_a_disc_lit_from_the_left() -> None:
    image = render(ball(), pixels=128, view=View(extent=1.25)).astype(float)
    assert image.shape == (128, 128, 3)
    red = image[..., 0] - image[..., 2] > 12
    assert red.mean() == pytest.approx(np.pi / 4 / 1.25**2, rel=0.04)
    assert not (~red[40:88, 40:88]).any(), "holes"
    assert image[45, 45, 0] > 1.5 * image[83, 83, 0]


def test_wrinkles_show() -> None:
    smooth, wrinkled = (render(ball(64, a), pixels=128).astype(float)[40:88, 40:88, 0] for a in (0.0, 0.04))
    # what a blur takes away: the slow shading of the ball itself does not count
    detail = [np.abs(image - gaussian_filter(image, 4)).mean() for image in (smooth, wrinkled)]
    assert detail[1] > 4 * detail[0], detail


def test_a_sheet_has_room_for_all() -> None:
    panel = Panel(ball(), note="a note")
    png = sheet([[panel, None], [panel, panel]], title="title", column_labels="ab", row_labels="cd", pixels=64)
    height, width, _ = imread(io.BytesIO(png)).shape
    assert width >= 2 * 64
    assert height >= 2 * 64
    with pytest.raises(ValueError, match="nothing to draw"):
        sheet([[None]])


@pytest.mark.parametrize("words", [4, 8, 40])
def test_titles_end_within_the_sheet(words: int) -> None:
    """Dehydration of core/shell fruits: plum1 is longer than one panel is wide."""
    panel, pixels = Panel(ball()), 360
    title = " ".join(["fruits"] * words)
    picture = imread(io.BytesIO(sheet([[panel]], title=title, column_labels=[title], pixels=pixels)))[..., :3]
    written = np.abs(picture - picture[0, 0]).max(axis=-1) > 0.3
    for rows in (slice(20, 46), slice(60, 86)):
        columns = np.flatnonzero(written[rows].any(axis=0))
        assert 4 <= columns.min() < columns.max() < written.shape[1] - 4
