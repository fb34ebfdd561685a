"""What every solver is: one frozen value with validated parameters, a need, and a run that returns named data.

`Params` says what is simulated, `Need` says what of it is wanted (nothing else is computed), `Context` carries
progress, cancellation and randomness, and every failure is a `SolverError` that says what to change.
"""

from .context import Context
from .errors import Cancelled, InvalidGeometry, InvalidInput, NotConverged, SolverError, Unstable
from .need import Need, Quality, Region
from .params import Params
from .solver import Cost, Solver, StageAxis, finish

__all__ = [
    "Cancelled",
    "Context",
    "Cost",
    "InvalidGeometry",
    "InvalidInput",
    "Need",
    "NotConverged",
    "Params",
    "Quality",
    "Region",
    "Solver",
    "SolverError",
    "StageAxis",
    "Unstable",
    "finish",
]
