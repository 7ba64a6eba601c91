"""Who asks: a bearer token, a browser's session, or whoever is at the machine while there are no tokens."""

from contextlib import suppress
from typing import Annotated, NamedTuple

from fastapi import Depends
from fastapi.requests import HTTPConnection
from starlette.concurrency import run_in_threadpool
from starlette.types import Scope

from grabberd.api.guard.failed_attempts import Attempts, client_of
from grabberd.api.guard.refusals import Refusal
from grabberd.errors import AccessExpired, StorageError
from grabberd.service.access import AT_THE_MACHINE, Access, Identity
from grabberd.service.roles import Role

COOKIE = "grabberd_session"
_CHALLENGE = 'Bearer realm="grabberd"'
_INVALID_TOKEN = {"WWW-Authenticate": f'{_CHALLENGE}, error="invalid_token"'}
_FORGET_COOKIE = f"{COOKIE}=; Max-Age=0; Path=/; HttpOnly; SameSite=Strict"


class Credentials(NamedTuple):
    """What a request shows of who sends it."""

    bearer: str | None
    session: str | None

    @classmethod
    def of(cls, scope: Scope) -> "Credentials":
        """Those of a request; another scheme than Bearer is none."""
        connection = HTTPConnection(scope)
        scheme, _, secret = connection.headers.get("authorization", "").partition(" ")
        bearer = secret.strip() if scheme.lower() == "bearer" else None
        return cls(bearer, connection.cookies.get(COOKIE))

    @property
    def secret(self) -> str | None:
        """The one that counts."""
        return self.session if self.bearer is None else self.bearer


class Authenticator:
    """Tells who asks; the look-up reads the disk, so it runs beside the event loop."""

    def __init__(self, access: Access, private: bool, attempts: Attempts) -> None:
        self._access = access
        self._private = private
        self._attempts = attempts

    async def identify(self, scope: Scope) -> Identity:
        """Who sends a request.

        Raises:
            Refusal: 401, nobody whom the daemon knows; 429, too many attempts; 507, tokens cannot be read.
        """
        shown, client = Credentials.of(scope), client_of(scope)
        if shown.secret is not None:
            self._attempts.check(client, shown.secret)
        try:
            identity = await run_in_threadpool(self._look_up, shown)
        except AccessExpired as error:
            raise Refusal(401, "token-expired", error.message, error.hint, _INVALID_TOKEN) from error
        if identity is None:
            if shown.secret is not None:
                self._attempts.failed(client)
            raise _unknown(shown)
        if shown.secret is not None and identity.by != "socket":
            self._attempts.succeeded(client, shown.secret)
        return identity

    async def still_is(self, scope: Scope, least: Role) -> bool:
        """Whether what a request shows is still good: asked again while its answer goes on."""
        with suppress(AccessExpired):
            identity = await run_in_threadpool(self._look_up, Credentials.of(scope))
            return identity is not None and identity.role.covers(least)
        return False

    def _look_up(self, shown: Credentials) -> Identity | None:
        try:
            if shown.bearer is not None:
                return self._access.of_token(shown.bearer)
            if shown.session and (identity := self._access.of_session(shown.session)):
                return identity
            return AT_THE_MACHINE if self._private and not self._access.has_tokens else None
        except StorageError as error:
            raise Refusal(507, "storage-error", error.message, error.hint) from error


def check_role(identity: Identity, least: Role) -> None:
    """Whether somebody may.

    Raises:
        Refusal: 403, the role is not enough.
    """
    if identity.role.covers(least):
        return
    raise Refusal(
        403,
        "role-not-enough",
        f"this takes the role {least}, and you have {identity.role}",
        "ask the daemon's administrator for a token with that role: grabberd token add",
        {"WWW-Authenticate": 'Bearer realm="grabberd", error="insufficient_scope"'},
    )


def _unknown(shown: Credentials) -> Refusal:
    headers = {"WWW-Authenticate": _CHALLENGE}
    if shown.bearer is not None:
        headers = _INVALID_TOKEN
    elif shown.session is not None:
        headers["Set-Cookie"] = _FORGET_COOKIE  # a browser must not go on trying one that has ended
    detail = "this takes a token" if shown.secret is None else "nobody has this token or session"
    hint = "send 'Authorization: Bearer TOKEN'; 'grabberd token add' on the daemon's machine makes one"
    return Refusal(401, "unauthorized", detail, hint, headers)


def _identity(connection: HTTPConnection) -> Identity:
    identity: Identity = connection.state.identity
    return identity


IdentityOf = Annotated[Identity, Depends(_identity)]
"""Who asks, for routes that want to know."""
