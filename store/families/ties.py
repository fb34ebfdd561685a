"""Parameters that go together in a table: the half-axes of an outline, both measures of what is round.

One of them leads and is the table's axis; the others follow from it, by a monotone curve through the samples' values
(Fritsch and Butland 1984), so that a line through a space of eight of them is one axis and not eight.
"""

from __future__ import annotations

import bisect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self

__all__ = ["Tie", "find"]


#: Samples and parameters on one line that are no accident, where no pair of values comes back.
_FEWEST, _LINE = 4, 3
#: Share of a range by which a number may lie outside, and two slopes of one straight line differ: round-off.
_SLACK = 1e-9


@dataclass(frozen=True)
class Tie:
    """A parameter that follows another: its `values` where the leader's are `at`, both strictly monotone."""

    leader: str
    at: tuple[float, ...]
    values: tuple[float, ...]

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """Return the tie in JSON values."""
        return cls(str(values["leader"]), tuple(values["at"]), tuple(values["values"]))

    def __call__(self, x: float) -> float:
        """Return the follower's value where the leader's is `x`; beyond its ends, that of the end."""
        x = min(max(x, self.at[0]), self.at[-1])
        j = min(max(bisect.bisect_right(self.at, x) - 1, 0), len(self.at) - 2)
        h = self.at[j + 1] - self.at[j]
        t = (x - self.at[j]) / h
        low, high = self.values[j], self.values[j + 1]
        if t in (0.0, 1.0):
            return high if t else low
        a, b = self._slope(j) * h, self._slope(j + 1) * h
        rise = high - low
        return low + t * (a + t * ((3 * rise - 2 * a - b) + t * (a + b - 2 * rise)))

    def beyond(self, x: float) -> float | None:
        """Return the follower's value where the leader's is `x`, past its ends too where that is no guess: of one that
        is equal to its leader, or lies with it on a straight line through three values or more. None elsewhere there.
        """
        slack = _SLACK * (self.at[-1] - self.at[0])
        if self.at[0] - slack <= x <= self.at[-1] + slack:
            return self(x)
        if self.at == self.values:
            return x
        _, slopes = self._slopes()
        if len(slopes) < 2 or max(slopes) - min(slopes) > _SLACK * abs(slopes[0]):
            return None
        rise = (self.values[-1] - self.values[0]) / (self.at[-1] - self.at[0])
        return self.values[0] + rise * (x - self.at[0])

    def _slope(self, j: int) -> float:
        """Return the slope at a node: the weighted harmonic mean of its two intervals', at an end a parabola's."""
        steps, slopes = self._slopes()
        if len(slopes) == 1:
            return slopes[0]
        if j in (0, len(steps)):
            near, next_ = (0, 1) if j == 0 else (-1, -2)
            h, g = steps[near], steps[next_]
            found = ((2 * h + g) * slopes[near] - h * slopes[next_]) / (h + g)
            # neither back nor steeper than keeps it monotone
            return min(max(found / slopes[near], 0.0), 3.0) * slopes[near]
        before, after = steps[j - 1], steps[j]
        one, two = 2 * after + before, after + 2 * before
        return (one + two) / (one / slopes[j - 1] + two / slopes[j])

    def _slopes(self) -> tuple[list[float], list[float]]:
        """Return the lengths of the intervals, and the slope of each."""
        steps = [b - a for a, b in pairwise(self.at)]
        return steps, [(b - a) / step for (a, b), step in zip(pairwise(self.values), steps, strict=True)]


def find(columns: Mapping[str, Sequence[float]]) -> dict[str, Tie]:
    """Return who follows whom among the varying parameters (name -> value of each sample).

    Two are tied where each value of the one belongs to one value of the other, strictly monotone, and that is no
    accident of few samples: some of these pairs come back in several samples, the two are equal, or there are at least
    four samples and three such parameters. The one with the widest range leads, the first of equals.
    """
    tied: dict[str, Tie] = {}
    leaders: list[str] = []
    for name in sorted(columns, key=lambda name: min(columns[name]) - max(columns[name])):
        found = next((tie for leader in leaders if (tie := _tie(leader, columns[leader], columns[name]))), None)
        if found is None:
            leaders.append(name)
        else:
            tied[name] = found
    for leader in leaders if len(leaders) >= _LINE else ():
        group = {n: tie for n in leaders if n != leader and (tie := _tie(leader, columns[leader], columns[n], _FEWEST))}
        if len(group) + 1 >= _LINE:
            tied |= group
            break
    # whoever follows a follower follows its leader
    for name, tie in tied.items():
        if tie.leader in tied:
            again = _tie(tied[tie.leader].leader, columns[tied[tie.leader].leader], columns[name], 2)
            assert again is not None  # monotone functions of monotone functions are monotone
            tied[name] = again
    return {name: tied[name] for name in columns if name in tied}


def _tie(leader: str, at: Sequence[float], values: Sequence[float], fewest: int | None = None) -> Tie | None:
    """Return the tie of two parameters; where no pair comes back, of equal ones, or of `fewest` samples or more."""
    pairs = sorted(set(zip(at, values, strict=True)))
    if len(pairs) < 2:
        return None
    if len(pairs) == len(at) and not (fewest is not None and len(at) >= fewest) and any(x != y for x, y in pairs):
        return None
    steps = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(pairs)]
    if not (all(x > 0 and y > 0 for x, y in steps) or all(x > 0 > y for x, y in steps)):
        return None
    return Tie(leader, tuple(x for x, _ in pairs), tuple(y for _, y in pairs))
