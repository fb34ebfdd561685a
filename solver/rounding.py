"""Numbers in refusals: rounded towards what is allowed, so that advice works as it is read."""

from __future__ import annotations

from decimal import ROUND_DOWN, ROUND_UP, Context

__all__ = ["from_zero", "towards_zero"]


def towards_zero(value: float, digits: int = 3) -> str:
    """Return a finite `value` with so many digits, the rest cut off: a bound's text lies within the bound."""
    return _written(value, Context(prec=digits, rounding=ROUND_DOWN))


def from_zero(value: float, digits: int = 3) -> str:
    """Return `value` with so many digits, the last one raised where there is more: its text as a bound holds it."""
    return _written(value, Context(prec=digits, rounding=ROUND_UP))


def _written(value: float, digits: Context) -> str:
    return f"{float(digits.create_decimal(repr(float(value)))):.15g}"
