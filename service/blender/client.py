"""What the extension asks of a wizen service, with the standard library alone; calls wait, so threads make them."""

from __future__ import annotations

import json
import struct
import urllib.error
import urllib.parse
import urllib.request
from array import array
from collections.abc import Mapping
from typing import Any, NamedTuple

__all__ = ["Points", "Refused", "Service", "points"]

#: Longest that a call waits [s], and most bytes that an answer may have.
_PATIENCE, _MOST = 30.0, 1 << 30


class Refused(Exception):
    """What a service answered instead, or that there is none, in one sentence with what to do."""


class Points(NamedTuple):
    """A shape: colatitudes of its lattice, positions x, y, z of all vertices in a row, and what is said of it."""

    n: int
    positions: array[float]
    about: dict[str, Any]


def points(data: bytes) -> Points:
    """Return the shape in an answer of `format=points`.

    Raises:
        Refused: it is none.

    """
    if len(data) < 16 or data[:4] != b"WIZP":
        raise Refused("The service sent no points: is it wizen's?")
    version, n, length = struct.unpack_from("<III", data, 4)
    positions = array("f")
    if version != 1 or len(data) != 16 + length + 12 * (2 * n * n + 2):
        raise Refused(f"Points of version {version} that this extension cannot read: take the newest.")
    positions.frombytes(data[16 + length :])
    if struct.pack("=H", 1) != struct.pack("<H", 1):
        positions.byteswap()
    return Points(n, positions, json.loads(data[16 : 16 + length]))


class Service:
    """A service by its address, with a token where jobs are to be run."""

    def __init__(self, address: str, token: str = "") -> None:
        self._address, self._token = address.rstrip("/"), token

    def maps(self) -> list[dict[str, Any]]:
        """Return the families of shapes that can be asked for; those that cannot be read are left out.

        Raises:
            Refused: no answer.

        """
        found: list[dict[str, Any]] = self._json("/v1/maps")["maps"]
        return [one for one in found if "axes" in one]

    def solver(self, name: str) -> dict[str, Any]:
        """Return what a solver takes and gives: presets, sizes, stages.

        Raises:
            Refused: no answer.

        """
        found: dict[str, Any] = self._json(f"/v1/solvers/{urllib.parse.quote(name)}")
        return found

    def thumbnail(self, path: str) -> bytes:
        """Return a family's picture, a PNG.

        Raises:
            Refused: no answer.

        """
        return self.ask(path)

    def shape(self, solver: str, table: str, values: Mapping[str, float], n: int) -> Points:
        """Return a shape of a table.

        Raises:
            Refused: no answer, or what the service has against the question.

        """
        text = _query(table, values, resolution=n, format="points")
        return points(self.ask(f"/v1/shapes/{urllib.parse.quote(solver)}?{text}"))

    def parameters(self, solver: str, table: str, values: Mapping[str, float]) -> dict[str, Any]:
        """Return all that a run needs to be told to be the fruit of a table: what the table holds fixed, what follows
        its axes, and the words of its runs. What they were begun from is in the store that they were made in.

        Raises:
            Refused: no answer, or what the service has against the question.

        """
        about = self._json(f"/v1/shapes/{urllib.parse.quote(solver)}/info?{_query(table, values)}")
        words = {name: value for name, value in about.get("made", {}).items() if isinstance(value, str)}
        return {**about["params"], **words}

    def submit(self, solver: str, params: Mapping[str, Any], stages: list[float], quality: str) -> str:
        """Begin a job and return its address.

        Raises:
            Refused: no token, or what the service has against it.

        """
        body: dict[str, Any] = {"solver": solver, "params": dict(params), "need": {"quality": quality}}
        if stages:
            body["need"]["stages"] = stages
        address: str = self._json("/v1/jobs", body)["links"]["self"]
        return address

    def job(self, address: str) -> dict[str, Any]:
        """Return the state of a job.

        Raises:
            Refused: no answer.

        """
        found: dict[str, Any] = self._json(address)
        return found

    def cancel(self, address: str) -> None:
        """Stop a job.

        Raises:
            Refused: it has ended.

        """
        self.ask(address, method="DELETE")

    def result(self, address: str, form: str) -> bytes:
        """Return a finished job's result in a format.

        Raises:
            Refused: it has not ended, or has nothing of the kind.

        """
        return self.ask(f"{address}/result?format={urllib.parse.quote(form)}")

    def _json(self, path: str, body: Mapping[str, Any] | None = None) -> Any:
        data = None if body is None else json.dumps(body).encode()
        try:
            return json.loads(self.ask(path, data))
        except ValueError:
            raise Refused(f"{self._address} answers, but not as wizen does.") from None

    def ask(self, path: str, data: bytes | None = None, method: str | None = None) -> bytes:
        """Return the body of an answer.

        Raises:
            Refused: there is none, or a refusal.

        """
        address = path if path.startswith(("http://", "https://")) else self._address + path
        headers = {"Accept": "*/*", "Content-Type": "application/json"}
        if self._token:
            headers["Authorization"] = f"Bearer {self._token}"
        try:
            request = urllib.request.Request(address, data, headers, method=method)
            with urllib.request.urlopen(request, timeout=_PATIENCE) as answer:
                found: bytes = answer.read(_MOST)
                return found
        except urllib.error.HTTPError as error:
            raise Refused(_said(error)) from None
        except (OSError, ValueError) as error:
            why = getattr(error, "reason", error)
            raise Refused(f"Nobody answers at {self._address} ({why}): start `wizen serve`.") from None


def _query(table: str, values: Mapping[str, float], **more: Any) -> str:
    return urllib.parse.urlencode({"table": table, **{name: repr(float(v)) for name, v in values.items()}, **more})


def _said(error: urllib.error.HTTPError) -> str:
    try:
        problem = json.loads(error.read())
        return f"{problem['detail']} {problem.get('advice', '')}".strip()
    except (ValueError, KeyError, TypeError, OSError):
        return f"The service answered {error.code} {error.reason}."
