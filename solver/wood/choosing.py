"""`mode = "auto"`: whether a scene needs its equilibria, scaled or real masses, why, and at which error.

Loads are slow where they take many periods T = 2 pi / omega of the slowest wave between what holds the wood. An
oscillator whose support is driven evenly for a time t lags by c / (omega^2 t), c the damping, and swings by
exp(-c t / 2) / (omega t) of how far it has been driven; masses scaled s times make that s c / (omega^2 t) and sqrt(s)
exp(-c t / 2) / (omega t), once swings have had the time to decay. Periods are those of Timoshenko's beam by
Dunkerley's sum: bending and shear. The error is of forces before anything breaks: how a break runs is inertia's matter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from .params import Body, GripPoint, Waypoint, WoodParams
from .shape.curve import Curve

__all__ = ["ERROR", "Choice", "decide", "error_at", "swept", "turned"]

#: Largest error of elastic forces that scaled masses may bring.
ERROR = 0.02
#: The most that masses are scaled: beyond it elastic energy was measured off by more than 0.1 % (docs/wood.md).
_MOST = 1e5
#: Scaling that is not worth its error: steps grow by the root of it.
_LEAST = 10.0
#: Share of the strain limit below which dead loads break nothing, and below which they do not matter beside others.
_SAFE, _SMALL = 0.5, 0.05
#: omega l^2 / sqrt(EI / rho A) of a span hinged at both ends and of one that juts out, and omega l / c of their shear.
_HINGED, _JUTS, _SHEARED, _JUTS_SHEARED = math.pi**2, 3.516, math.pi, math.pi / 2
#: Factor of a section in shear.
_SECTION = 0.9
#: Of the energy of motion of half a sine, what is not that of its mean: 1 - 8 / pi^2.
_BENDS = 1 - 8 / math.pi**2


class Choice(NamedTuple):
    """mode: static or explicit; scaling: of masses; error: expected of elastic forces; why: in a sentence."""

    mode: str
    scaling: float
    error: float
    why: str


class _Held(NamedTuple):
    """Places [m] along where something holds or touches the wood, and the length [m] of all of it."""

    places: tuple[float, ...]
    length: float

    @property
    def reach(self) -> float:
        """Distance [m] of the outermost, or from the only one to the farther end."""
        if len(self.places) > 1:
            return self.places[-1] - self.places[0]
        here = self.places[0] if self.places else 0.0
        return max(here, self.length - here)


def _along(position: Sequence[float]) -> float:
    return position[0]


def _held(params: WoodParams, moving: bool = True) -> _Held:
    """Return what holds; without what moves, if not `moving`."""
    places = {"none": [], "start": [0.0], "both": [0.0, params.length]}[params.clamp]
    at = Curve(params.spine).nearest if params.spine else _along
    held = [b for b in params.bodies if moving or (len(b.path) == 1 and b.mass is None)]
    places = places + [at(b.path[0].position) for b in held]
    grips = [g for g in params.grips if moving or len(g.path) <= 1]
    places += [(max(g.low[0], 0.0) + min(g.high[0], params.length)) / 2 for g in grips]
    inside = sorted({round(min(max(p, 0.0), params.length), 9) for p in places})
    return _Held(tuple(inside), params.length)


def _frequency(params: WoodParams, held: _Held) -> float:
    """Return the lowest angular frequency [1/s] of what is between, and juts out of, what holds."""
    # the thinnest part swings slowest
    bends = min(params.taper, 1.0) * params.wide / 2 * (params.stiffness / params.density) ** 0.5
    shears = (_SECTION * max(params.shear, 1e-9) / params.density) ** 0.5
    ends = (held.places[0], held.length - held.places[-1]) if held.places else (0.0, 0.0)
    spans = [b - a for a, b in pairwise(held.places)] if len(held.places) > 1 else []
    if not held.places:
        spans = [held.length]
    squares = [(s**2 / (_HINGED * bends)) ** 2 + (s / (_SHEARED * shears)) ** 2 for s in spans]
    squares += [(s**2 / (_JUTS * bends)) ** 2 + (s / (_JUTS_SHEARED * shears)) ** 2 for s in ends if s > 0]
    along = (held.length / (math.pi * (params.stiffness / params.density) ** 0.5)) ** 2
    return float(max(*squares, along) ** -0.5)


def _driven(params: WoodParams, held: _Held) -> float:
    """Return the shortest time [s] in which what moves can break the wood, or goes its way; inf: nothing moves.

    Of a path in many steps, as of one that begins smoothly, the fastest counts, not the shortest.
    """
    r, reach = params.wide, held.reach
    sags = params.strain_limit * reach**2 / ((12 if len(held.places) > 2 else 3) * r)
    turns = min(params.strain_limit * reach / r, params.shear_strength / max(params.shear, 1e-9) * reach / r)
    found = [math.inf]
    for body in params.bodies:
        ways = [(swept(body, a, b), b.time - a.time) for a, b in pairwise(body.path)]
        found.append(_time(ways, sags))
    for grip in params.grips:
        steps = list(pairwise(grip.path))
        found.append(_time([(math.dist(p.shift, q.shift), q.time - p.time) for p, q in steps], sags))
        found.append(_time([(math.dist(p.turn, q.turn), q.time - p.time) for p, q in steps], turns))
    if any(params.pull):
        found.append(params.strain_limit * params.length / math.hypot(*params.pull))
    return min(found)


def swept(body: Body, a: Waypoint, b: Waypoint) -> float:
    """Return how far [m] a body's farthest point goes from one waypoint to the next, at most."""
    points = [body.size] if body.mesh is None else body.mesh.points
    arm = max(math.hypot(*p) for p in points) + (math.hypot(*body.pivot) if body.pivot is not None else 0.0)
    return math.dist(a.position, b.position) + math.dist(a.turn, b.turn) * arm


def turned(a: GripPoint, b: GripPoint, arm: float) -> float:
    """Return how far [m] what a grip holds, `arm` [m] long at most, goes from one point of its path to the next."""
    return math.dist(a.shift, b.shift) + math.dist(a.turn, b.turn) * arm


def _time(ways: list[tuple[float, float]], enough: float) -> float:
    """Return the time [s] that a path of (way, time) takes for `enough`, or for all of it, at its fastest."""
    total = sum(way for way, _ in ways)
    fastest = max((way / span for way, span in ways), default=0.0)
    return math.inf if fastest == 0 else min(enough, total) / fastest


def _strained(params: WoodParams) -> float:
    """Return the strain of dead loads over the strain limit, of a beam held as this one is."""
    weight = params.density * math.pi * params.wide**2 * params.length * abs(params.gravity)
    across = math.hypot(params.tip_load[1], params.tip_load[2])
    section = math.pi * params.wide**2
    spans = {"none": 8.0, "start": 2.0, "both": 12.0}[params.clamp]
    moment = across * params.length + weight * params.length / spans
    strain = moment * params.wide / (section * params.wide**2 / 4 * params.stiffness)
    return (strain + abs(params.tip_load[0]) / (section * params.stiffness)) / min(
        params.strain_limit, params.crush_strain
    )


def error_at(params: WoodParams, scaling: float) -> float:
    """Return the error of forces, over them, that is expected of masses scaled so many times.

    The larger of two: of what is between all that holds and drives, and of what drives, which moves the wood between
    what rests. A bundle that nothing holds keeps its real mass as a whole, which leaves `_BENDS` of a half sine.
    """
    time = _driven(params, _held(params))
    if math.isinf(time):
        return 0.0
    share = 1.0 if params.clamp != "none" or params.grips else _BENDS
    within, whole = _frequency(params, _held(params)), _frequency(params, _held(params, moving=False))
    return max(_missed(params, within, time, scaling), share * _missed(params, whole, time, scaling))


def _missed(params: WoodParams, omega: float, time: float, scaling: float) -> float:
    """Return by how much an oscillator driven for a time [s] lags and swings."""
    swings = math.exp(-min(params.damping * time / 2, 700.0)) / (omega * time)
    return float(scaling * params.damping / (omega**2 * time) + scaling**0.5 * swings)


def _at_rest(params: WoodParams) -> bool:
    """Return whether only dead loads act, on what the static mode can hold."""
    moves = params.bodies or params.grips or any(params.pull) or params.bend
    knows = params.turning or params.rod_contact or params.clamp == "none"
    return not (moves or knows) and (any(params.tip_load) or params.gravity != 0)


def decide(params: WoodParams) -> Choice:
    """Return how to run what is asked for with mode auto."""
    held = _held(params)
    omega, time, strained = _frequency(params, held), _driven(params, held), _strained(params)
    period = 2 * math.pi / omega
    if _at_rest(params):
        if params.fracture == "none" or strained < _SAFE:
            why = f"only dead loads act, which grow within 1 s, {1 / period:.0f} times the slowest period"
            bears = "" if params.fracture == "none" else f", and strain rods to {100 * strained:.2g} % of their limit"
            return Choice("static", 1.0, 1 / omega, f"equilibria, as {why}{bears}")
        why = f"dead loads strain rods to {100 * strained:.3g} % of their limit, and equilibria break nothing"
        return Choice("explicit", 1.0, 0.0, f"real masses, as {why}")
    if any(body.mass is not None for body in params.bodies):
        why = "a body with a mass strikes with its inertia, and meets the wood's"
        return Choice("explicit", 1.0, 0.0, f"real masses, as {why}")
    if params.bend or math.isinf(time):
        return Choice("explicit", 1.0, 0.0, "real masses, as the wood swings freely: inertia is all there is")
    if strained > _SMALL:
        why = f"weight and tip load act at once and strain rods to {100 * strained:.3g} % of their limit"
        return Choice("explicit", 1.0, 0.0, f"real masses, as {why}")
    scaling = _MOST
    while scaling > 1 and error_at(params, scaling) > ERROR:
        scaling /= 1.1
    drives = f"what moves needs {time:.2g} s to break or bend the wood, {time / period:.3g} times the slowest period"
    if scaling < _LEAST:
        return Choice("explicit", 1.0, 0.0, f"real masses, as {drives}: too fast for heavier ones")
    # one digit is enough, rounded down
    unit = 10.0 ** math.floor(math.log10(scaling) + 1e-9)
    scaling = math.floor(scaling / unit + 1e-9) * unit
    error = error_at(params, scaling)
    after = (
        ""
        if params.fracture == "none"
        else "; once it breaks, counts of breaks rise with the masses by an unknown share"
    )
    why = f"masses scaled {scaling:g} times, as {drives}: elastic forces within {100 * error:.2g} %{after}"
    return Choice("explicit", scaling, error, why)
