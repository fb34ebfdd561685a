"""Digest of the kernel's sources: numba caches a function by its own file only, we cache it by all of them."""

from __future__ import annotations

import hashlib
from pathlib import Path

SOURCES = (
    "../contact.py",
    "../contact_search.py",
    "fixed_point.py",
    "skin.py",
    "algebra.py", "elements.py", "strips.py", "vector_ir.py", "scalar.py", "generate.py", "march.py")


def source_digest(backend: str) -> str:
    """Hex digest of the sources that make up the compiled kernel, and of the back end's name."""
    digest = hashlib.sha256(backend.encode())
    for name in SOURCES:
        digest.update(b"\0" + name.encode() + b"\0" + Path(__file__).parent.joinpath(name).read_bytes())
    return digest.hexdigest()
