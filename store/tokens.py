"""Access tokens: who may ask a service for what. Secrets are shown once and kept as hashes, in a file of its owner's.

A secret holds 256 random bits, so that one SHA-256 is enough: there is no list of likely ones to try.
"""

from __future__ import annotations

import fcntl
import hashlib
import hmac
import json
import os
import re
import secrets
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from . import seal
from .errors import CorruptTokens, InvalidToken, UnknownToken, full_disk
from .starter import check_own

__all__ = ["SCOPES", "Scope", "Token", "Tokens"]

Scope = Literal["read", "run", "admin"]
#: Each includes those before it.
SCOPES: tuple[Scope, ...] = get_args(Scope)

#: Longest life of a token [s]: 300 years.
_LONGEST = 300 * 365.25 * 86400
#: No time is later [s since the epoch].
_LATEST = 1e11

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _.@-]{0,63}")
_DIGEST = re.compile(r"[0-9a-f]{64}")
_FORM = re.compile(r"wizen_([0-9a-f]{12})_[A-Za-z0-9_-]{43}")

#: A file as the file system tells it: another inode, time or size is another content.
_Stamp = tuple[int, int, int]


@dataclass(frozen=True)
class Token:
    """What is kept of a token. Times are seconds since the epoch; `expires` None is never."""

    id: str
    name: str
    scopes: tuple[Scope, ...]
    created: float
    expires: float | None
    digest: str

    def allows(self, scope: Scope) -> bool:
        """Return whether the token is good for `scope`; run includes read, admin includes both."""
        return any(SCOPES.index(own) >= SCOPES.index(scope) for own in self.scopes)

    @property
    def expired(self) -> bool:
        """Whether its time is over."""
        return self.expires is not None and time.time() >= self.expires


class Tokens:
    """The tokens of the store in `root`; safe among threads and processes."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self.path = root / "tokens.json"
        self._seen: tuple[_Stamp, dict[str, Token]] | None = None

    def create(self, name: str, scopes: Sequence[Scope], seconds: float | None = None) -> tuple[Token, str]:
        """Make a token and return it with its secret, which is not kept. It ends after `seconds` (None: never).

        Raises:
            InvalidToken: a name that is taken or no name, no scope, a time that is not ahead.
            ReadOnlyStore: the store is the package's own.
            StorageFull: the disk is full.

        """
        check_own(self._root)
        if _NAME.fullmatch(name) is None:
            raise InvalidToken(f"{name!r} is not a token's name.", "Use letters, digits and '_.@-', at most 64.")
        if not scopes or not set(scopes) <= set(SCOPES):
            raise InvalidToken(f"no token can have the scopes {list(scopes)}.", f"Choose from {', '.join(SCOPES)}.")
        if seconds is not None and not 0 < seconds <= _LONGEST:
            what = "a token must expire in the future" if seconds <= 0 else "a token expires within 300 years"
            raise InvalidToken(f"{what}.", "Leave the time out for one that never does.")
        number = secrets.token_hex(6)
        secret = f"wizen_{number}_{secrets.token_urlsafe(32)}"
        now = time.time()
        ordered = tuple(scope for scope in SCOPES if scope in scopes)
        token = Token(number, name, ordered, now, None if seconds is None else now + seconds, _hash(secret))
        with self._change() as found:
            if any(other.name == name for other in found.values()):
                raise InvalidToken(f"there is a token {name!r} already.", "Choose another name, or revoke that one.")
            found[number] = token
        return token, secret

    def revoke(self, name: str) -> Token:
        """Take back the token of that name or id; it is refused from now on.

        Raises:
            UnknownToken: there is none.

        """
        with self._change() as found:
            for token in found.values():
                if name in (token.id, token.name):
                    return found.pop(token.id)
            known = ", ".join(token.name for token in found.values()) or "none"
            raise UnknownToken(f"there is no token {name!r}.", f"Known: {known}.")

    def all(self) -> list[Token]:
        """Return all tokens, oldest first.

        Raises:
            CorruptTokens: the file is damaged.

        """
        return sorted(self._read().values(), key=lambda token: token.created)

    def find(self, secret: str) -> Token | None:
        """Return the token that a secret belongs to, expired or not; None for a secret of no token.

        Raises:
            CorruptTokens: the file is damaged.

        """
        form = _FORM.fullmatch(secret)
        token = self._read().get(form[1]) if form else None
        # the id is no secret; the hashes are compared in a time that says nothing about where they differ
        return token if token is not None and hmac.compare_digest(token.digest, _hash(secret)) else None

    def _read(self) -> dict[str, Token]:
        """Return the tokens by id; the file is read again when it has changed."""
        try:
            status = self.path.stat()
            stamp = status.st_ino, status.st_mtime_ns, status.st_size
            if self._seen is None or self._seen[0] != stamp:
                self._seen = stamp, {entry["id"]: _token(entry) for entry in json.loads(self.path.read_bytes())}
        except FileNotFoundError:
            return {}
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise CorruptTokens(f"{self.path} is damaged ({error}).", "Delete it and create new tokens.") from error
        return self._seen[1]

    @contextmanager
    def _change(self) -> Iterator[dict[str, Token]]:
        """Yield the tokens to change; they are written, whole or not at all, on leaving without an error."""
        with full_disk(self.path):
            handle = os.open(self._root / "tokens.lock", os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX)
            found = dict(self._read())
            yield found
            data = json.dumps([asdict(token) for token in found.values()], indent=1).encode()
            with seal.scratch(self.path, private=True) as temporary:
                temporary.write_bytes(data)
                seal.adopt(temporary, self.path)
        finally:
            os.close(handle)


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()


def _token(entry: dict[str, Any]) -> Token:
    """Return the token in an entry of the file.

    Raises:
        TypeError, KeyError, ValueError: it is none.

    """
    token = Token(**{**entry, "scopes": tuple(entry["scopes"])})
    if not all(isinstance(said, str) for said in (token.id, token.name)) or not set(token.scopes) <= set(SCOPES):
        raise ValueError("a token has an id, a name and scopes")
    if _DIGEST.fullmatch(token.digest) is None:
        raise ValueError("a token has a digest")
    if not all(0 <= when < _LATEST for when in (token.created, 0 if token.expires is None else token.expires)):
        raise ValueError("a token's times are seconds since the epoch")
    return token
