"""What a polygon must be to be a section: checks that parameters make, without numerics."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["check_outline", "polygon_area"]

Corner = tuple[float, float]


def polygon_area(outline: Sequence[Corner]) -> float:
    """Return the area [m2] of a polygon, negative if its corners run clockwise."""
    return sum(a * d - c * b for (a, b), (c, d) in _sides(outline)) / 2


def _sides(outline: Sequence[Corner]) -> list[tuple[Corner, Corner]]:
    return list(zip(outline, [*outline[1:], outline[0]], strict=True))


def _left(p: Corner, q: Corner, r: Corner) -> float:
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])


def check_outline(outline: Sequence[Corner]) -> None:
    """Refuse what encloses no area, or crosses itself.

    Raises:
        ValueError: see above.

    """
    if len(outline) < 3:
        raise ValueError("an outline needs three corners or more")
    span = max(max(c) - min(c) for c in zip(*outline, strict=True))
    if abs(polygon_area(outline)) <= 1e-6 * span * span:
        raise ValueError("the outline encloses no area: give its corners in order")
    sides = _sides(outline)
    for n, (p, q) in enumerate(sides):
        for m in range(n + 2, len(sides)):
            if n == 0 and m == len(sides) - 1:
                continue
            r, s = sides[m]
            if _left(p, q, r) * _left(p, q, s) < 0 and _left(r, s, p) * _left(r, s, q) < 0:
                raise ValueError("the outline crosses itself: give its corners in order")
