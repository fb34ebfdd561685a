"""Who may do what: bearer tokens with the scopes read, run and admin.

Reading is free unless an operator says otherwise; nothing else ever is.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Coroutine
from typing import Annotated, Any

from fastapi import Request, Security
from fastapi.datastructures import State
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from fastapi.security.utils import get_authorization_scheme_param

from store.tokens import Scope, Token

from .errors import Forbidden, Unauthorized

__all__ = ["authorize", "bearer", "requires"]

_REALM = 'Bearer realm="wizen"'

_SCHEME = HTTPBearer(
    scheme_name="token",
    description="A secret of `wizen token create`. Scopes: read, run (includes read), admin (includes both).",
    auto_error=False,
)


def requires(scope: Scope) -> Callable[..., Coroutine[Any, Any, Token]]:
    """Return the dependency that lets a request pass only with a token for `scope`, which it returns."""

    async def check(
        request: Request, given: Annotated[HTTPAuthorizationCredentials | None, Security(_SCHEME)] = None
    ) -> Token:
        return authorize(request.app.state, given.credentials if given else None, scope)

    return check


def bearer(request: Request) -> str | None:
    """Return the secret that a request carries, for routes where only some questions need one."""
    scheme, secret = get_authorization_scheme_param(request.headers.get("authorization"))
    return secret if scheme.lower() == "bearer" else None


def authorize(state: State, secret: str | None, scope: Scope) -> Token:
    """Return the token of a secret that is good for `scope`.

    Raises:
        Unauthorized: there is no secret, or its token is unknown or has expired.
        Forbidden: the token lacks the scope.
        CorruptTokens: the file of tokens is damaged.

    """
    advice = f"On the service's machine: wizen token create --store DIR --name NAME --scopes {scope}"
    if not secret:
        raise Unauthorized(
            f"this needs a token with the scope {scope!r}.",
            advice=f"Send it as 'Authorization: Bearer ...'. {advice}",
            headers={"WWW-Authenticate": _REALM},
        )
    token: Token | None = state.tokens.find(secret)
    invalid = {"WWW-Authenticate": f'{_REALM}, error="invalid_token"'}
    if token is None:
        raise Unauthorized("the token is not known here.", advice=f"It may be revoked. {advice}.", headers=invalid)
    if token.expired:
        ended = time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime(token.expires))
        raise Unauthorized(f"the token {token.name!r} expired on {ended}.", advice=f"{advice}.", headers=invalid)
    if not token.allows(scope):
        raise Forbidden(
            f"the token {token.name!r} has the scopes {', '.join(token.scopes)}, not {scope!r}.",
            advice=f"{advice}.",
            headers={"WWW-Authenticate": f'{_REALM}, error="insufficient_scope", scope="{scope}"'},
        )
    return token
