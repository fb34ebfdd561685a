"""An approximate inverse of a shell's tangent: motions along the normals and within the surface apart.

Of the tangent K two matrices with one number per pair of vertices are kept: n_i . K_ij n_j for normal motions, and half
the trace of P_i K_ij P_j, P = 1 - n n^T, for those within the surface, which treats both of their directions alike.
Both are positive semidefinite if K is. Against a factor of K that is a ninth of the numbers and a twenty-seventh of
the work; as the start of L-BFGS it takes about half as many iterations more (docs/growth.md). Duff and Reid 1983
(multifrontal Cholesky).
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .dissection import Fronts, dissect
from .pattern import Pattern
from .topology import Topology

__all__ = ["Inverse", "fronts_of", "inverse_of", "normals"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Multiplications of one piece of a factorisation: some milliseconds.
_PIECE = 5_000_000
#: Pivots below are taken for 1 [mu].
_FLOOR = 1e-8
#: Entries beyond are those of triangles without area [mu].
_MOST = 1e12
#: What a new vertex gives alone under a force: about the inverse of a membrane's diagonal [1 / mu].
_SOFT = 0.2


def fronts_of(mesh: Topology, x: Floats) -> Fronts:
    """Return the order of elimination for meshes that lie about where x (n, 3) does."""
    t = mesh.triangles
    # a triangle without neighbours is in no hinge, a vertex without triangles in neither
    lone = np.setdiff1d(np.arange(len(t)), mesh.hinge_faces)
    bare = np.setdiff1d(np.arange(mesh.vertices), t)
    parts = np.concatenate([mesh.hinges, t[lone][:, [0, 1, 2, 2]], np.repeat(bare[:, None], 4, axis=1)])
    return dissect(parts, x[parts].mean(axis=1), mesh.vertices)


def normals(x: Floats, triangles: Ints) -> Floats:
    """Return unit normals (n, 3) of vertices; of vertices without area the z axis."""
    found = np.zeros_like(x)
    _normals(x, triangles, found)
    return found


@dataclass(frozen=True, eq=False)
class Inverse:
    """Factors L L^T of both matrices; across: normal, within: tangential motions. normals: (n, 3).

    parents: after remeshing, for each change the pair (n', 2) of old vertices in the middle of which each new one lies
    (twice the same for one that stayed): the inverse then acts on what the old vertices can do.
    """

    fronts: Fronts
    normals: Floats
    across: NDArray[np.float32]
    within: NDArray[np.float32]
    parents: tuple[Ints, ...] = ()

    def apply(self, right: Floats) -> Floats:
        """Return the approximate inverse applied to `right` (n, 3)."""
        rights = [right]
        counts = [len(self.normals), *(len(pairs) for pairs in self.parents)]
        for pairs, count in zip(reversed(self.parents), reversed(counts[:-1]), strict=True):
            rights.append(_gathered(rights[-1], pairs, count))
        found = np.empty((counts[0], 3))
        f = self.fronts
        _apply(rights[-1], self.normals, f.nodes, f.starts, f.own, f.widest, self.across, self.within, found)
        for pairs, own in zip(self.parents, reversed(rights[:-1]), strict=True):
            found = 0.5 * (found[pairs[:, 0]] + found[pairs[:, 1]])
            new = pairs[:, 0] != pairs[:, 1]
            found[new] += _SOFT * own[new]
        return found

    def remeshed(self, pairs: Ints) -> Inverse:
        """Return the inverse for a mesh whose vertices lie in the middle of `pairs` (n', 2) of the present ones."""
        return replace(self, parents=(*self.parents, pairs))


def inverse_of(
    fronts: Fronts, pattern: Pattern, blocks: Floats, n: Floats, held: NDArray[np.bool_]
) -> Generator[None, None, Inverse]:
    """Factor the tangent with `blocks` (nnz, 3, 3), n: normals (n, 3); yields after pieces of bounded work.

    held: (n,) vertices that do not move. The generator's value is the Inverse. Raises numpy.linalg.LinAlgError if a
    matrix is not finite.
    """
    across, within = np.empty(pattern.blocks), np.empty(pattern.blocks)
    _reduce(blocks, n, pattern.indptr, pattern.indices, held, across, within)
    yield
    first = yield from _factor(fronts, pattern, across)
    second = yield from _factor(fronts, pattern, within)
    return Inverse(fronts, n, first, second)


def _factor(fronts: Fronts, pattern: Pattern, data: Floats) -> Generator[None, None, NDArray[np.float32]]:
    total = fronts.starts[-1]
    values = np.empty(total[1], np.float32)
    complements = np.empty(total[2])
    place = np.full(len(pattern.diagonal), -1)
    size, own = np.diff(fronts.starts[:, 0]), fronts.own
    # sum over the eliminated columns of what is left, squared
    work = np.cumsum((size**3 - (size - own) ** 3) / 3 + size**2)
    at = 0
    while at < fronts.count:
        done = work[at - 1] if at else 0.0
        end = max(at + 1, int(np.searchsorted(work, done + _PIECE)))
        good = _eliminate(
            at,
            end,
            fronts.nodes,
            fronts.starts,
            own,
            fronts.children,
            pattern.indptr,
            pattern.indices,
            data,
            place,
            complements,
            values,
        )
        if not good:
            raise np.linalg.LinAlgError("the tangent is not finite")
        at = end
        yield
    return values


def _gathered(right: Floats, pairs: Ints, count: int) -> Floats:
    """Return what the old vertices (count, 3) feel of forces on the new ones: half of those of their children."""
    both = [np.bincount(pairs.ravel(), np.repeat(0.5 * right[:, d], 2), count) for d in range(3)]
    return np.stack(both, -1)


@njit(cache=True, error_model="numpy")
def _normals(x: Floats, triangles: Ints, found: Floats) -> None:
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay, az = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        bx, by, bz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
        for v in (i, j, k):
            found[v, 0] += ay * bz - az * by
            found[v, 1] += az * bx - ax * bz
            found[v, 2] += ax * by - ay * bx
    for v in range(len(found)):
        size = np.sqrt(found[v, 0] ** 2 + found[v, 1] ** 2 + found[v, 2] ** 2)
        if size > 0:
            for d in range(3):
                found[v, d] /= size
        else:
            found[v, 0], found[v, 1], found[v, 2] = 0.0, 0.0, 1.0


@njit(cache=True)
def _reduce(
    blocks: Floats, n: Floats, indptr: Ints, indices: Ints, held: NDArray[np.bool_], across: Floats, within: Floats
) -> None:
    """Write n_i K n_j and the trace of P_i K P_j / 2 of each block."""
    for i in range(len(n)):
        for at in range(indptr[i], indptr[i + 1]):
            j = indices[at]
            if held[i] or held[j]:
                across[at] = within[at] = 1.0 if i == j else 0.0
                continue
            k = blocks[at]
            trace, both, left, right, cosine = k[0, 0] + k[1, 1] + k[2, 2], 0.0, 0.0, 0.0, 0.0
            for d in range(3):
                cosine += n[i, d] * n[j, d]
                for h in range(3):
                    both += n[i, d] * k[d, h] * n[j, h]
                    left += n[i, d] * k[d, h] * n[i, h]
                    right += n[j, d] * k[d, h] * n[j, h]
            within[at] = 0.5 * (trace - left - right + cosine * both)
            across[at] = both
            # triangles without area bend without bound: they are left to themselves
            if not (abs(across[at]) < _MOST and abs(within[at]) < _MOST):
                across[at] = within[at] = _MOST if i == j else 0.0


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _eliminate(
    first: int,
    last: int,
    nodes: Ints,
    starts: Ints,
    own: Ints,
    children: Ints,
    indptr: Ints,
    indices: Ints,
    data: Floats,
    place: Ints,
    complements: Floats,
    values: NDArray[np.float32],
) -> bool:
    """Eliminate fronts first to last - 1; returns whether all pivots were finite. place (n,): -1 on entry and exit.

    Fronts are symmetric; row c of w holds column c from the diagonal on.
    """
    for f in range(first, last):
        begin, pivots = starts[f, 0], own[f]
        size = starts[f + 1, 0] - begin
        if size == 0:
            continue
        w = np.zeros((size, size))
        for r in range(size):
            place[nodes[begin + r]] = r
        for c in range(pivots):
            node = nodes[begin + c]
            for at in range(indptr[node], indptr[node + 1]):
                r = place[indices[at]]
                if r >= c:
                    w[c, r] += data[at]
        for child in children[f]:
            if child < 0:
                continue
            lead = starts[child, 0] + own[child]
            wide = starts[child + 1, 0] - lead
            at = starts[child, 2]
            for c in range(wide):
                column = place[nodes[lead + c]]
                for r in range(c, wide):
                    row = place[nodes[lead + r]]
                    w[min(row, column), max(row, column)] += complements[at + c * wide + r]
        for r in range(size):
            place[nodes[begin + r]] = -1
        # four columns at a time, so that the rest of the front is read and written a fourth as often
        for p in range(0, pivots, 4):
            q = min(p + 4, pivots)
            for c in range(p, q):
                if np.isnan(w[c, c]):
                    return False
                # the matrices are semidefinite: what is below is rounding, of slivers mostly
                if w[c, c] < _FLOOR:
                    w[c, c:] = 0.0
                    w[c, c] = 1.0
                column = w[c, c:]
                column /= np.sqrt(w[c, c])
                for e in range(c + 1, q):
                    a, row, tail = w[c, e], w[e, e:], w[c, e:]
                    for r in range(len(row)):
                        row[r] -= a * tail[r]
            if q - p == 4:
                for e in range(q, size):
                    row, w0, w1, w2, w3 = w[e, e:], w[p, e:], w[p + 1, e:], w[p + 2, e:], w[p + 3, e:]
                    a0, a1, a2, a3 = w0[0], w1[0], w2[0], w3[0]
                    for r in range(len(row)):
                        row[r] -= a0 * w0[r] + a1 * w1[r] + a2 * w2[r] + a3 * w3[r]
            else:
                for c in range(p, q):
                    for e in range(q, size):
                        a, row, tail = w[c, e], w[e, e:], w[c, e:]
                        for r in range(len(row)):
                            row[r] -= a * tail[r]
        at = starts[f, 1]
        for c in range(pivots):
            for r in range(c, size):
                values[at] = w[c, r]
                at += 1
        at = starts[f, 2]
        wide = size - pivots
        for c in range(wide):
            for r in range(c, wide):
                complements[at + c * wide + r] = w[pivots + c, pivots + r]
    return True


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _apply(
    right: Floats,
    n: Floats,
    nodes: Ints,
    starts: Ints,
    own: Ints,
    widest: int,
    across: NDArray[np.float32],
    within: NDArray[np.float32],
    found: Floats,
) -> None:
    """Solve both systems at once: three right sides within, one across."""
    count = len(right)
    x = np.empty((count, 4), np.float32)
    # the factors are single: what is solved is scaled, so that no size of gradient leaves their range
    largest = 0.0
    for v in range(count):
        for d in range(3):
            largest = max(largest, abs(right[v, d]))
    if largest == 0.0:
        found[:] = 0.0
        return
    for v in range(count):
        a = right[v, 0] * n[v, 0] + right[v, 1] * n[v, 1] + right[v, 2] * n[v, 2]
        for d in range(3):
            x[v, d] = (right[v, d] - a * n[v, d]) / largest
        x[v, 3] = a / largest
    p0, p1 = np.empty(widest, np.float32), np.empty(widest, np.float32)
    p2, p3 = np.empty(widest, np.float32), np.empty(widest, np.float32)
    for f in range(len(own)):
        begin, pivots, at = starts[f, 0], own[f], starts[f, 1]
        size = starts[f + 1, 0] - begin
        for r in range(size):
            v = nodes[begin + r]
            if r < pivots:
                p0[r], p1[r], p2[r], p3[r] = x[v, 0], x[v, 1], x[v, 2], x[v, 3]
            else:
                p0[r] = p1[r] = p2[r] = p3[r] = np.float32(0)
        for c in range(pivots):
            one, two = within[at : at + size - c], across[at : at + size - c]
            p0[c] /= one[0]
            p1[c] /= one[0]
            p2[c] /= one[0]
            p3[c] /= two[0]
            a0, a1, a2, a3 = p0[c], p1[c], p2[c], p3[c]
            # apart, for more arrays in one loop are not vectorised
            q0, q1, q2, q3 = p0[c:size], p1[c:size], p2[c:size], p3[c:size]
            for r in range(1, len(one)):
                q0[r] -= one[r] * a0
                q1[r] -= one[r] * a1
                q2[r] -= one[r] * a2
            for r in range(1, len(two)):
                q3[r] -= two[r] * a3
            at += size - c
        for r in range(size):
            v = nodes[begin + r]
            if r < pivots:
                x[v, 0], x[v, 1], x[v, 2], x[v, 3] = p0[r], p1[r], p2[r], p3[r]
            else:
                x[v, 0] += p0[r]
                x[v, 1] += p1[r]
                x[v, 2] += p2[r]
                x[v, 3] += p3[r]
    for f in range(len(own) - 1, -1, -1):
        begin, pivots, at = starts[f, 0], own[f], starts[f + 1, 1]
        size = starts[f + 1, 0] - begin
        for r in range(size):
            v = nodes[begin + r]
            p0[r], p1[r], p2[r], p3[r] = x[v, 0], x[v, 1], x[v, 2], x[v, 3]
        for c in range(pivots - 1, -1, -1):
            at -= size - c
            one, two = within[at : at + size - c], across[at : at + size - c]
            a0, a1, a2, a3 = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
            q0, q1, q2, q3 = p0[c:size], p1[c:size], p2[c:size], p3[c:size]
            for r in range(1, len(one)):
                a0 += one[r] * q0[r]
                a1 += one[r] * q1[r]
                a2 += one[r] * q2[r]
                a3 += two[r] * q3[r]
            p0[c] = (p0[c] - a0) / one[0]
            p1[c] = (p1[c] - a1) / one[0]
            p2[c] = (p2[c] - a2) / one[0]
            p3[c] = (p3[c] - a3) / two[0]
        for r in range(pivots):
            v = nodes[begin + r]
            x[v, 0], x[v, 1], x[v, 2], x[v, 3] = p0[r], p1[r], p2[r], p3[r]
    for v in range(count):
        a = x[v, 0] * n[v, 0] + x[v, 1] * n[v, 1] + x[v, 2] * n[v, 2]
        for d in range(3):
            found[v, d] = largest * (x[v, d] + (x[v, 3] - a) * n[v, d])
