"""Pictures in files as painted maps: `--set light_map=@sun.png`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from solver.arrays import Floats

from ...errors import InvalidOption

__all__ = ["KINDS", "read"]

KINDS = (".png", ".jpg", ".jpeg")

#: Rows of a map at most, and pixels along a side of a picture [1].
_ROWS, _SIDE = 64, 4096


def read(path: Path) -> list[list[float]]:
    """Return how bright a picture is, 0 (black) to 1: n rows of 2 n values, averages of its pixels, 64 rows at most.

    The picture is laid around the body as maps are: its top is the pole y > 0, its left edge lies at x > 0.

    Raises:
        InvalidOption: it cannot be read, or is too small or too large.

    """
    from PIL import Image

    try:
        with Image.open(path, formats=["PNG", "JPEG"]) as picture:
            wide, tall = picture.size
            if min(wide // 2, tall) < 1 or max(wide, tall) > _SIDE:
                raise InvalidOption(
                    f"{path} has {wide} x {tall} pixels.", f"2 x 1 to {_SIDE} x {_SIDE} are read: scale it."
                )
            grey = np.asarray(picture.convert("RGB").convert("L"), dtype=float)
    except FileNotFoundError:
        raise InvalidOption(f"There is no {path}.", "Name a PNG or JPEG file.") from None
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise InvalidOption(f"{path} is no picture that can be read.", "Save it anew as PNG or JPEG.") from error
    rows = min(_ROWS, tall, wide // 2)
    found: list[list[float]] = (_averages(_averages(grey, rows).T, 2 * rows).T / 255).round(4).tolist()
    return found


def _averages(values: Floats, count: int) -> Floats:
    """Return the averages (count, ...) of equally long pieces of the first axis, which may end within a pixel."""
    edges = np.linspace(0, len(values), count + 1)
    whole = edges.astype(int)
    total = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    after = np.concatenate([values, np.zeros_like(values[:1])])
    until = total[whole] + (edges - whole)[:, None] * after[whole]
    found: Floats = np.diff(until, axis=0) / np.diff(edges)[:, None]
    return found
