"""Authentication by bearer token, by browser session, or, while there are no tokens, by a private socket."""

from contextlib import suppress
from typing import Annotated, NamedTuple

from fastapi import Depends
from fastapi.requests import HTTPConnection
from starlette.concurrency import run_in_threadpool
from starlette.types import Scope

from grabberd.api.guard.failed_attempts import Attempts, client_of
from grabberd.api.guard.refusals import Refusal
from grabberd.documents.roles import Role
from grabberd.errors import AccessExpired, StorageError
from grabberd.service.access import AT_THE_MACHINE, Access, Identity

COOKIE = "grabberd_session"
_CHALLENGE = 'Bearer realm="grabberd"'
_INVALID_TOKEN = {"WWW-Authenticate": f'{_CHALLENGE}, error="invalid_token"'}
_FORGET_COOKIE = f"{COOKIE}=; Max-Age=0; Path=/; HttpOnly; SameSite=Strict"


class Credentials(NamedTuple):
    """Credentials in a request."""

    bearer: str | None
    session: str | None

    @classmethod
    def of(cls, scope: Scope) -> "Credentials":
        """The credentials of a request; schemes other than Bearer are ignored."""
        connection = HTTPConnection(scope)
        scheme, _, secret = connection.headers.get("authorization", "").partition(" ")
        bearer = secret.strip() if scheme.lower() == "bearer" else None
        return cls(bearer, connection.cookies.get(COOKIE))

    @property
    def secret(self) -> str | None:
        """The secret to check: the bearer token, else the session."""
        return self.session if self.bearer is None else self.bearer


class Authenticator:
    """Identifies clients; the look-up reads the disk, so it runs in a thread."""

    def __init__(self, access: Access, private: bool, attempts: Attempts) -> None:
        self._access = access
        self._private = private
        self._attempts = attempts

    async def identify(self, scope: Scope) -> Identity:
        """Identifies the sender of a request.

        Raises:
            Refusal: 401, the sender is unknown; 429, too many attempts; 507, the tokens cannot be read.
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
        """True if a request's credentials are still valid; rechecked during a long response."""
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
    """Checks that an identity has a role.

    Raises:
        Refusal: 403, its role is not sufficient.
    """
    if identity.role.covers(least):
        return
    raise Refusal(
        403,
        "role-not-enough",
        f"this requires the role {least}, and you have {identity.role}",
        "ask the daemon's administrator for a token with that role: grabberd token add",
        {"WWW-Authenticate": 'Bearer realm="grabberd", error="insufficient_scope"'},
    )


def _unknown(shown: Credentials) -> Refusal:
    headers = {"WWW-Authenticate": _CHALLENGE}
    if shown.bearer is not None:
        headers = _INVALID_TOKEN
    elif shown.session is not None:
        headers["Set-Cookie"] = (
            _FORGET_COOKIE  # so that the browser does not keep sending a session that has ended
        )
    detail = "this requires a token" if shown.secret is None else "this token or session is invalid"
    hint = "send 'Authorization: Bearer TOKEN'; 'grabberd token add' on the daemon's machine makes one"
    return Refusal(401, "unauthorized", detail, hint, headers)


def _identity(connection: HTTPConnection) -> Identity:
    identity: Identity = connection.state.identity
    return identity


IdentityOf = Annotated[Identity, Depends(_identity)]
"""The client's identity, for routes that need it."""
