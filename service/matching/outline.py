"""The outline of a photographed shape: what of its silhouette does not depend on where and how large it stands.

A mask is read along rays from the middle of its area, over the radius of a disc of the same area. A surface has an
outline from every side: of those from evenly spread ones the mean is compared, and by how much they differ is the
scatter that a single photograph has. The photograph is taken as if from far away.
"""

from __future__ import annotations

import io
from functools import lru_cache

import numpy as np

from solver.arrays import Array, Bools, Floats

from .signature import Signature, Unreadable

__all__ = ["VIEWS", "of_mask", "of_surface", "read"]

#: Rays of an outline.
_RAYS = 192
#: Sides from which a surface is looked at.
VIEWS = 12
#: First wavenumbers around the outline of the bands.
_BANDS = np.array([2, 3, 5, 7, 10, 14, 19, 26, 36])
#: Amplitude below which an outline is smooth, over the disc's radius: a tenth of a pixel of 500 across.
_SMOOTH = 4e-4
#: Least scatter: of amplitudes, skewness and slopes, however alike the sides are.
_LEAST = 0.1
#: Least and largest side of a mask, and the share of it that a shape fills at least [pixel, pixel, 1].
_SMALL, _LARGE, _SHARE = 32, 8192, 0.005
#: Most pixels: those of a mask in one colour are few bytes, and all of them are looked at.
_PIXELS = 1 << 24


def read(data: bytes) -> Bools:
    """Return the mask (height, width) in a PNG: what is opaque, or else what is bright, or dark on a bright border.

    Raises:
        Unreadable: it is no picture, too small or too large, or shows nothing that ends within it.

    """
    from PIL import Image

    try:
        with Image.open(io.BytesIO(data), formats=["PNG"]) as picture:
            wide, tall = picture.size
            if min(wide, tall) < _SMALL or max(wide, tall) > _LARGE:
                raise Unreadable(f"it is {wide} x {tall} pixels, and {_SMALL} to {_LARGE} are read")
            if wide * tall > _PIXELS:
                raise Unreadable(f"it is {wide} x {tall} pixels, more than {_PIXELS} in all: 1000 across are plenty")
            alpha = "A" in picture.getbands() or "transparency" in picture.info
            planes = np.asarray(picture.convert("RGBA" if alpha else "L"))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        if isinstance(error, Unreadable):
            raise
        raise Unreadable("it is no PNG that can be read") from None
    if alpha and planes[..., 3].min() < 128 <= planes[..., 3].max():
        found = planes[..., 3] >= 128
    else:
        bright = planes[..., :3].mean(axis=-1) if alpha else planes
        found = bright >= 128
        border = np.concatenate([found[0], found[-1], found[:, 0], found[:, -1]])
        found = found != (border.mean() > 0.5)
    return _one(np.asarray(found))


def _one(mask: Bools) -> Bools:
    """Return the largest connected part of a mask with its holes filled.

    Raises:
        Unreadable: there is none, it is tiny, or it leaves the picture.

    """
    from scipy import ndimage

    parts, count = ndimage.label(mask)
    sizes = np.bincount(parts.ravel())[1:]
    if not count or sizes.max() < max(_SHARE * mask.size, _SMALL**2 / 4):
        raise Unreadable("it shows no shape that fills enough of it")
    found = ndimage.binary_fill_holes(parts == 1 + sizes.argmax())
    if found[0].any() or found[-1].any() or found[:, 0].any() or found[:, -1].any():
        raise Unreadable("the shape leaves the picture, or there is no telling it from what is around")
    return np.asarray(found)


def of_mask(mask: Bools, unit: float | None) -> Signature:
    """Return the signature of a mask; `unit` is the length of r1 in pixels, None: unknown.

    Raises:
        Unreadable: the middle of its area lies outside of it.

    """
    from scipy import ndimage

    sums = [mask.sum(axis=1 - axis) for axis in (0, 1)]
    middle = np.array([(np.arange(len(one)) * one).sum() / one.sum() for one in sums])
    radius = float(np.sqrt(sums[0].sum() / np.pi))
    # no farther than the corners of what holds it
    ends = [np.flatnonzero(one)[[0, -1]] for one in sums]
    reach = np.hypot(*(np.abs(end - at).max() for end, at in zip(ends, middle, strict=True))) + 2
    along = np.arange(0, reach, 0.25)
    angles = np.arange(_RAYS) * 2 * np.pi / _RAYS
    rows = middle[0] - np.sin(angles)[:, None] * along
    columns = middle[1] + np.cos(angles)[:, None] * along
    inside = ndimage.map_coordinates(mask.view(np.uint8), [rows, columns], float, order=1) >= 0.5
    if not inside.any(axis=1).all():
        raise Unreadable("the middle of the shape lies outside of it")
    last = inside.shape[1] - 1 - inside[:, ::-1].argmax(axis=1)
    values = _features(along[last] / radius)
    scatter = np.full(len(values), _LEAST)
    return _signature(values, scatter, radius, unit)


def of_surface(points: Array, unit: float | None) -> Signature:
    """Return the signature that outlines of a closed surface's points (v, 3) have: mean and scatter over all sides.

    Points lie so densely that some are next to the outline everywhere.
    """
    x = np.asarray(points, float)
    rows, extents = [], []
    for right, up in _sides():
        r, area = _around(x @ right, x @ up)
        extents.append(np.sqrt(area / np.pi))
        rows.append(_features(r / extents[-1]))
    values = np.array(rows)
    spread = np.hypot(values.std(axis=0, ddof=1), _LEAST)
    sizes = np.log(extents)
    found = _signature(values.mean(axis=0), spread, float(np.exp(sizes.mean())), unit)
    if unit is not None:
        found.scatter[0] = np.hypot(sizes.std(ddof=1), 0.01)
    return found


def _signature(values: Floats, scatter: Floats, radius: float, unit: float | None) -> Signature:
    bands = len(_BANDS) - 1
    parts = ("outline",) + ("spectrum",) * (bands - 1) + ("form",) * (len(values) - bands)
    if unit is None:
        return Signature(values, parts, scatter, radius)
    size = np.log(radius / unit)
    return Signature(np.r_[size, values], ("size", *parts), np.r_[0.01, scatter], radius)


def _around(x: Floats, y: Floats) -> tuple[Floats, float]:
    """Return the farthest of points (v) by direction (rays,) from the middle of the area that they cover, and it."""
    middle = np.array([0.5 * (values.max() + values.min()) for values in (x, y)])
    for _ in range(3):
        across, along = x - middle[0], y - middle[1]
        r = np.sqrt(across * across + along * along)  # no length here is near a number's ends, which hypot minds
        place = np.rint(np.arctan2(along, across) * (_RAYS / (2 * np.pi))).astype(int) % _RAYS
        far = np.zeros(_RAYS)
        np.maximum.at(far, place, r)
        angles = np.arange(_RAYS) * 2 * np.pi / _RAYS
        ends = far[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        after = np.roll(ends, -1, axis=0)
        cross = ends[:, 0] * after[:, 1] - ends[:, 1] * after[:, 0]
        area = 0.5 * float(cross.sum())
        middle = middle + (cross[:, None] * (ends + after)).sum(axis=0) / (6 * area)
    return far, area


def _features(r: Floats) -> Floats:
    """Return logarithms of amplitudes by band, skewness and slopes of an outline's radius (rays,)."""
    waves = np.abs(np.fft.rfft(r)) ** 2 * 2 / len(r) ** 2
    power = np.add.reduceat(waves[: _BANDS[-1]], _BANDS[:-1])
    fine = np.fft.rfft(r)
    fine[:3], fine[_BANDS[-1] :] = 0, 0
    field = np.fft.irfft(fine, len(r))
    variance = (field**2).mean() + _SMOOTH**2
    steep = np.sort(np.abs(np.fft.irfft(fine * 1j * np.arange(len(fine)), len(r))))
    slopes = np.log(np.degrees(np.arctan(steep[[len(r) // 2, (9 * len(r)) // 10]])) + 1)
    return np.concatenate([0.5 * np.log(power + _SMOOTH**2), [(field**3).mean() / variance**1.5], slopes])


@lru_cache(maxsize=1)
def _sides() -> tuple[tuple[Floats, Floats], ...]:
    """Return the vectors to the right and up of pictures from evenly spread sides of a half sphere."""
    found = []
    for i in range(VIEWS):
        y = (i + 0.5) / VIEWS
        angle = i * np.pi * (3 - 5**0.5)
        ahead = np.array([np.sqrt(1 - y * y) * np.cos(angle), y, np.sqrt(1 - y * y) * np.sin(angle)])
        right = np.cross(ahead, [0.3, 0.1, 0.9])
        right /= np.linalg.norm(right)
        found.append((right, np.cross(right, ahead)))
    return tuple(found)
