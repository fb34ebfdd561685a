"""How far a table can be trusted: every sample predicted from the others, and how alike neighbours are.

A sample is predicted from its neighbours on both sides, so over twice the table's spacing; one at a corner has none
and is extrapolated. Both err more than a query between the samples does, never less. Likewise a stored stage of a
sample is predicted from the stages beside it, over twice the way from one to the next.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from solver.arrays import Array
from solver.contract import Fresh
from solver.lattice import lattice
from solver.rounding import from_zero, towards_zero

from ..blending.blend import Blend, Blender, complex_view
from ..blending.methods import DEFAULT, Method, parse
from ..blending.methods.weights import Samples
from ..blending.neighbours import Weighted
from ..errors import OutsideTable, TooUncertain
from ..surfaces import harmonics
from ..surfaces.measures import Measures, Surface, compare, lattice_for
from ..surfaces.packed import Stored
from ..surfaces.window import WHOLE

__all__ = [
    "COVERED",
    "Trust",
    "correlations",
    "errors",
    "foretold",
    "fresh",
    "leave_one_out",
    "refuse",
    "skip_a_stage",
    "surface_of",
]


def errors(found: Measures) -> dict[str, float]:
    """Return measures as errors, all zero for a perfect answer: |rgh - 1|, 1 - corr, and the others as they are."""
    return {**found._asdict(), "rgh": abs(found.rgh - 1), "corr": 1 - found.corr}


def _errors_of(found: Array) -> Array:
    """Return measures (sample, stage, measure) as errors."""
    return np.array([[list(errors(Measures(*row)).values()) for row in rows] for rows in found])


def surface_of(blend: Blend, start: Array) -> Surface:
    """Return a blend as a surface over fresh positions `start` (n, 2n, 3)."""
    with blend.fields(WHOLE.on(len(start))) as planes:
        return Surface(start, np.moveaxis(planes, 0, -1))


def leave_one_out(blender: Blender, stored: Stored, samples: Samples, shapes: list[Fresh], method: Method) -> Array:
    """Return measures (sample, stage, measure) of every sample predicted by the others.

    The log-linear fit behind LL is that of the whole table.
    """
    rows, n = [], _lattice(stored)
    for i, shape in enumerate(shapes):
        others, start, point = samples.without(i, method.weighting), fresh(shape, n), samples.values[i]
        rows.append(
            [
                compare(
                    surface_of(blender(point, blender.mix(point, others, (j,), method, i), {j: 1.0}, method), start),
                    surface_of(Blend(complex_view(stored[i, j])), start),
                )
                for j in range(stored.shape[1])
            ]
        )
    return np.array(rows)


def skip_a_stage(
    blender: Blender, stored: Stored, samples: Samples, shapes: list[Fresh], stages: Sequence[float], method: Method
) -> Array | None:
    """Return measures (sample, stage, measure) of every sample's stages predicted from the two beside each.

    The fresh shape is one, at s = 0. The first or last stage, which has none on one side, stands for what its
    neighbour does. None where no stage has one on both sides.
    """
    knots = sorted({0.0, *stages})
    inner = [j for j, s in enumerate(stages) if knots[0] < s < knots[-1]]
    if not inner:
        return None
    rows = []
    for i, shape in enumerate(shapes):
        start, point = fresh(shape, _lattice(stored)), samples.values[i]
        alone = Weighted(np.array([i]), np.ones(1), 0.0)
        found = []
        for j in inner:
            at = knots.index(stages[j])
            low, high = knots[at - 1], knots[at + 1]
            part = (stages[j] - low) / (high - low)
            beside = {s: t for s, t in ((low, 1 - part), (high, part)) if s in stages}
            shares = {list(stages).index(s): t for s, t in beside.items()}
            made = blender(point, blender.mix(point, alone, tuple(shares), method), shares, method)
            found.append(compare(surface_of(made, start), surface_of(Blend(complex_view(stored[i, j])), start)))
        rows.append([found[min(range(len(inner)), key=lambda k: abs(inner[k] - j))] for j in range(len(stages))])
    return np.array(rows)


def fresh(shape: Fresh, n: int) -> Array:
    """Return a fresh surface (n, 2n, 3)."""
    return shape.points(*lattice(n))


def _lattice(stored: Stored) -> int:
    """Return the lattice on which spectra (sample, stage, component, m, k, part) are compared."""
    return lattice_for(stored.shape[-2] - 1)


def correlations(stored: Stored, samples: Samples, shapes: list[Fresh]) -> Array:
    """Return the mean correlation (stage,) of the radial wrinkles of neighbouring samples."""
    pairs, starts = samples.adjacent(), [fresh(shape, _lattice(stored)) for shape in shapes]
    found = np.empty((len(pairs), stored.shape[1]))
    for j in range(stored.shape[1]):
        seen = [surface_of(Blend(complex_view(stored[i, j])), start).wrinkles for i, start in enumerate(starts)]
        norms = [float(np.sqrt(_dot(w, w))) + 1e-12 for w in seen]
        found[:, j] = [_dot(seen[a], seen[b]) / (norms[a] * norms[b]) for a, b in pairs]
    value: Array = found.mean(axis=0)
    return value


def _dot(a: Array, b: Array) -> float:
    return float((harmonics.area(len(a)) * a * b).sum())


#: Errors below this are none.
_NOTHING = 1e-9
#: Share of errors that the expected one covers.
COVERED = 0.9
#: Defaults of older tables, which hold their errors. They stand for the present one's: those of runs held out lie
#: within what they foretell (record dehydration-calibration); slopes far outside of the samples may not.
_FORMER = ("linear+LL+env", "thin+LL+env")


def foretold(found: Array, method: str, samples: Samples) -> tuple[Array, Array]:
    """Return the errors (sample, stage, measure) that leave-one-out measures stand for, and for each sample those that
    the other samples' let expect there.
    """
    own = _errors_of(found)
    others = [samples.without(i, parse(method).weighting) for i in range(len(own))]
    # weights that extrapolate may be negative: an error is none the less for that
    expected = [np.maximum(np.tensordot(near.weights, own[near.samples], 1), 0) for near in others]
    return own, np.array(expected)


class Trust:
    """Leave-one-out measures (sample, stage, measure) of a table, interpolated to queries; and those of stages that
    were skipped, where it knows them.

    What neighbours' errors foretell of a sample's is a mean: half of the samples err more. So what is said is that many
    times larger, the same factor in the whole table, that it covers `COVERED` of them. What a stage half-way between
    two stored ones errs by is within what the worse of these errs by over twice the way (record
    dehydration-calibration); nearer to one it is less.
    """

    def __init__(self, found: Array, method: str, samples: Samples, skipped: Array | None = None) -> None:
        self.method = method
        self._skipped = None if skipped is None else _errors_of(skipped)
        own, expected = foretold(found, method, samples)
        ratios = (own / np.maximum(expected, _NOTHING)).reshape(-1, own.shape[-1])
        own = own * np.maximum(np.quantile(ratios, COVERED, axis=0), 1.0)
        # side by side: the errors by stage, and the spacing
        self._rows = np.column_stack([own.reshape(len(own), -1), samples.spacing])

    def knows(self, method: str) -> bool:
        """Return whether the table knows what errors of that method to expect."""
        return method == self.method or (method == DEFAULT and self.method in _FORMER)

    def expect(self, near: Weighted, stages: Mapping[int, float]) -> dict[str, float] | None:
        """Return what errors of each measure hardly exceed: nothing at a stored stage of a sample, most of them a whole
        spacing away or half-way between two stages.

        `stages` are shares by place, that of the fresh shape, which takes part before the first one, below 0. None
        between two stages of a table that knows nothing of what lies between them.
        """
        *own, spacing = (near.weights @ self._rows[near.samples]).tolist()
        share, count = min(near.nearest / spacing, 1.0), len(Measures._fields)
        stored = {j: t for j, t in stages.items() if j >= 0}
        between = [0.0] * count
        if len(stages) > 1:
            if self._skipped is None:
                return None
            rows = self._skipped[near.samples][:, list(stored)]
            # weights that extrapolate may be negative: an error is none the less for that
            worse = np.abs(near.weights) @ rows.max(axis=1)
            between = (4 * float(np.prod(list(stages.values()))) * worse).tolist()
        return {
            name: between[k] + share * sum(t * own[count * j + k] for j, t in stored.items())
            for k, name in enumerate(Measures._fields)
        }


def refuse(
    expected: Mapping[str, float] | None,
    limit: float | Mapping[str, float] | None,
    inside: bool,
    known: str | None,
    between: Sequence[float] = (),
) -> None:
    """Refuse an answer that is worse than asked for; a number limits the error of the roughness, None nothing.

    `known` is the method whose errors the table holds, if it holds any; `between` the stages on both sides of the one
    that is asked for, where the table holds errors of the method but none of this very stage.

    Raises:
        TooUncertain: an expected error is above its limit, or nobody knows it.
        OutsideTable: there is no such measure.

    """
    limits = limit if isinstance(limit, Mapping) else {} if limit is None else {"rgh": limit}
    for name, most in limits.items():
        if name not in Measures._fields or not most >= 0:
            raise OutsideTable(f"max_error {name} = {most}.", f"Limit any of {', '.join(Measures._fields)}, from 0 on.")
        if expected is None:
            if known is None:
                raise TooUncertain(
                    "this table does not say how far it errs: it holds one result, or no errors were stored with it.",
                    "Rebuild the table (`wizen table build`) from two results or more, or ask without max_error.",
                )
            if between:
                raise TooUncertain(
                    "this table does not say how far it errs between two stages: no such errors were stored with it.",
                    "Rebuild the table (`wizen table rebuild`), ask for a stored stage, or ask without max_error.",
                )
            raise TooUncertain(
                f"this table does not say how far methods other than {known} err.",
                f"Take the method {known}, or ask without max_error.",
            )
        if expected[name] > most:
            there = f"ask for a stage of the table ({' or '.join(f'{s:g}' for s in between)}), " if between else ""
            where = "" if inside else " The query lies outside the hull of the samples."
            raise TooUncertain(
                f"the expected error {name} is {from_zero(expected[name])}, above {towards_zero(most)}.{where}",
                f"Run exactly these parameters, {there}add samples near them, or allow a larger error.",
            )
