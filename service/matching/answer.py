"""From a target to an answer: which tables are searched, what comes nearest, and how sure that is."""

from __future__ import annotations

import difflib
import math
import shlex
import time
from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import urlencode

from store.errors import StoreError
from store.manifest import TableInfo

from .. import vocabulary
from ..errors import InvalidQuery, Wrong
from ..formats.about import GENERATOR
from ..shapes.live import LiveTables
from ..views.match import Match, MatchPage
from .search import Candidate, Progress, Range, search
from .targets import Target

__all__ = ["FAR", "match", "ranges"]

#: Distances up to which a match is exact, as near as another seed's wrinkles, or similar.
_EXACT, _NEAR, FAR = 0.1, 1.5, 3.0
#: How much less likely, in units of chi^2 with the nearest as the measure, an alternative must be to be none.
_LESS_LIKELY = 9.0


def match(
    target: Target,
    tables: LiveTables,
    table: str | None = None,
    known: Mapping[str, float] | None = None,
    progress: Progress = lambda share, what: None,
) -> MatchPage:
    """Return what comes nearest to a target in all tables, or in one, where `known` numbers are held.

    Raises:
        InvalidQuery: numbers that no table has, or that are off all tables.
        StoreError: there is no such table, or none at all.

    """
    start = time.perf_counter()
    searched = ranges(tables, table, known or {})
    _comparable(target, searched)
    found = search(target, searched, progress)
    best, *others = found.candidates
    rivals = [one for one in others if _as_likely(best, one, len(target.seen(False).values))]
    grade = "exact" if best.distance < _EXACT else "near" if best.distance < _NEAR else "similar"
    grade = "far" if best.distance >= FAR else grade
    return MatchPage(
        generator=GENERATOR,
        target={"kind": target.kind, **target.about},
        grade=grade,
        unique=not rivals,
        advice=_advice(grade, best, rivals),
        best=_said(best),
        alternatives=[_said(one) for one in others],
        looked_at=found.looked,
        tables=[one.table.info.name for one in searched],
        milliseconds=round(1e3 * (time.perf_counter() - start), 1),
    )


def ranges(tables: LiveTables, name: str | None, known: Mapping[str, float]) -> list[Range]:
    """Return what is searched of which tables.

    Raises:
        InvalidQuery: numbers that no table has, or that are off all tables.
        StoreError: there is no such table, or none at all.

    """
    infos = [tables.info(one) for one in ([name] if name is not None else tables.names())]
    symbols = {info.solver: vocabulary.solver_named(info.solver).stages.symbol for info in infos}
    words = {symbols[i.solver] for i in infos}.union(*(set(i.axes) | set(i.fixed) | set(i.tied) for i in infos))
    wrong = []
    for one, value in known.items():
        if one not in words:
            near = difflib.get_close_matches(one, sorted(words), n=1)
            advice = f"Did you mean {near[0]!r}?" if near else f"Known: {', '.join(sorted(words))}."
            wrong.append(Wrong(one[:40], "is no parameter of these tables", advice))
        elif not math.isfinite(value):
            wrong.append(Wrong(one, "is not finite", "Write it like 0.03."))
        elif _is_word(one, infos):
            wrong.append(Wrong(one, "is no number in these tables", "Leave it out."))
    if wrong:
        raise InvalidQuery.of(wrong)
    found, off = [], list[str]()
    for info in infos:
        held = _held(info.axes, info.fixed, known, symbols[info.solver], info.reach)
        if held is None:
            off.append(info.name)
            continue
        try:
            table = tables.get(info.name)
        except StoreError:
            if name is not None:
                raise
            continue  # a damaged table does not hide the others
        free = {axis: bounds for axis, bounds in table.axes.items() if axis not in held}
        stage = known.get(symbols[info.solver])
        point = {axis: value for axis, value in held.items() if axis in table.axes}
        found.append(Range(table, free, point, table.reach if stage is None else (stage, stage)))
    if not found:
        advice = "Leave some of them out; `wizen table list` says what tables hold."
        raise InvalidQuery.of([Wrong(one, f"{value:g} is off all tables", advice) for one, value in known.items()])
    return found


def _is_word(name: str, infos: Sequence[TableInfo]) -> bool:
    """Return whether tables hold a parameter, and none of them a number for it."""
    held = [info.fixed[name] for info in infos if name in info.fixed]
    return bool(held) and not any(name in i.axes for i in infos) and not any(isinstance(h, int | float) for h in held)


def _held(
    axes: Mapping[str, tuple[float, float]],
    fixed: Mapping[str, Any],
    known: Mapping[str, float],
    symbol: str,
    reach: tuple[float, float],
) -> dict[str, float] | None:
    """Return the known numbers that lie on a table's axes, or None where it does not hold them."""
    bounds = {**axes, symbol: reach}
    held = {}
    for name, value in known.items():
        if name in bounds:
            low, high = bounds[name]
            if not low <= value <= high:
                return None
            held[name] = value
        elif not _same(fixed.get(name), value):
            return None
    return held


def _same(held: Any, value: float) -> bool:
    """Return whether what a table holds is a number; words and patterns are none."""
    return isinstance(held, int | float) and math.isclose(float(held), value, rel_tol=1e-9, abs_tol=1e-12)


def _comparable(target: Target, searched: Sequence[Range]) -> None:
    """Refuse descriptors that no table has, by name."""
    if target.kind != "descriptors":
        return
    known = sorted(set().union(*(one.table.info.descriptors for one in searched)))
    wrong = []
    for name in target.parts:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            advice = f"Did you mean {near[0]!r}?" if near else f"Known: {', '.join(known)}."
            wrong.append(Wrong(name[:40], "is no descriptor of these tables", advice))
    if wrong:
        raise InvalidQuery.of(wrong)


def _as_likely(best: Candidate, other: Candidate, count: int) -> bool:
    """Return whether an alternative cannot be told from the best by shapes that scatter as seeds make them.

    Neighbouring numbers hang together: half of them count.
    """
    more = 0.5 * count * (other.distance**2 - best.distance**2) / max(1.0, best.distance**2)
    return more < _LESS_LIKELY


def _advice(grade: str, best: Candidate, rivals: Sequence[Candidate]) -> str:
    said = []
    if grade == "far":
        said.append("No table holds a shape like that: the nearest is named. Run a sweep there, or give the size.")
    elif rivals:
        places = "; ".join(dict.fromkeys(_place(one) for one in rivals[:3]))
        said.append(f"Shapes elsewhere are as near, within the scatter of seeds: {places}. Say what you know.")
    if best.edges:
        names = [name or best.table.info.name for name in best.edges]
        said.append(f"At the end of what the table holds: {', '.join(_named(best, n) for n in names)}.")
    return " ".join(said)


def _named(one: Candidate, name: str) -> str:
    return _symbol(one) if name == one.table.info.name else name


def _symbol(one: Candidate) -> str:
    return vocabulary.solver_named(one.table.info.solver).stages.symbol


def _place(one: Candidate) -> str:
    values = ", ".join(f"{name} = {value:.3g}" for name, value in one.point.items())
    return f"{one.table.info.name}{' ' + values if values else ''} {_symbol(one)} = {one.stage:.3g}"


def _said(one: Candidate) -> Match:
    info, symbol = one.table.info, _symbol(one)
    point = {name: float(f"{value:.6g}") for name, value in one.point.items()}
    stage = float(f"{one.stage:.6g}")
    query = urlencode({"table": info.name, **point, symbol: stage})
    sets = " ".join(f"--set {shlex.quote(f'{name}={value:g}')}" for name, value in point.items())
    return Match(
        solver=info.solver,
        table=info.name,
        parameters=point,
        symbol=symbol,
        stage=stage,
        uncertainty={name or symbol: float(f"{value:.3g}") for name, value in one.deviation.items()},
        distance=round(one.distance, 4),
        parts={name: round(value, 4) for name, value in one.parts.items()},
        edges=[name or symbol for name in one.edges],
        link=f"/v1/shapes/{info.solver}?{query}",
        command=" ".join(f"wizen query --name {info.name} {sets} --stages {stage:.15g} --out shape.glb".split()),
    )
