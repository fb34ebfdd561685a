"""Who asks: shares and limits per client need a name for each."""

from __future__ import annotations

import hashlib
import ipaddress
from functools import lru_cache

from starlette.types import Scope

__all__ = ["address", "client_of"]


def client_of(scope: Scope) -> str:
    """Return a name of whoever sent a request: by its token, else by its address."""
    for name, value in scope["headers"]:
        if name == b"authorization":
            return f"token {hashlib.blake2b(value, digest_size=8).hexdigest()}"
    client = scope.get("client")
    return address(client[0] if client else "")


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
