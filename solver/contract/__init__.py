"""What every solver is: one frozen value with validated parameters, a need, and a run that returns named data.

`Params` says what is simulated, `Need` says what of it is wanted (nothing else is computed), `Context` carries
progress, cancellation and randomness, and every failure is a `SolverError` that says what to change.
"""

from .clock import Clock
from .context import Context
from .errors import Cancelled, InvalidGeometry, InvalidInput, NotConverged, OverBudget, SolverError, Unstable
from .live import Glimpse, Live, LiveEngine
from .looks import Fur, Label, Looks, Matter, Part, Place, Shade, Skin, Worn, dryness
from .need import Need, Quality, Region, Start
from .params import Params
from .solver import Cost, Solver, StageAxis, finish
from .surface import Extent, Fresh, Surface

__all__ = [
    "Cancelled",
    "Clock",
    "Context",
    "Cost",
    "Extent",
    "Fresh",
    "Fur",
    "Glimpse",
    "InvalidGeometry",
    "InvalidInput",
    "Label",
    "Live",
    "LiveEngine",
    "Looks",
    "Matter",
    "Need",
    "NotConverged",
    "OverBudget",
    "Params",
    "Part",
    "Place",
    "Quality",
    "Region",
    "Shade",
    "Skin",
    "Solver",
    "SolverError",
    "StageAxis",
    "Start",
    "Surface",
    "Unstable",
    "Worn",
    "dryness",
    "finish",
]
