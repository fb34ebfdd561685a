"""JSON: the numbers about a shape rather than the shape, with links to the files that hold it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import orjson

from solver.quantities import QUANTITIES

from .about import About, extras

if TYPE_CHECKING:
    from store.shape import Shape

__all__ = ["encode"]


def encode(shape: Shape, about: About) -> bytes:
    """Return descriptors with units, the results that took part with their weights, and where the files are.

    `nearest` is the scaled distance to the nearest stored result, `exact` that this is a stored result itself, `inside`
    that stored results surround it, `expected_error` how far it may be off by measure, null where nobody knows.
    """
    described = {
        name: {
            "value": value,
            "units": shape.units.get(name, "1"),
            "long_name": QUANTITIES[name].long_name if name in QUANTITIES else name,
        }
        for name, value in shape.descriptors.items()
    }
    document = {
        **extras(shape, about),
        "lattice": {"colatitude": len(shape.colatitude), "azimuth": len(shape.azimuth)},
        "descriptors": described,
        "weights": dict(shape.weights),
        "timings_ms": dict(about.timings),
        "links": dict(about.links),
    }
    return orjson.dumps(document, option=orjson.OPT_SERIALIZE_NUMPY)
