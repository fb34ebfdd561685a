"""The size of rooms and functions: what fits on a page is read, what does not is not."""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FLOORS = ("solver", "store", "sweeps", "service", "benchmarks")
# generated kernels are cached beside what generates them
FILES = sorted(path for floor in FLOORS for path in (ROOT / floor).rglob("*.py") if "__pycache__" not in path.parts)
#: Decorators of what is compiled: a kernel takes arrays, and calls of kernels by kernels cost.
COMPILED = ("njit", "intrinsic")
LINES, LONG, ARGUMENTS, SIDE_BY_SIDE = 60, 10, 10, 16

Function = ast.FunctionDef | ast.AsyncFunctionDef


def functions(source: str) -> list[Function]:
    """Return all functions in a source, methods and those within others too."""
    return [node for node in ast.walk(ast.parse(source)) if isinstance(node, Function)]


def length(function: Function) -> int:
    """Return how many lines it has from `def` on, its docstring among them."""
    assert function.end_lineno is not None
    return function.end_lineno - function.lineno + 1


def arguments(function: Function) -> int:
    """Return how many arguments a caller may give."""
    given = function.args
    names = [each.arg for each in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    return len(names) - (names[:1] in (["self"], ["cls"]))


def compiled(function: Function) -> bool:
    """Return whether it is a kernel."""
    return any(word in ast.unparse(each) for each in function.decorator_list for word in COMPILED)


def test_what_is_measured() -> None:
    source = "class A:\n  @njit(cache=True)\n  def f(self, a, /, b, *, c):\n    x = 1\n\n    return x\n  def g(): ...\n"
    f, g = functions(source)
    assert (length(f), arguments(f), compiled(f)) == (4, 3, True)
    assert (length(g), arguments(g), compiled(g)) == (1, 0, False)


def test_few_functions_are_longer_than_a_page() -> None:
    assert len(FILES) > 300
    found = [
        f"{path.relative_to(ROOT)}: {one.name} has {length(one)} lines"
        for path in FILES
        for one in functions(path.read_text())
        if length(one) > LINES
    ]
    assert len(found) <= LONG, "\n".join(found)


def test_only_kernels_take_many_arguments() -> None:
    found = [
        f"{path.relative_to(ROOT)}: {one.name} takes {arguments(one)}"
        for path in FILES
        for one in functions(path.read_text())
        if arguments(one) > ARGUMENTS and not compiled(one)
    ]
    assert not found, "\n".join(found)


def test_rooms_are_not_crowded() -> None:
    counts = Counter(path.parent for path in FILES if path.name != "__init__.py")
    found = [f"{folder.relative_to(ROOT)}: {count}" for folder, count in counts.items() if count > SIDE_BY_SIDE]
    assert not found, "\n".join(found)
