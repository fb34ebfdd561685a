"""What a stored wrinkle pattern is like beyond its descriptors: how long its pits are, and where on the fruit."""

from __future__ import annotations

import json
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy import ndimage

from solver.dehydration.fresh.mesh import inner_distance
from solver.dehydration.measures.harmonics import remove_low
from solver.dehydration.params import DehydrationParams
from solver.fruit import PRESETS, azimuths, colatitudes

Array = NDArray[np.float64]

LOWEST_DEGREE = 3
#: Colatitudes [degree] that count as the poles (nearer than this) and the equator (nearer to 90 than this).
POLES, EQUATOR = 35.0, 30.0
#: Degrees below this are the fruit's shape on a stone that is not round, not wrinkles.
SHAPE_DEGREE = 12
#: Pits smaller than this share of the mean one say nothing about their shape.
SMALL = 0.25


class Pattern(NamedTuple):
    """One sample at one stage, and how it was run."""

    name: str
    seed: int
    quality: str
    mirrors: str
    version: str
    converged: bool
    te: float
    gamma: float
    stone: tuple[float, float]
    waist: float
    buckles: float
    wavelength: float
    roughness: float
    elongation: float
    poles_to_equator: float
    equator_anisotropy: float
    polar_anisotropy: float
    thick_to_thin: float
    residual: float
    penetration: float


def pattern(data: xr.Dataset) -> Pattern:
    """Return the pattern of a result at one stage."""
    params = DehydrationParams.model_validate(json.loads(data.attrs["params"]))
    shift = np.asarray(data["displacement"].values, float)
    n = len(shift)
    theta, phi = np.meshgrid(colatitudes(n), azimuths(n), indexing="ij")
    fresh = params.surface(theta, phi)
    ray = fresh / np.linalg.norm(fresh, axis=-1, keepdims=True)
    height = remove_low(np.einsum("tpi,tpi->tp", shift, ray), LOWEST_DEGREE)
    along = np.linalg.norm(np.gradient(fresh, np.pi / n, axis=0), axis=-1)
    around = np.linalg.norm(_around(fresh), axis=-1)
    area = along * around
    latitude = np.abs(np.degrees(theta) - 90)
    poles, equator = latitude > 90 - POLES, latitude < EQUATOR
    # directions lose their meaning at the poles themselves
    ring = (latitude > 45) & (latitude < 75)
    slopes = np.gradient(height, np.pi / n, axis=0) / along, _around(height) / around

    flesh = np.linalg.norm(fresh, axis=-1) - inner_distance(params, ray)
    thick = flesh > np.median(flesh)
    waves = remove_low(height, SHAPE_DEGREE)

    def rms(where: NDArray[np.bool_], of: Array = height) -> float:
        return float(np.sqrt((area * of**2)[where].sum() / area[where].sum()))

    def anisotropy(where: NDArray[np.bool_]) -> float:
        a, b = ((area * slope**2)[where].sum() for slope in slopes)
        return float((b - a) / (b + a))

    return Pattern(
        name=name_of(params),
        seed=params.seed,
        quality=str(json.loads(data.attrs["need"])["quality"]),
        mirrors=params.mirrors,
        version=str(data.attrs["solver_version"]),
        converged=bool(data["converged"]),
        te=params.exocarp_thickness,
        gamma=params.modulus_ratio,
        stone=params.stone,
        waist=params.radii[3],
        buckles=float(data["buckle_count"]),
        wavelength=float(data["wavelength"]),
        roughness=float(data["roughness"]),
        elongation=_elongation(height, area, fresh),
        poles_to_equator=rms(poles) / rms(equator),
        equator_anisotropy=anisotropy(equator),
        polar_anisotropy=anisotropy(ring),
        thick_to_thin=rms(thick, waves) / rms(~thick, waves),
        residual=float(data["residual"]),
        penetration=float(data["penetration"]) / params.exocarp_thickness,
    )


def name_of(params: DehydrationParams) -> str:
    """Name of the preset with these radii and stone, or nothing."""
    for name, preset in PRESETS.items():
        if name == "passionfruit":  # a sphere without a stone need not be one
            continue
        if tuple(preset["radii"]) == params.radii and tuple(preset["stone"]) == params.stone:
            return name
    return ""


def _around(field: Array) -> Array:
    """Derivative along the periodic azimuth (axis 1) of a lattice field (n, 2n, ...)."""
    return (np.roll(field, -1, axis=1) - np.roll(field, 1, axis=1)) / (4 * np.pi / field.shape[1])


def _elongation(height: Array, area: Array, fresh: Array) -> float:
    """Area-weighted mean of length over width of the pits, parts that lie lower than half the rms; 1 is round."""
    rms = np.sqrt((area * height**2).sum() / area.sum())
    # each ring once more on either side, so that a pit across the seam is whole in the middle copy
    low = np.concatenate([height < -0.5 * rms] * 3, axis=1)
    labels, count = ndimage.label(low)
    width = height.shape[1]
    middle = labels[:, width : 2 * width]
    ratios, sizes = [], []
    for label in range(1, count + 1):
        if not (middle == label).any():
            continue
        rows, columns = np.nonzero(labels == label)
        if columns.min() < width // 2 or columns.min() >= width + width // 2 or np.ptp(columns) >= width:
            continue  # the copy that begins in the middle stands for all; what goes all round has no ends
        columns = columns % width
        weight = area[rows, columns]
        points = fresh[rows, columns]
        points = points - np.average(points, axis=0, weights=weight)
        spread = np.linalg.eigvalsh(np.einsum("n,ni,nj->ij", weight, points, points) / weight.sum())
        ratios.append(np.sqrt(spread[2] / max(spread[1], 1e-12)))
        sizes.append(weight.sum())
    if not ratios:
        return 1.0
    size = np.array(sizes)
    real = size > SMALL * size.mean()
    return float(np.average(np.array(ratios)[real], weights=size[real]))
