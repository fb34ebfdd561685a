"""Parts of a surface as a command names them: written as over HTTP, or as four numbers with commas.

How a part is written is for HTTP to say. Who reads it there reads it here too: `read_by` is told how, from above.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from ...errors import InvalidOption

if TYPE_CHECKING:
    from store.surfaces.window import Window

__all__ = ["Part", "Region", "check_file", "part", "read_by"]

Region = Annotated[
    str | None,
    typer.Option(
        "--region",
        metavar="A:B,C:D",
        help="Colatitudes A to B and azimuths C to D alone (degree), e.g. 45:90,350:20; A,B,C,D is the same.",
    ),
]

#: Files that hold a part of a surface as well; whole runs alone are written as the first.
_PARTS = (".h5", ".npz")
_TURN = 360.0


class Part(NamedTuple):
    """A part of a surface: its text, ranges of colatitude and azimuth in it [degree], and the window that they are."""

    text: str
    colatitude: tuple[float, float]
    azimuth: tuple[float, float]
    window: Window

    @property
    def need(self) -> dict[str, Any]:
        """Return the region of a run's need: from a smaller to a larger azimuth, which begins within 0 to 360."""
        left, right = self.azimuth
        while right < left:
            right += _TURN
        back = _TURN * math.floor(left / _TURN)
        azimuth = (0.0, _TURN) if right - left >= _TURN else (left - back, right - back)
        return {"colatitude": self.colatitude, "azimuth": azimuth}

    def said(self, resolution: int) -> dict[str, Any]:
        """Return which rows and columns of a lattice it is, first and count, as HTTP says them."""
        patch = self.window.on(resolution)
        return {"degrees": self.text, "rows": [patch.top, patch.height], "columns": [patch.left, patch.width]}


_readers: list[Callable[[str], Part]] = []


def read_by(reader: Callable[[str], Part]) -> None:
    """Have parts read by `reader`, which raises InvalidOption; it is called when one is named."""
    _readers.append(reader)


def part(text: str | None) -> Part | None:
    """Return the part that --region names; None where it names none.

    Raises:
        InvalidOption: it is written otherwise, is empty, or is not on the surface.

    """
    if text is None:
        return None
    if not _readers:
        raise InvalidOption("--region is not read by this command line.", "Use the command `wizen`.")
    return _readers[-1](_with_colons(text))


def check_file(out: Path, run: bool) -> None:
    """Refuse, before any work, to write a part of a run or of a table's shape where only a whole surface can be.

    Raises:
        InvalidOption: it is such a file.

    """
    known = _PARTS if run else _PARTS[1:]
    if out.suffix.lower() not in known:
        raise InvalidOption(
            f"--out {out}: {out.suffix} holds whole surfaces, and --region leaves a part.",
            f"Leave --region out, or write {' or '.join(known)}.",
        )


def _with_colons(text: str) -> str:
    """Return four numbers with commas as two ranges; anything else as it is."""
    try:
        values = [f"{float(word):.9f}".rstrip("0").rstrip(".") for word in text.split(",")]
    except ValueError:
        return text
    return "{}:{},{}:{}".format(*values) if len(values) == 4 else text
