"""Contact sheets: surfaces side by side, at one scale and under one light, with names and values at the edges."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.arrays import Array
from solver.contract import Worn

from .render import More, View, render, render_triangles
from .shading import BACKGROUND

if TYPE_CHECKING:
    from matplotlib.text import Text

__all__ = ["Panel", "fit", "sheet"]

#: Dots per inch of a sheet; pixels and points follow from it.
_DPI = 100
_INK = "#3a2a24"
#: Size [point] below which no title is made smaller to fit: it is cut.
_LEAST = 9.0


@dataclass(frozen=True, eq=False)
class Panel:
    """One surface: positions (n, 2n, 3) and poles (2, 3) [r1], a note to write below it, and colours (n, 2n, 3).

    With triangles (f, 3), positions and colours are those of vertices (v, 3), and `up` is the axis that points up.
    view: where it is seen from in place of the sheet's direction. roughness: (n, 2n), or (v); more: what stands on it;
    worn: its skin where it has no colours.
    """

    position: Array
    poles: Array | None = None
    note: str = ""
    colour: Array | None = None
    triangles: Array | None = None
    up: str = "y"
    view: View | None = None
    roughness: Array | None = None
    more: More | None = None
    worn: Worn | None = None

    def image(self, pixels: int, view: View) -> Array:
        """Return the picture (pixels, pixels, 3)."""
        if self.triangles is None:
            return render(self.position, self.poles, pixels, view, self.colour, self.roughness, self.more, self.worn)
        looks = (self.colour, self.up, self.roughness, self.more)
        return render_triangles(self.position, self.triangles, pixels, view, *looks)


def sheet(
    rows: Sequence[Sequence[Panel | None]],
    *,
    title: str = "",
    column_labels: Sequence[str] = (),
    row_labels: Sequence[str] = (),
    column_title: str = "",
    row_title: str = "",
    pixels: int = 280,
    view: View | None = None,
) -> bytes:
    """Return a PNG of panels in rows and columns; None leaves a place empty. One scale for all, so sizes compare.

    Raises:
        ValueError: there is nothing to draw.

    """
    # the object interface: pyplot would keep global state and look for a screen
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    view = _common(rows, view or View())
    columns = max(len(row) for row in rows)
    left = 96 if row_labels else 16
    top = (58 if title else 12) + (34 if column_labels else 0) + (26 if column_title else 0)
    width, height = left + columns * pixels + 16, top + len(rows) * pixels + 16
    paper = tuple(BACKGROUND ** (1 / 2.2))
    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor=paper)

    canvas = FigureCanvasAgg(figure)

    def write(x: float, y: float, text: str, size: float, **more: Any) -> Text:
        return figure.text(x / width, 1 - y / height, text, fontsize=size, color=_INK, **more)

    middle = {"ha": "center", "va": "center"}
    for i, row in enumerate(rows):
        for j, panel in enumerate(row):
            x, y = left + j * pixels, top + i * pixels
            if panel is None:
                write(x + pixels / 2, y + pixels / 2, "no such shape", 9, alpha=0.5, **middle)
                continue
            box = (x / width, 1 - (y + pixels) / height, pixels / width, pixels / height)
            axes = figure.add_axes(box)
            own = panel.view and View(panel.view.azimuth, panel.view.elevation, view.extent)
            image = panel.image(pixels, own or view)
            axes.imshow(image, interpolation="nearest")
            axes.set_axis_off()
            if panel.note:
                write(x + pixels / 2, y + pixels - 9, panel.note, 8.5, alpha=0.8, **middle)
    if title:
        begin = left if row_labels else 16
        fit(write(begin, 32, title, 14, va="center", fontweight="bold"), 14, width - begin - 8)
    if column_title:
        write(left + columns * pixels / 2, top - 48, column_title, 11, **middle)
    for j, label in enumerate(column_labels):
        fit(write(left + (j + 0.5) * pixels, top - 18, label, 11, **middle), 11, pixels)
    if row_title:
        write(22, top + len(rows) * pixels / 2, row_title, 11, rotation=90, **middle)
    for i, label in enumerate(row_labels):
        write(62, top + (i + 0.5) * pixels, label, 11, rotation=90, **middle)
    out = io.BytesIO()
    canvas.print_png(out)
    return out.getvalue()


def fit(written: Text, size: float, room: float) -> None:
    """Make a text of that size no wider than `room` [pixel]: smaller, and cut at the end where that is not enough."""
    while written.get_window_extent().width > room and size > _LEAST:
        size -= 0.5
        written.set_fontsize(size)
    text = written.get_text()
    while written.get_window_extent().width > room and len(text) > 1:
        text = text[:-1]
        written.set_text(f"{text.rstrip(' ,:')} …")


def _common(rows: Sequence[Sequence[Panel | None]], base: View) -> View:
    """Return a view that holds every panel.

    Raises:
        ValueError: there is nothing to draw.

    """
    panels = [panel for row in rows for panel in row if panel is not None]
    if not panels:
        raise ValueError("there is nothing to draw")
    reach = max(float(np.linalg.norm(panel.position, axis=-1).max()) for panel in panels)
    return View(base.azimuth, base.elevation, 1.13 * reach)
