"""The grammar that all commands share: presets, `--set NAME=VALUE`, stages, quality, outputs."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import InvalidOption
from .console import note

if TYPE_CHECKING:
    from solver.contract import Solver

__all__ = [
    "As_json",
    "Hours",
    "Most_seconds",
    "Out",
    "Params",
    "Preset",
    "Quality",
    "Seed",
    "Set",
    "Stages",
    "StorePath",
    "StoreToRead",
    "TableName",
    "Under",
    "assignments",
    "check_place",
    "numbers",
    "parameters",
    "shown",
    "stages_asked",
    "with_files",
]

Preset = Annotated[str | None, typer.Option("--preset", help="Named parameters to start from (`wizen presets`).")]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="A parameter, e.g. te=0.04 or stone=0.4,0.3. Repeatable."),
]
Params = Annotated[
    Path | None,
    typer.Option(
        "--params",
        metavar="FILE",
        help='TOML or JSON of parameters, over --preset; --set goes over it. "@FILE" is a mesh or a picture beside it.',
    ),
]
Stages = Annotated[str | None, typer.Option("--stages", metavar="S,S,...", help="Stages, e.g. 0.05,0.1.")]
Hours = Annotated[
    str | None, typer.Option("--hours", metavar="H,H,...", help="Hours of drying in place of --stages, e.g. 24,48.")
]
Under = Annotated[
    list[str] | None,
    typer.Option("--under", metavar="NAME=VALUE", help="A condition of --hours, e.g. temperature=60. Repeatable."),
]
Quality = Annotated[str | None, typer.Option("--quality", help="preview, default or fine.")]
Most_seconds = Annotated[
    float | None,
    typer.Option(
        "--max-seconds", min=0, help="Refuse, before any work, what is expected to take longer on this machine."
    ),
]
Seed = Annotated[int | None, typer.Option("--seed", help="Seed of everything random in the run.")]
Out = Annotated[Path | None, typer.Option("--out", metavar="FILE", help="Where the result goes; the suffix says how.")]
As_json = Annotated[bool, typer.Option("--json", help="Print one JSON document; everything else goes to stderr.")]
StorePath = Annotated[Path, typer.Option("--store", metavar="DIR", envvar="WIZEN_STORE", help="The store's directory.")]
StoreToRead = Annotated[
    Path | None,
    typer.Option(
        "--store",
        metavar="DIR",
        envvar="WIZEN_STORE",
        help="The store's directory; the package's own table if left out.",
    ),
]
TableName = Annotated[str, typer.Option("--name", help="Name of the table.")]


#: What pairs of names and values look like, by option.
_EXAMPLES = {"--set": "--set te=0.04", "--under": "--under temperature=60"}
#: Longest value [characters] of a title; longer ones are lists and tables.
_SHORT = 24


def assignments(pairs: Sequence[str] | None, option: str = "--set") -> dict[str, Any]:
    """Return the values of `--set NAME=VALUE` options, or of another option of that grammar.

    VALUE is TOML or JSON, a list without brackets, @ and a mesh file, or plain text.

    Raises:
        InvalidOption: no NAME=, a name given twice, or a mesh file that cannot be read.

    """
    values: dict[str, Any] = {}
    for pair in pairs or ():
        name, equals, text = (part.strip() for part in pair.partition("="))
        if not (name and equals and text):
            raise InvalidOption(f"{option} {pair!r} is not NAME=VALUE.", f"Write for example {_EXAMPLES[option]}.")
        if name in values:
            raise InvalidOption(f"{option} {name} is given twice.", "Keep one of them.")
        values[name] = _value(text)
    return values


def shown(pairs: Sequence[str]) -> str:
    """Return what --set options say as a line of a title; of long values the names alone."""
    parts = (pair.partition("=") for pair in pairs)
    words = [(name.strip(), text.strip()) for name, _, text in parts]
    return ", ".join(f"{name} = {text}" if len(text) <= _SHORT else f"{name} = …" for name, text in words)


def parameters(path: Path | None) -> dict[str, Any]:
    """Return the parameters in a file of TOML or JSON, meshes and pictures of files beside it read; none for None.

    Raises:
        InvalidOption: no such file, or it cannot be read as its suffix says.

    """
    if path is None:
        return {}
    try:
        text = path.read_text(encoding="utf-8")
        values = json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
    except OSError as error:
        raise InvalidOption(f"--params {path}: {error.strerror}.", "Name a TOML or JSON file.") from None
    except ValueError as error:  # both libraries' errors, and what is no text
        raise InvalidOption(f"--params {path}: {error}.", "Write TOML, or JSON in a .json file.") from None
    if not isinstance(values, dict):
        raise InvalidOption(f"--params {path} holds no names and values.", 'Write for example {"thickness": 0.02}.')
    return {name: with_files(value, path.parent) for name, value in values.items()}


def with_files(value: Any, folder: Path, name: str = "") -> Any:
    """Return a value of a file in `folder` in which every text "@FILE" is what that file holds.

    What is called `picture` is one as it is; other pictures are maps around a body.
    """
    if isinstance(value, dict):
        return {each: with_files(own, folder, each) for each, own in value.items()}
    if isinstance(value, list):
        return [with_files(each, folder, name) for each in value]
    return _file(folder / value[1:], name) if isinstance(value, str) and value.startswith("@") else value


def _file(path: Path, name: str = "") -> Any:
    """Return the picture or the mesh of a file, as what bears that name takes it."""
    from . import meshfile, picturefile

    if path.suffix.lower() not in picturefile.KINDS:
        return meshfile.read(path)
    return picturefile.picture(path) if name == "picture" else picturefile.read(path)


def _value(text: str) -> Any:
    if text.startswith("@"):
        return _file(Path(text[1:]))
    readers: list[Callable[[], Any]] = [lambda: tomllib.loads(f"value = {text}")["value"], lambda: json.loads(text)]
    if "," in text:
        readers.append(lambda: tomllib.loads(f"value = [{text}]")["value"])
    for read in readers:
        try:
            return read()
        except ValueError:  # both libraries' errors are ValueErrors
            continue
    return text


def check_place(option: str, path: Path) -> None:
    """Refuse, before any work, a file that could not be written after it.

    Raises:
        InvalidOption: it is a directory, or in none.

    """
    if path.is_dir():
        raise InvalidOption(f"{option} {path} is a directory.", "Name a file in it.")
    if not path.absolute().parent.is_dir():
        raise InvalidOption(f"{option} {path}: there is no directory {path.parent}.", "Create it first.")


def numbers(text: str | None, option: str = "--stages") -> tuple[float, ...]:
    """Return the numbers of a comma-separated list; none for None.

    Raises:
        InvalidOption: something in it is not a finite number.

    """
    values = []
    for part in (text or "").split(","):
        if text is None:
            break
        try:
            value = float(part)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise InvalidOption(
                f"{option} {text!r}: {part!r} is not a number.", f"Write for example {option} 0.05,0.1."
            )
        values.append(value)
    return tuple(values)


def stages_asked(
    solver: Solver, stages: str | None, hours: str | None, under: Sequence[str] | None, preset: str | None
) -> tuple[float, ...]:
    """Return the stages that --stages names, or --hours under the conditions of --under.

    Raises:
        InvalidOption: both, or conditions without hours.
        InvalidInput: the solver knows no hours, or not under these conditions.

    """
    from solver.contract import InvalidInput

    if hours is None:
        if under:
            raise InvalidOption("--under says how --hours are spent, and there are none.", "Write --hours 24,48.")
        return numbers(stages)
    if stages is not None:
        raise InvalidOption("--hours and --stages exclude each other.", "Keep one of them.")
    asked, conditions = numbers(hours, "--hours"), assignments(under, "--under")
    try:
        found = solver.stages_after(asked, conditions, preset)
    except InvalidInput as error:
        raise InvalidInput(error.message, advice=solver.conditions_as(error.advice, _under)) from None
    # stages come in their own order, and those that are the same once
    said = ", ".join(f"{stage:g} after {hour:g} h" for hour, stage in zip(asked, found, strict=True))
    note(f"{solver.stages.symbol} = {said}")
    return found


def _under(conditions: Mapping[str, str]) -> str:
    """Return conditions as the command line is told them."""
    return " ".join(f"--under {name}={value}" for name, value in conditions.items())
