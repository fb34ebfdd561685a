"""The law of the flesh, once: what fused kernels are checked against."""

from __future__ import annotations

from .neo_hooke import Law, at_pressure, isochoric, logarithmic

__all__ = ["Law", "at_pressure", "isochoric", "logarithmic"]
