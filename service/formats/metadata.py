"""JSON: the numbers about a shape rather than the shape, with links to the files that hold it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import orjson

from solver.quantities import QUANTITIES

from .about import About, extras, lattice

if TYPE_CHECKING:
    from store.shape import Shape

__all__ = ["encode"]


def encode(shape: Shape, about: About) -> bytes:
    """Return descriptors with units, the results that took part with their weights, and where the files are.

    `descriptors` are of the stored runs, weighted; `crossings` and `volume` are measured on the closed mesh, and null
    where no positions were computed.

    `nearest` is the scaled distance to the nearest stored result, `exact` that this is a stored result itself, `inside`
    that stored results surround it, `held` at least what share of the wrinkles' height the lattice holds,
    `expected_error` how far it may be off by measure, null where nobody knows.
    """
    whose = " (of the runs)" if shape.tier == "table" else ""
    # what comes from a run brings none along
    known = {name: QUANTITIES[name].units for name in shape.descriptors if name in QUANTITIES}
    described = {
        name: {
            "value": value,
            "units": shape.units.get(name) or known.get(name, "1"),
            "long_name": f"{QUANTITIES[name].long_name if name in QUANTITIES else name}{whose}",
        }
        for name, value in shape.descriptors.items()
    }
    document = {
        **extras(shape, about),
        "lattice": lattice(len(shape.colatitude), len(shape.azimuth), about),
        "descriptors": described,
        "weights": dict(shape.weights),
        "timings_ms": dict(about.timings),
        "links": dict(about.links),
    }
    return orjson.dumps(document, option=orjson.OPT_SERIALIZE_NUMPY)
