"""What was painted or photographed of a fruit: its wounds and its nutrients, at the points of skin and flesh (D60)."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from ...painted import painted, photographed
from ..params import DecayParams
from ..surfaces.imported import rays_from

__all__ = ["fed", "opened_skin", "seen"]


def seen(params: DecayParams, points: Floats) -> Floats:
    """Return the directions (v, 3) that a mesh is seen in: from its own middle, what is cut from the fruit's."""
    if not params.cuts:
        return rays_from(points)
    return np.asarray(points / np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 1e-12))


def opened_skin(params: DecayParams, rays: Floats) -> Floats | None:
    """Return where wounds are painted or photographed (v), 0 to 1; None where they are not."""
    found = painted(params.wound_map, rays) if params.wound_map else None
    if params.wound_photo is None:
        return found
    shown = photographed(params.wound_photo, rays, 0.0)
    return shown if found is None else np.maximum(found, shown)


def fed(params: DecayParams, rays: Floats, points: Floats) -> Floats | None:
    """Return what the fresh nutrient is multiplied by at points (n, 3), the first the skin's, seen along `rays`.

    None where nothing is painted or photographed. A photograph counts over its mean.
    """
    if not params.nutrient_map and params.nutrient_photo is None:
        return None
    below, factor = points[len(rays) :], np.ones(len(points))
    away = below / np.maximum(np.linalg.norm(below, axis=1, keepdims=True), 1e-12)
    rays = np.concatenate([rays, away])
    if params.nutrient_map:
        factor = factor * painted(params.nutrient_map, rays)
    if params.nutrient_photo is not None:
        mean = max(float(np.mean(params.nutrient_photo.values)), 1e-6)
        factor = factor * photographed(params.nutrient_photo, rays, mean) / mean
    return factor
