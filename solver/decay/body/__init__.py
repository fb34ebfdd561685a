"""The body under the skin: tetrahedra whose rest shape shrinks and softens, and the shape they settle to."""

from __future__ import annotations
