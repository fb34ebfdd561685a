"""Plain numba source text of the elements, traced from `elements`, and the cache file it is imported from.

The generated functions read positions from and write forces to a scratch array of 24 x 16 floats and loop over the 16
lanes with nothing but affine indices, which LLVM's loop vectoriser turns into vector code.
"""

from __future__ import annotations

import importlib.util
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import TypeAlias

from solver.dehydration.kernel.algebra import (
    CORE_PLANES,
    EXOCARP_PLANES,
    ONE_POINT_PLANES,
    Number,
    Vector,
    refine_inverse_cube_root,
)
from solver.dehydration.kernel.elements import core_forces, exocarp_forces, one_point_forces
from solver.dehydration.kernel.generate.digest import source_digest
from solver.dehydration.kernel.strips import LANES


class Trace:
    """Statements so far, and the float32 constants they use."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.constants: dict[float, str] = {}

    def name(self, expression: str) -> Name:
        """A new variable that holds the expression."""
        name = f"t{len(self.lines)}"
        self.lines.append(f"{name} = {expression}")
        return Name(self, name)

    def operand(self, value: Name | float) -> str:
        """Text of an operand; floats become named float32 constants."""
        if isinstance(value, Name):
            return value.text
        return self.constants.setdefault(float(value), f"C{len(self.constants)}")


class Name:
    """Abstract number of `algebra`: a local variable of the generated function."""

    def __init__(self, trace: Trace, text: str) -> None:
        self.trace, self.text = trace, text

    def _binary(self, operator: str, left: Name | float, right: Name | float) -> Name:
        return self.trace.name(f"{self.trace.operand(left)} {operator} {self.trace.operand(right)}")

    def __add__(self, other: Name | float) -> Name:
        return self._binary("+", self, other)

    def __sub__(self, other: Name | float) -> Name:
        return self._binary("-", self, other)

    def __rsub__(self, other: float) -> Name:
        return self._binary("-", other, self)

    def __mul__(self, other: Name | float) -> Name:
        return self._binary("*", self, other)

    def __truediv__(self, other: Name | float) -> Name:
        return self._binary("/", self, other)

    def __rtruediv__(self, other: float) -> Name:
        return self._binary("/", other, self)

    __radd__ = __add__
    __rmul__ = __mul__


class TextArithmetic:
    """`algebra.Arithmetic` on names."""

    def __init__(self, trace: Trace) -> None:
        self.trace = trace

    def minimum(self, a: Name, b: Name | float) -> Name:
        """The smaller of two, as a conditional expression that LLVM turns into one instruction."""
        other = self.trace.operand(b)
        return self.trace.name(f"{a.text} if {a.text} < {other} else {other}")

    def maximum(self, a: Name, b: Name | float) -> Name:
        """The larger of two, likewise."""
        other = self.trace.operand(b)
        return self.trace.name(f"{a.text} if {a.text} > {other} else {other}")

    def inverse_cube_root(self, a: Name) -> Number:
        """a^(-1/3), from the guess of `bits`."""
        return refine_inverse_cube_root(a, self.trace.name(f"guess_inverse_cube_root({a.text})"))


ElementForces: TypeAlias = Callable[..., list[Vector]]

ELEMENTS: tuple[tuple[str, ElementForces, int], ...] = (
    ("core_block", core_forces, CORE_PLANES),
    ("exocarp_block", exocarp_forces, EXOCARP_PLANES),
    ("one_point_block", one_point_forces, ONE_POINT_PLANES),
)
HEAD = '''"""Generated from the element algebra of wizen's dehydration kernel; do not edit."""

import numpy as np
from numba import njit

from solver.dehydration.kernel.generate.bits import guess_inverse_cube_root

OPTIONS = {"error_model": "numpy", "fastmath": {"reassoc", "nsz", "arcp", "contract", "afn"}, "boundscheck": False}
'''


def element_source(name: str, forces_of: ElementForces, constants: dict[float, str]) -> Iterator[str]:
    """Lines of one block function; float constants are added to `constants`, value -> name."""
    trace = Trace()
    trace.constants = constants
    loaded: dict[int, Name] = {}

    def plane(index: int) -> Name:
        if index not in loaded:
            loaded[index] = trace.name(f"planes[block, {LANES * index} + lane]")
        return loaded[index]

    def vector(node: int) -> list[Name]:
        return [trace.name(f"positions[{LANES * (3 * node + i)} + lane]") for i in range(3)]

    nodal = forces_of(TextArithmetic(trace), [vector(node) for node in range(8)], plane, Name(trace, "theta"))
    yield "@njit(**OPTIONS, cache=True)"
    yield f"def {name}(positions, planes, block, theta, forces):"
    yield f"    for lane in range({LANES}):"
    yield from (f"        {line}" for line in trace.lines)
    for node, components in enumerate(nodal):
        for i, component in enumerate(components):
            yield f"        forces[{LANES * (3 * node + i)} + lane] = {component.text}"


def module_source() -> str:
    """Text of the generated module."""
    constants: dict[float, str] = {}
    functions = ["\n".join(element_source(name, forces_of, constants)) for name, forces_of, _ in ELEMENTS]
    values = "\n".join(f"{name} = np.float32({value!r})" for value, name in constants.items())
    return "\n\n\n".join([HEAD + values, *functions]) + "\n"


def cache_directories() -> Iterator[Path]:
    """Where the generated module may live, best first."""
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        yield Path(chosen)
    yield Path(__file__).with_name("__pycache__")
    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    yield Path(home) / "wizen"


def write_atomically(path: Path, text: str) -> None:
    """Concurrent writers of the same file all succeed; readers see all of it or none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.stem, suffix=".tmp")
    try:
        with os.fdopen(descriptor, "w", encoding="utf-8") as file:
            file.write(text)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def generated_path() -> Path:
    """The generated module's file, written if it is not there yet; OSError if no directory can be written."""
    file_name = f"wizen_elements_{source_digest('scalar')[:16]}.py"
    failure: OSError | None = None
    for directory in cache_directories():
        path = directory / file_name
        if path.is_file():
            return path
        try:
            write_atomically(path, module_source())
        except OSError as error:
            failure = error
        else:
            return path
    raise OSError("no cache directory is writable; set NUMBA_CACHE_DIR") from failure


def load_generated() -> ModuleType:
    """Import the generated module (a real file, so that numba can cache what it compiles from it)."""
    path = generated_path()
    name = f"solver.dehydration.kernel._{path.stem}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
