"""A table's worth of wrinkles that have nothing in common from one sample to the next."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import xarray as xr
from scipy.special import sph_harm_y

from solver.contract import finish
from solver.dehydration import SOLVER
from solver.fruit import azimuths, colatitudes, directions, lattice
from store.blending.methods.weights import Samples
from store.store import Store
from store.surfaces import harmonics

from .conftest import GAMMA, STAGES, TE, _spec, question

N = 32


@lru_cache(maxsize=64)
def pattern(seed: int, middle: float, rms: float) -> np.ndarray:
    """Return radial wrinkles (N, 2N) of random phases around a degree."""
    rng = np.random.default_rng(seed)
    theta, phi = lattice(N)
    field = np.zeros_like(theta)
    for degree in range(4, 18):
        size = np.exp(-(((degree - middle) / 2) ** 2))
        for order in range(degree + 1):
            turn = rng.uniform(0, 2 * np.pi)
            field += size * rng.standard_normal() * sph_harm_y(degree, order, theta, phi + turn).real
    found: np.ndarray = field * rms / np.sqrt((harmonics.area(N) * field**2).sum())
    found.flags.writeable = False
    return found


def own(i: int, j: int, shared: float = 0.0) -> np.ndarray:
    """Return the radial wrinkles (N, 2N) of a sample at s = 1, of which it has a `shared` part with all others."""
    rms = 0.9 * TE[i]
    alone = pattern(10 * i + j, 0.3 / TE[i], rms)
    return shared * pattern(99, 0.3 / TE[1], rms) + (1 - shared**2) ** 0.5 * alone if shared else alone


def at(i: int, j: int, stage: float, shared: float = 0.0, turning: float = 0.0, onset: float = 0.0) -> np.ndarray:
    """Return the displacement (N, 2N, 3) of a sample; its pattern becomes another one, `turning` by stage [rad]."""
    radial = own(i, j, shared)
    if turning:
        other = pattern(10 * i + j + 50, 0.3 / TE[i], 0.9 * TE[i])
        radial = np.cos(turning * stage) * radial + np.sin(turning * stage) * other
    found: np.ndarray = (max(stage - onset, 0) * radial - 0.5 * stage)[..., None] * directions(*lattice(N))
    return found


def wrinkled(
    store: Store, onset: float = 0.0, shared: float = 0.0, turning: float = 0.0
) -> dict[tuple[float, float], np.ndarray]:
    """Fill a store with patterns that have nothing in common but how rough and how fine they are, and what they
    `shared`.
    """
    fields = {}
    for i, te in enumerate(TE):
        for j, gamma in enumerate(GAMMA):
            u = np.stack([at(i, j, s, shared, turning, onset) for s in STAGES])
            params, need = question(te=te, gamma=gamma, resolution=N)
            coords = {"stage": list(STAGES), "colatitude": colatitudes(N), "azimuth": azimuths(N)}
            data = {"displacement": (("stage", "colatitude", "azimuth", "component"), u.astype(np.float32))}
            result = finish(xr.Dataset(data, {**coords, "component": ["x", "y", "z"]}), SOLVER, params, need)
            job = _spec(params, need)
            store.ledger.want([job])
            store.ledger.done(store.ledger.claim("tester", 60, [job.key]), store.put(job.key, result), 1.0)
            fields[te, gamma] = u
    return fields


def grid() -> Samples:
    """Samples of three te by two gamma."""
    te, gamma = np.meshgrid([0.02, 0.04, 0.08], [10.0, 100.0], indexing="ij")
    return Samples(np.stack([te.ravel(), gamma.ravel()], axis=-1))
