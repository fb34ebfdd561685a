"""Skins to press together: plates, spheres, and contact over them."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from solver.dehydration.contact.data import make_contact
from solver.dehydration.contact.search import find_pairs

SINGLE = np.float32


def cubed_sphere(n):
    t = np.tan(np.linspace(-np.pi / 4, np.pi / 4, n + 1))
    a, b = np.meshgrid(t, t, indexing="ij")
    o = np.ones_like(a)
    faces = [(o, a, b), (-o, b, a), (b, o, a), (a, -o, b), (a, b, o), (b, a, -o)]
    points = np.concatenate([np.stack(f, -1).reshape(-1, 3) for f in faces])
    points /= np.linalg.norm(points, axis=1)[:, None]
    _, first, inverse = np.unique(np.round(points * 1e7).astype(int), axis=0, return_index=True, return_inverse=True)
    ids = inverse.reshape(6, n + 1, n + 1)
    quads = np.stack([ids[:, :-1, :-1], ids[:, 1:, :-1], ids[:, 1:, 1:], ids[:, :-1, 1:]], -1).reshape(-1, 4)
    points = points[first]
    c = points[quads]
    out = np.einsum("ij,ij->i", np.cross(c[:, 2] - c[:, 0], c[:, 3] - c[:, 1]), c.mean(1)) > 0
    return points, np.where(out[:, None], quads, quads[:, ::-1]).astype(np.int32)


def sheet(m, n):
    """Quads of an m x n grid of nodes, counter-clockwise seen from +z when i runs along x and j along y."""
    ids = np.arange(m * n).reshape(m, n)
    return np.stack([ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]], -1).reshape(-1, 4).astype(np.int32)


def state(points):
    x = np.zeros((len(points), 4), SINGLE)
    x[:, :3] = points
    return x


def touching(points, quads, clearance, **options):
    """Contact of a skin; parts that do not hang together are far from each other in the fresh fruit."""
    edges = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2)
    graph = coo_array((np.ones(len(edges)), edges.T), (len(points), len(points)))
    rest = points + 10.0 * connected_components(graph)[1][:, None] * [0, 0, 1]
    contact = make_contact(np.arange(len(points)), quads, rest, clearance, **options)
    assert find_pairs(contact, state(points)) <= len(contact.pairs)
    return contact


def two_plates(gap, rng, lower=9, upper=6, wave=0.0):
    """A plate facing up and a smaller one above it facing down; unit edges."""
    i, j = np.meshgrid(np.arange(lower), np.arange(lower), indexing="ij")
    below = np.stack([i, j, wave * np.sin(1.3 * i + 0.7 * j)], -1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(upper), np.arange(upper), indexing="ij")
    above = np.stack([i + 1.37, j + 1.21, gap + wave * np.cos(0.9 * i - 1.1 * j)], -1).reshape(-1, 3)
    quads = np.concatenate([sheet(lower, lower), sheet(upper, upper)[:, ::-1] + lower * lower])
    minv = rng.uniform(0.2, 0.4, len(below) + len(above)).astype(SINGLE)
    return np.concatenate([below, above]), quads.astype(np.int32), minv, lower * lower


def grooved(points, width):
    """A closed skin with a groove around its waist, half as deep as the body and 2 width wide at its mouth."""
    polar = np.arcsin(np.clip(abs(points[:, 2]), 0, 1))
    floor, rim, top = 0.15, 0.65, np.pi / 2
    z = 0.15 * np.minimum(polar / floor, 1) + (width - 0.15) * np.clip((polar - floor) / (rim - floor), 0, 1)
    r = 0.5 + 0.5 * np.clip((polar - floor) / (rim - floor), 0, 1)
    cap = np.clip((polar - rim) / (top - rim), 0, 1) * np.pi / 2
    r, z = np.where(cap > 0, np.cos(cap), r), z + 0.8 * np.sin(cap)
    around = points[:, :2] / (np.linalg.norm(points[:, :2], axis=1, keepdims=True) + 1e-12)
    return np.column_stack([around * r[:, None], np.sign(points[:, 2]) * z])
