"""Who asks: shares and limits per client need a name for each."""

from __future__ import annotations

import ipaddress
from functools import lru_cache

from fastapi.security.utils import get_authorization_scheme_param
from starlette.types import Scope

from store.errors import CorruptTokens
from store.tokens import Token, Tokens

__all__ = ["address", "client_of"]


def client_of(scope: Scope, tokens: Tokens) -> str:
    """Return a name of whoever sent a request: by a token that is known, else by its address.

    Where reading is free nobody looks whether a token is one: named by what was sent, a client would be as many as it
    pleases.
    """
    for name, value in scope["headers"]:
        if name == b"authorization":
            token = _token(value.decode("latin-1"), tokens)
            if token is not None:
                return f"token {token.id}"
    client = scope.get("client")
    return address(client[0] if client else "")


def _token(sent: str, tokens: Tokens) -> Token | None:
    scheme, secret = get_authorization_scheme_param(sent)
    try:
        found = tokens.find(secret) if scheme.lower() == "bearer" else None
    except CorruptTokens:
        return None  # whoever needs one is told
    return None if found is None or found.expired else found


@lru_cache(maxsize=4096)
def address(host: str) -> str:
    """Return what one network address counts as: an IPv6 client has a whole /64 to choose from."""
    try:
        found = ipaddress.ip_address(host)
    except ValueError:
        return host
    if found.version == 6:
        mapped = found.ipv4_mapped
        return str(mapped or ipaddress.ip_network((found, 64), strict=False))
    return host
