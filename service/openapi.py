"""The OpenAPI page: query axes with their units and ranges, which no function signature can declare.

Which axes a query has is the table's affair. The page lists all that the solvers know, with the bounds that they
accept, and takes its examples from the tables that are there.
"""

from __future__ import annotations

import json
from typing import Any

from fastapi import FastAPI
from fastapi.routing import APIRoute

from solver import registry
from solver.contract import Solver
from store.blending import methods
from store.errors import StoreError
from store.surfaces.measures import UNITS

from . import problems, vocabulary
from .formats import FORMATS
from .hours import UNDER
from .settings import Settings
from .shapes import detail
from .shapes.live import LiveTables
from .shapes.query import EXACT, LIMITS, LOWEST_RESOLUTION

__all__ = ["Documented", "operation_id"]

Json = dict[str, Any]

_CORRECTION = "|".join(methods.CORRECTIONS)
#: Keywords in the solvers' schemas that JSON Schema does not know, and those whose values are no schemas.
_OWN, _VALUES = ("units", "axes", "along"), ("default", "const", "enum", "example", "examples", "required")
#: Where one of several kinds may stand; generators of clients drop a schema whose default is one of these, made whole.
_KINDS = ("oneOf", "anyOf")
_REFERENCE = "#/components/schemas/{model}"
_METHOD = rf"^({'|'.join(methods.WEIGHTINGS)})([+ ]({_CORRECTION}))*$"


class Documented(FastAPI):
    """FastAPI whose page describes the shapes' query; made anew when a table changes."""

    def openapi(self) -> Json:
        """Return the OpenAPI document."""
        examples = _examples(self.state.tables)
        if self.openapi_schema is None or self.openapi_schema.get("x-examples") != examples:
            self.openapi_schema = None
            document = super().openapi()
            schemas = document.setdefault("components", {}).setdefault("schemas", {})
            problem = problems.Problem.model_json_schema(ref_template="#/components/schemas/{model}")
            schemas.update(problem.pop("$defs", {}), Problem=problem)
            get = document["paths"]["/v1/shapes/{solver}"]["get"]
            parameters = _parameters(self.state.settings, examples)
            get["parameters"] = [*get["parameters"], *parameters]
            info = document["paths"]["/v1/shapes/{solver}/info"]["get"]
            info["parameters"] += [each for each in parameters if each["name"] not in ("format", "exact")]
            schemas["JobRequest"] = _job_request(schemas)
            _replace_validation(document)
            _complete(document, self.state.settings.root_path)
            document["x-examples"] = examples
        return self.openapi_schema  # type: ignore[return-value]


def operation_id(route: APIRoute) -> str:
    """Return the name of an operation in generated clients: its handler's, whatever becomes of its address."""
    return route.name


def _complete(document: Json, root: str) -> None:
    """Add what generators of clients and linters ask for: a server, whether each operation needs a token, and no
    keyword that JSON Schema does not know.
    """
    document["servers"] = [{"url": root or "/", "description": "The service that sent this page"}]
    document["info"]["license"] = {"name": "Apache 2.0", "identifier": "Apache-2.0"}
    for operations in document["paths"].values():
        for operation in operations.values():
            # a shape is free, the run that it may ask for is not
            operation.setdefault("security", [{}, {"token": []}] if operation["operationId"] == "shape" else [])
    document["paths"] = _plain(document["paths"])
    document["components"]["schemas"] = {name: _plain(s) for name, s in document["components"]["schemas"].items()}


def _plain(schema: Any) -> Any:
    """Return a schema, or what holds schemas, with our own keywords marked as extensions."""
    if isinstance(schema, list):
        return [_plain(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    found = {}
    for key, value in schema.items():
        if key in _OWN and ("type" in schema or "anyOf" in schema or "$ref" in schema or "allOf" in schema):
            found[f"x-{key}"] = value
        elif key == "default" and isinstance(value, dict) and any(kinds in schema for kinds in _KINDS):
            found["x-default"] = value
        elif key == "properties":
            found[key] = {name: _plain(each) for name, each in value.items()}
        else:
            found[key] = value if key in _VALUES else _plain(value)
    return found


def _job_request(schemas: Json) -> Json:
    """Return the body that asks for a job: one form per solver, with its own parameters, fields and stages."""
    common = schemas["JobRequest"]
    forms = {}
    for name in registry.names():
        solver = vocabulary.solver_named(name)
        params = _apart(solver.params.model_json_schema(ref_template=_REFERENCE), schemas, name)
        schemas.update(params.pop("$defs", {}))
        axes = {axis.name: _axis(axis, {}) for axis in vocabulary.axes(name).values()}
        scalars = {axis: {**said["schema"], "description": said["description"]} for axis, said in axes.items()}
        params["properties"] = {**params["properties"], **scalars}
        form = f"JobRequest_{name}"
        schemas[form] = {
            **common,
            "title": form,
            "properties": {
                **common["properties"],
                "solver": {"const": name, "title": solver.title},
                "preset": {
                    "enum": [*solver.presets, None],
                    "description": common["properties"]["preset"]["description"],
                },
                "params": params,
                "need": _need(schemas["Need"], solver),
            },
        }
        forms[name] = f"#/components/schemas/{form}"
    return {
        "title": "JobRequest",
        "description": common.get("description", ""),
        "oneOf": [{"$ref": form} for form in forms.values()],
        "discriminator": {"propertyName": "solver", "mapping": forms},
    }


def _apart(params: Json, schemas: Json, solver: str) -> Json:
    """Return parameters' schema whose definitions are called by their solver, too, where another's has the name."""
    own = params.get("$defs", {})
    called = {name: f"{name}_{solver}" if schemas.get(name, own[name]) != own[name] else name for name in own}
    # generators of clients go by titles
    apart = {
        new: own[name] if new == name else {**own[name], "title": f"{own[name].get('title', name)} ({solver})"}
        for name, new in called.items()
    }
    text = json.dumps({**params, "$defs": apart})
    for name, new in called.items():
        text = text.replace(json.dumps(_REFERENCE.format(model=name)), json.dumps(_REFERENCE.format(model=new)))
    found: Json = json.loads(text)
    return found


def _need(general: Json, solver: Solver) -> Json:
    """Return a need's schema with the fields and the stages that a solver knows."""
    properties = dict(general["properties"])
    axis = solver.stages
    stage = {"type": "number", "minimum": axis.lowest, "maximum": axis.highest}
    properties["fields"] = {**properties["fields"], "items": {"enum": list(solver.fields)}}
    properties["stages"] = {
        **properties["stages"],
        "items": {**stage, "description": f"{axis.long_name} [{axis.units}]"},
    }
    return {**general, "properties": properties}


def _replace_validation(document: Json) -> None:
    """Declare what is sent for wrong input: FastAPI assumes its own shape of error."""
    for operations in document["paths"].values():
        for operation in operations.values():
            responses = operation["responses"]
            if "HTTPValidationError" in str(responses.get("422")):
                responses["422"] = problems.responses(422)[422]
    for name in ("HTTPValidationError", "ValidationError"):
        document["components"]["schemas"].pop(name, None)


def _parameters(settings: Settings, examples: dict[str, Json]) -> list[Json]:
    """Return the query parameters of a shape: every solver's axes and stage, and what is common to all."""
    found: dict[str, Json] = {}
    for name in registry.names():
        solver = vocabulary.solver_named(name)
        stage = solver.stages
        whole = [
            *vocabulary.axes(name).values(),
            vocabulary.Axis(stage.symbol, stage.long_name, stage.units, stage.lowest, stage.highest, None),
        ]
        for axis in whole:
            found.setdefault(axis.name, _axis(axis, examples.get(axis.name, {})))
    return [*found.values(), *_what(settings), *_how()]


def _what(settings: Settings) -> list[Json]:
    """Return the parameters that say which shape: of which table, when, how fine, with what."""
    return [
        _query(
            "resolution",
            f"Colatitude samples, {LOWEST_RESOLUTION} to {settings.max_resolution}; azimuth has twice as many. "
            "64 and 64x128 are the same. Without it, the table's own.",
            {"type": "string", "pattern": "^[0-9]+(x[0-9]+)?$", "examples": ["64", "64x128"]},
        ),
        *(_query(name, text, dict(schema)) for name, (text, schema) in detail.parameters().items()),
        _query("hours", "Hours of drying in place of the stage", {"type": "number", "minimum": 0}),
        _query(
            "under",
            "Conditions of the hours as name:value, joined by commas; GET /v1/solvers/{solver}/stages explains them",
            {"type": "string", "pattern": f"^{UNDER}$", "examples": ["kinetics:grape"]},
        ),
        _query(
            "table",
            "Name of the table. Without it, the one that holds what is asked",
            {"type": "string"},
        ),
        _query(
            "preset",
            "Named parameters, for what is not said: "
            + ", ".join(f"{name}: {', '.join(vocabulary.solver_named(name).presets)}" for name in registry.names()),
            {"type": "string"},
        ),
    ]


def _how() -> list[Json]:
    """Return the parameters that say how a shape is looked up and handed over, and what becomes of a bad one."""
    return [
        _query(
            "format",
            "Representation; goes before the Accept header",
            {"type": "string", "enum": list(FORMATS)},
        ),
        _query(
            "method",
            f"How to look up: a weighting ({', '.join(methods.WEIGHTINGS)}) and corrections "
            f"({', '.join(methods.CORRECTIONS)}), joined by plus signs. Without it, {methods.DEFAULT}; "
            "idw is the paper's.",
            {"type": "string", "pattern": _METHOD, "examples": list(methods.NAMED)},
        ),
        _query(
            "max_error",
            "Largest expected error: a number limits the roughness's, measure:number another, joined by commas. "
            f"Measures: {', '.join(f'{name} [{unit}]' for name, unit in UNITS.items())}; rgh and corr as shares off 1.",
            {"type": "string", "pattern": f"^{LIMITS}$", "examples": ["0.05", "rgh:0.05,dB:1.5"]},
        ),
        _query(
            "exact",
            "run: what max_error refuses, or the table does not reach, is run as a job; relax: what the table answers "
            "is relaxed by its solver, a short job. Both need a token",
            {"type": "string", "enum": list(EXACT)},
        ),
    ]


def _axis(axis: vocabulary.Axis, examples: Json) -> Json:
    schema: Json = {"type": "number"}
    if axis.lowest is not None:
        schema["minimum"] = axis.lowest
    if axis.highest is not None:
        schema["maximum"] = axis.highest
    units = "dimensionless" if axis.units == "1" else axis.units
    parameter = _query(axis.name, f"{axis.description} [{units}]", schema)
    if examples:
        parameter["examples"] = examples
    return parameter


def _query(name: str, description: str, schema: Json) -> Json:
    return {"name": name, "in": "query", "required": False, "description": description, "schema": schema}


def _examples(tables: LiveTables) -> dict[str, Json]:
    """Return, for each axis and stage, the ends of the ranges of the tables that have it; nothing without a store."""
    found: dict[str, Json] = {}
    try:
        for name in tables.names():
            table = tables.get(name)
            symbol = vocabulary.solver_named(table.info.solver).stages.symbol
            ends = {**table.axes, symbol: table.reach}
            for axis, (low, high) in ends.items():
                entry = found.setdefault(axis, {})
                entry[f"{name}-lowest"] = {"summary": f"lowest in table {name}", "value": float(low)}
                entry[f"{name}-highest"] = {"summary": f"highest in table {name}", "value": float(high)}
    except StoreError:
        return {}
    return found
