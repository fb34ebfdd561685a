"""Numbers in refusals: rounded towards what is allowed, so that advice works as it is read."""

from __future__ import annotations

from decimal import ROUND_DOWN, Context

__all__ = ["towards_zero"]


def towards_zero(value: float, digits: int = 3) -> str:
    """Return a finite `value` with so many digits, the rest cut off: a bound's text lies within the bound."""
    return f"{float(Context(prec=digits, rounding=ROUND_DOWN).create_decimal(repr(float(value)))):g}"
