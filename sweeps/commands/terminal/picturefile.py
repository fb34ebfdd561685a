"""Pictures in files as painted maps, `--set light_map=@sun.png`, and as textures, `picture = "@rot.exr"`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from solver.arrays import Floats

from ...errors import InvalidOption, installing

__all__ = ["KINDS", "picture", "read"]

KINDS = (".png", ".jpg", ".jpeg", ".exr")

#: Rows of a map at most, of a texture, and columns of that; and pixels along a side of a picture [1].
_ROWS, _FINE, _WIDE, _SIDE = 64, 256, 512, 4096
#: Digits of a value: of a picture of 8 bits, and of more.
_DIGITS, _MORE = 4, 6
#: Modes of pictures of 16 grey bits, by which library versions call them.
_DEEP = ("I;16", "I;16B", "I;16L", "I;16N", "I")


def read(path: Path) -> list[list[float]]:
    """Return how bright a picture is, 0 (black) to 1: n rows of 2 n values, averages of its pixels, 64 rows at most.

    The picture is laid around the body as maps are: its top is the pole y > 0, its left edge lies at x > 0.

    Raises:
        InvalidOption: it cannot be read, or is too small or too large.

    """
    grey, white, digits = _grey(path)
    tall, wide = grey.shape
    rows = min(_ROWS, tall, wide // 2)
    # a map's first column stands at azimuth 0, which is the picture's left edge: half of it lies on either side
    halves = _averages(_averages(grey, rows).T, 4 * rows)
    columns = (np.roll(halves, 1, axis=0)[::2] + halves[::2]) / 2
    found: list[list[float]] = (columns.T / white).round(digits).tolist()
    return found


def picture(path: Path) -> list[list[float]]:
    """Return how bright a picture is, 0 (black) to 1, in rows from its top; averages of pixels where it is larger.

    Of PNG with 16 grey bits all are kept; of EXR, which may hold one channel, all digits of single precision that six
    decimals hold.

    Raises:
        InvalidOption: it cannot be read, or is too small or too large.

    """
    grey, white, digits = _grey(path)
    tall, wide = grey.shape
    for count, most in ((tall, _FINE), (wide, _WIDE)):
        grey = (_averages(grey, most) if count > most else grey).T
    found: list[list[float]] = (grey / white).round(digits).tolist()
    return found


def _grey(path: Path) -> tuple[Floats, float, int]:
    """Return a picture's pixels (rows from the top, columns), what white is, and how many decimals shares are worth.

    Raises:
        InvalidOption: it cannot be read, or is too small or too large.

    """
    if path.suffix.lower() == ".exr":
        return _of_exr(path), 1.0, _MORE
    from PIL import Image

    try:
        with Image.open(path, formats=["PNG", "JPEG"]) as opened:
            _check_size(path, *opened.size)
            if opened.mode in _DEEP:
                return np.asarray(opened, dtype=float), 65535.0, _MORE
            return np.asarray(opened.convert("RGB").convert("L"), dtype=float), 255.0, _DIGITS
    except FileNotFoundError:
        raise InvalidOption(f"There is no {path}.", "Name a PNG, JPEG or EXR file.") from None
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise InvalidOption(f"{path} is no picture that can be read.", "Save it anew as PNG or JPEG.") from error


def _of_exr(path: Path) -> Floats:
    """Return the one channel of an EXR picture.

    Raises:
        InvalidOption: it cannot be read, has several channels, or values that are no shares.

    """
    if not path.is_file():
        raise InvalidOption(f"There is no {path}.", "Name a PNG, JPEG or EXR file.")
    try:
        import OpenEXR
    except ImportError:
        raise InvalidOption(f"{path}: EXR needs the package OpenEXR.", installing("formats")) from None
    try:
        with OpenEXR.File(str(path)) as file:
            channels = {name: np.asarray(channel.pixels, float) for name, channel in file.channels().items()}
    except (OSError, RuntimeError, ValueError) as error:
        raise InvalidOption(f"{path} is no EXR picture that can be read.", "Save it anew, as scan lines.") from error
    names = ", ".join(channels)
    if len(channels) != 1 or next(iter(channels.values())).ndim != 2:
        raise InvalidOption(
            f"{path} has the channels {names}: a texture has one.",
            "Write one alone: `wizen export RUN.h5 --map NAME --out NAME.exr`.",
        )
    values = next(iter(channels.values()))
    _check_size(path, values.shape[1], values.shape[0])
    if not (values.min() >= 0 and values.max() <= 1):
        raise InvalidOption(
            f"{path}: {names} goes from {values.min():.4g} to {values.max():.4g}, and a texture from 0 to 1.",
            "Write it as PNG, where --low is black and --high white.",
        )
    return values


def _check_size(path: Path, wide: int, tall: int) -> None:
    if min(wide // 2, tall) < 1 or max(wide, tall) > _SIDE:
        raise InvalidOption(f"{path} has {wide} x {tall} pixels.", f"2 x 1 to {_SIDE} x {_SIDE} are read: scale it.")


def _averages(values: Floats, count: int) -> Floats:
    """Return the averages (count, ...) of equally long pieces of the first axis, which may end within a pixel."""
    edges = np.linspace(0, len(values), count + 1)
    whole = edges.astype(int)
    total = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    after = np.concatenate([values, np.zeros_like(values[:1])])
    until = total[whole] + (edges - whole)[:, None] * after[whole]
    found: Floats = np.diff(until, axis=0) / np.diff(edges)[:, None]
    return found
