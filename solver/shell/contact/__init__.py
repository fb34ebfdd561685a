"""Contact of a sheet with itself: a barrier between its vertices, edges and triangles, and steps that stop short.

Li et al. 2020, doi 10.1145/3386569.3392425 (incremental potential contact), with one change for sheets: what lies near
each other at rest, along the sheet, keeps no more than a share of its rest distance, so that a thick sheet with small
triangles is at rest where it is flat, and still cannot fold through itself.
"""

from .apart import any_cross, changed, close_faces
from .barrier import barrier, barrier_diagonal, barrier_hessian
from .near import Near, flat, near_of
from .search import Pairs, owners, search, within
from .steps import free_step

__all__ = [
    "Near",
    "Pairs",
    "any_cross",
    "barrier",
    "barrier_diagonal",
    "barrier_hessian",
    "changed",
    "close_faces",
    "flat",
    "free_step",
    "near_of",
    "owners",
    "search",
    "within",
]
