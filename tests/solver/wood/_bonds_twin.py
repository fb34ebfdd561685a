"""Energies of bonds in plain numpy: each rod's piece as a cubic with slopes by `numpy.gradient`, bond after bond."""

import numpy as np

from solver.wood.model.state import Wood


def pieces(wood: Wood) -> list[list[int]]:
    """Return the edges of each piece of a rod that whole hinges join, ghosts among them."""
    follows = {int(p): int(q) for p, q, w in zip(wood.rods.before, wood.rods.after, wood.rods.whole, strict=True) if w}
    found = []
    for e in sorted(set(range(len(wood.rods.a))) - set(follows.values())):
        chain = [e]
        while chain[-1] in follows:
            chain.append(follows[chain[-1]])
        found.append(chain)
    return found


def _length(d: np.ndarray) -> np.ndarray:
    # analytic, so that it takes complex numbers
    return np.sqrt((d * d).sum(-1))


def curves(wood: Wood, x: np.ndarray) -> dict[int, tuple[np.ndarray, ...]]:
    """Return of each edge its rest length, its ends and slopes there; ghosts, which may carry stubs, are straight."""
    r, found = wood.rods, {}
    for g in np.flatnonzero(r.k == 0):
        ends = x[r.a[g]], x[r.b[g]]
        slope = (ends[1] - ends[0]) / r.rest[g]
        found[int(g)] = (r.rest[g], *ends, slope, slope)
    for chain in pieces(wood):
        real = [e for e in chain if r.k[e] > 0]
        if not real:
            continue
        vertices = [r.a[real[0]], *(r.b[e] for e in real)]
        y, s = x[vertices], np.concatenate([[0], np.cumsum(r.rest[real])])
        m = np.gradient(y, s, axis=0, edge_order=2) if len(real) > 1 else np.tile((y[1] - y[0]) / s[1], (2, 1))
        for g in (e for e in chain if r.k[e] == 0):
            way = x[r.b[g]] - x[r.a[g]]
            way = way / _length(way)
            first = g == chain[0]
            e = y[1] - y[0] if first else y[-1] - y[-2]
            m[0 if first else -1] = way * (way * e).sum() / r.rest[real[0 if first else -1]]
            if len(real) == 1:
                # one parabola to the end that is free
                m[-1 if first else 0] = 2 * e / s[1] - m[0 if first else -1]
        for n, e in enumerate(real):
            found[e] = (r.rest[e], y[n], y[n + 1], m[n], m[n + 1])
    return found


def bond_energies(wood: Wood, x: np.ndarray) -> np.ndarray:
    """Return the energy (b,) [J] of each bond with vertices at x (v, 3), which may be complex."""
    b, at = wood.bonds, curves(wood, x)

    def point(edge: int, u: float) -> tuple[np.ndarray, np.ndarray]:
        h, y0, y1, m0, m1 = at[edge]
        v = min(max(u, 0.0), 1.0)
        place = (1 + 2 * v) * (1 - v) ** 2 * y0 + v * v * (3 - 2 * v) * y1
        place = place + h * v * (1 - v) ** 2 * m0 - h * v * v * (1 - v) * m1
        slope = 6 * v * (1 - v) * (y1 - y0) / h + (1 - v) * (1 - 3 * v) * m0 + v * (3 * v - 2) * m1
        return place + (u - v) * h * slope, slope

    out = np.zeros(len(b.i), x.dtype)
    for n in np.flatnonzero(b.on):
        (one, m0), (other, m1) = point(int(b.i[n]), float(b.at[n])), point(int(b.j[n]), float(b.share[n]))
        d = one - other
        apart = _length(d)
        shear = (d * (m0 + m1)).sum() / 2 / apart - b.cosine[n]
        keep = 1 - b.damage[n]
        straight = 0.5 * b.k[n] * (apart / b.rest[n] - 1) ** 2 * b.rest[n]
        out[n] = straight * (keep if apart.real > b.rest[n] else 1) + keep * b.s[n] * shear**2
    return out
