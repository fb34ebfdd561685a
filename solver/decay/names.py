"""Names of the fields of a decay run, by what has to be solved for them, and what a need says without words."""

from __future__ import annotations

from ..contract import Need
from .params import DecayParams

__all__ = ["ALL", "BESIDE", "BODY", "DEFAULT", "FIELDS", "FLESH", "MASSES", "MOULD", "ROT", "VECTORS", "completed"]

_SHARES = ("rotten_share", "mean_rot", "mouldy_share", "mean_mould", "mean_nutrient", "budget_error", "water_lost")
#: Where the fresh weight is.
MASSES = ("mass", "juice_lost", "puddle", "respired", "density")
#: Of flesh that has fields of its own; they come along with those of the skin above it.
FLESH = ("flesh_position", "flesh_rot", "flesh_nutrient", "flesh_water", "flesh_cell")
ALL = (
    *("position", "displacement", "mesh_position", "triangle", "volume", "least_jacobian", *MASSES),
    *("rot", "substrate", "rot_age", "mould", "mould_active", "nutrient", *_SHARES),
)
#: What a run keeps of a need that names nothing; see `completed`.
DEFAULT = ("rot", "rot_age", "mould", "mould_active", "nutrient", *_SHARES)
#: What has a layer to be stepped for.
ROT = frozenset({"rot", "substrate", "rot_age", "rotten_share", "mean_rot"})
MOULD = frozenset({"mould", "mould_active", "nutrient", "mouldy_share", "mean_mould", "mean_nutrient"})
#: What a body has to be settled for, if the fruit has one; `position` is where the surface is.
BODY = frozenset({"position", "displacement", "volume", "least_jacobian", "mesh_position", *MASSES})
FIELDS = ("position", "displacement", "rot", "substrate", "rot_age", "mould", "mould_active", "nutrient")
VECTORS = ("position", "displacement")
#: What comes along with the fields of vertices where it is known.
BESIDE = ("roasted", "flesh", "browned", "kind", "living", "lost")


def completed(params: DecayParams, need: Need) -> Need:
    """Return the need with the places that its fields belong to.

    An imported mesh, what cuts leave of a fruit, or the fruits of a heap as one, comes along with what lives on its
    vertices. Who asks for all that a run keeps by default, of a fruit with a body, gets where the surface is too: the
    shape could not be shown or exported without. Who names fewer fields gets those. Flesh that has fields of its own
    comes along with the skin's.
    """
    wanted = set(need.fields)
    if (params.mesh is not None or params.heap is not None or params.cuts) and wanted & {*FIELDS}:
        wanted = wanted - {"position"} | {"mesh_position", "triangle"}
    elif not params.keeps_shape and wanted >= {*DEFAULT} and wanted.isdisjoint({*VECTORS, "mesh_position"}):
        wanted |= {"position"}
    if params.within is not None and wanted & {"rot", "substrate"}:
        wanted |= {*FLESH}
    return need.model_copy(update={"fields": tuple(sorted(wanted))})
