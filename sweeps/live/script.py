"""A session as a parameter file: what gives the same bytes as the shape that it ended with."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel

from solver.contract import Params, Quality, Solver

__all__ = ["command", "toml"]


def toml(solver: Solver, params: Params, stage: float, quality: Quality) -> str:
    """Return parameters as TOML, whatever is as by default left out, with the command that runs them on top."""
    import tomli_w

    lines = [
        f"# {solver.title}, to {solver.stages.long_name} {stage!r}: save this as session.toml, then",
        "#",
        f"#     {command(solver, stage, quality)}",
        "",
    ]
    return "\n".join(lines) + tomli_w.dumps(_plain(params))


def command(solver: Solver, stage: float, quality: Quality, file: str = "session.toml") -> str:
    """Return the command that gives the shape of a session."""
    name = solver.name
    return f"wizen solve {name} --params {file} --quality {quality} --stages {stage!r} --out {name}.h5"


def _plain(value: Any) -> Any:
    """Return models as plain values, without what is as by default; what tells models apart stays."""
    if isinstance(value, BaseModel):
        found = {}
        for name, field in type(value).model_fields.items():
            own = getattr(value, name)
            usual = not field.is_required() and own == field.get_default(call_default_factory=True)
            if own is not None and (name == "kind" or not usual):
                found[name] = _plain(own)
        return found
    if isinstance(value, dict):
        return {key: _plain(own) for key, own in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(own) for own in value]
    return value
