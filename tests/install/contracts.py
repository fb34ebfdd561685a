"""Contracts between solvers that need no list of them: each is found by its `run.py`, as the registry finds it."""

from __future__ import annotations

import re
from typing import Any

from grimp import ImportGraph
from importlinter.contracts.forbidden import ForbiddenContract
from importlinter.contracts.independence import IndependenceContract
from importlinter.domain import fields
from importlinter.domain.contract import ContractCheck
from importlinter.domain.imports import ModuleExpression

__all__ = ["SolversApart", "SolversUnseen", "solvers"]


def solvers(graph: ImportGraph) -> set[str]:
    """Return the packages of all solvers."""
    return {found[1] for module in graph.modules if (found := re.fullmatch(r"(solver\.\w+)\.run", module))}


def _expressions(graph: ImportGraph) -> set[Any]:
    return {ModuleExpression(name) for name in solvers(graph)}


class SolversApart(IndependenceContract):
    """No solver imports another, not even by way of what they share."""

    modules = fields.SetField(subfield=fields.ModuleExpressionField(), required=False)

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:
        """Check the solvers that the graph holds."""
        self.modules = _expressions(graph)
        return super().check(graph, verbose)


class SolversUnseen(ForbiddenContract):
    """Modules that import no solver."""

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:
        """Forbid the solvers that the graph holds besides what is named."""
        self.forbidden_modules = [*self.forbidden_modules, *_expressions(graph)]
        return super().check(graph, verbose)
