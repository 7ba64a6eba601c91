"""Authentication by token, by browser session, or, without any tokens, by a private socket; and roles.

Failed attempts are throttled for each client address, and logged from time to time. The minimum role for
every route stands in one table; the first match applies, and None means public. Routes of extensions need no
rows: GET requires a viewer, anything else an operator.
"""

import ipaddress
import logging
import math
import re
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache, lru_cache
from typing import Annotated, NamedTuple

from fastapi import Depends
from fastapi.requests import HTTPConnection
from starlette.concurrency import run_in_threadpool
from starlette.routing import compile_path
from starlette.types import Scope

from grabberd.archive.access import AT_THE_MACHINE, Access, Identity, NotRemembered, enter, hash_of
from grabberd.documents.enums import Role
from grabberd.errors import AccessExpired, StorageError
from grabberd.extension import extensions, load
from grabberd.server.api.guard.front import ip_address
from grabberd.server.api.problems import Refusal

log = logging.getLogger(__name__)

FREE_ATTEMPTS = 10
"""Attempts without delay: a page makes several requests at once, and people mistype; then waits double."""
LONGEST_WAIT_S = 60.0
FORGOTTEN_AFTER_S = 600.0
ADDRESSES = 1024
PROVEN = 256
LOG_EVERY_S = 60.0
UNIX = "this machine"
COOKIE = "grabberd_session"
_CHALLENGE = 'Bearer realm="grabberd"'
_INVALID_TOKEN = {"WWW-Authenticate": f'{_CHALLENGE}, error="invalid_token"'}
_FORGET_COOKIE = f"{COOKIE}=; Max-Age=0; Path=/; HttpOnly; SameSite=Strict"


def client_of(scope: Scope) -> str:
    """The client as limits count it: an IPv4 address, or the /64 network of an IPv6 host."""
    client = scope.get("client")
    if not client or not client[0]:
        return UNIX
    address = _address_of(scope)
    if address is None:
        return str(client[0])
    if isinstance(address, ipaddress.IPv4Address):
        return str(address)
    return str(ipaddress.ip_network((address, 64), strict=False))


def is_here(scope: Scope) -> bool:
    """True if a client of a private socket is on this machine, and not a remote client of a local proxy."""
    address = _address_of(scope)
    return address is None or address.is_loopback


def _address_of(scope: Scope) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """The client's address; None for a Unix socket."""
    client = scope.get("client")
    return ip_address(str(client[0])) if client else None


class _Record(NamedTuple):
    failures: int
    until_s: float


class Attempts:
    """Counts failures by client, with a bounded number of entries.

    Previously valid tokens bypass throttling, so guessing from a shared address locks nobody out. They do not
    reset its count, or whoever has one could guess others without end; only quiet time does.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._records: OrderedDict[str, _Record] = OrderedDict()
        self._proven: OrderedDict[bytes, None] = OrderedDict()
        self._unlogged = 0
        self._log_at_s = -math.inf

    def check(self, client: str, secret: str) -> None:
        """Checks that a client may try now.

        Raises:
            Refusal: 429, the client has to wait; the secret is not checked.
        """
        record = self._records.get(client)
        wait_s = record.until_s - self._now_s() if record else 0.0
        if wait_s > 0 and hash_of(secret) not in self._proven:
            seconds = math.ceil(wait_s)
            raise Refusal(
                429,
                "too-many-attempts",
                f"too many invalid tokens came from {client}",
                f"try again in {seconds} s",
                {"Retry-After": str(seconds)},
            )

    def succeeded(self, secret: str) -> None:
        """Notes that a secret was valid."""
        enter(self._proven, hash_of(secret), None, PROVEN)

    def failed(self, client: str) -> None:
        """Notes that a secret was invalid."""
        now_s = self._now_s()
        before = self._records.get(client, _Record(0, now_s))
        failures = 1 if now_s - before.until_s > FORGOTTEN_AFTER_S else before.failures + 1
        enter(self._records, client, _Record(failures, now_s + _wait_s(failures)), ADDRESSES)
        self._log(client, now_s)

    def _log(self, client: str, now_s: float) -> None:
        self._unlogged += 1
        if now_s < self._log_at_s:
            return
        log.warning("refused invalid tokens or sessions: %d, the last from %s", self._unlogged, client)
        self._unlogged, self._log_at_s = 0, now_s + LOG_EVERY_S


def _wait_s(failures: int) -> float:
    beyond = failures - FREE_ATTEMPTS
    # The exponent is capped, or the power would overflow after a day of attempts.
    return 0.0 if beyond <= 0 else min(2.0 ** min(beyond - 1, 10), LONGEST_WAIT_S)


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
    """Identifies clients, from memory if possible, otherwise from the disk in a thread."""

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
            identity = await self._find(shown, scope)
        except AccessExpired as error:
            raise Refusal(401, "token-expired", error.message, error.hint, _INVALID_TOKEN) from error
        if identity is None:
            if shown.secret is not None:
                self._attempts.failed(client)
            raise _unknown(shown)
        if shown.secret is not None and identity.by != "socket":
            self._attempts.succeeded(shown.secret)
        return identity

    async def still_is(self, scope: Scope, least: Role) -> bool:
        """True if a request's credentials are still valid; rechecked during a long response."""
        with suppress(AccessExpired):
            identity = await self._find(Credentials.of(scope), scope)
            return identity is not None and identity.covers(least)
        return False

    async def _find(self, shown: Credentials, scope: Scope) -> Identity | None:
        with suppress(NotRemembered):
            return self._look_up(shown, scope, at_once=True)
        return await run_in_threadpool(self._look_up, shown, scope)

    def _look_up(self, shown: Credentials, scope: Scope, at_once: bool = False) -> Identity | None:
        try:
            if shown.bearer is not None:
                return self._access.of_token(shown.bearer, at_once=at_once)
            if shown.session and (identity := self._access.of_session(shown.session, at_once=at_once)):
                return identity
            here = self._private and is_here(scope)
            return AT_THE_MACHINE if here and not self._access.needs_token(at_once=at_once) else None
        except StorageError as error:
            raise Refusal(507, "storage-error", error.message, error.hint) from error


def check_role(identity: Identity, least: Role) -> None:
    """Checks that an identity has a role.

    Raises:
        Refusal: 403, its role is not sufficient.
    """
    if identity.covers(least):
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


async def _identity(connection: HTTPConnection) -> Identity:
    return connection.state.identity


IdentityOf = Annotated[Identity, Depends(_identity)]
"""The client's identity, for routes that need it."""

_OWN: dict[str, Role | None] = {
    "GET /": None,
    "GET /static/{version}/{path:path}": None,
    "GET /healthz": None,
    "GET /readyz": Role.VIEWER,
    "GET /metrics": Role.VIEWER,
    "GET /docs": None,
    "GET /docs/{path:path}": None,
    "GET /api/v1/docs": Role.VIEWER,
    "GET /api/v1/openapi.json": Role.VIEWER,
    "GET /api/v1/session": Role.VIEWER,
    "POST /api/v1/session": Role.VIEWER,
    "DELETE /api/v1/session": Role.VIEWER,
    "GET /api/v1/state": Role.VIEWER,
    "GET /api/v1/events": Role.VIEWER,
    "WEBSOCKET /api/v1/preview": Role.VIEWER,
    "WEBSOCKET /api/v1/points/stream": Role.VIEWER,
    "WEBSOCKET /api/v1/curves/stream": Role.VIEWER,
    "GET /api/v1/preview.png": Role.VIEWER,
    "GET /api/v1/devices": Role.VIEWER,
    "GET /api/v1/devices/{name}": Role.VIEWER,
    "GET /api/v1/devices/{name}/points": Role.VIEWER,
    "GET /api/v1/devices/{name}/curves": Role.VIEWER,
    "GET /api/v1/devices/{name}/light": Role.VIEWER,
    "GET /api/v1/devices/{name}/object": Role.VIEWER,
    "POST /api/v1/devices/{name}/check": Role.OPERATOR,
    "GET /api/v1/captures": Role.VIEWER,
    "GET /api/v1/captures.csv": Role.VIEWER,
    "GET /api/v1/captures.zip": Role.VIEWER,
    "POST /api/v1/captures": Role.OPERATOR,
    "PATCH /api/v1/captures": Role.OPERATOR,
    "POST /api/v1/captures/deletion": Role.OPERATOR,
    "GET /api/v1/captures/{capture_id}": Role.VIEWER,
    "PATCH /api/v1/captures/{capture_id}": Role.OPERATOR,
    "DELETE /api/v1/captures/{capture_id}": Role.OPERATOR,
    "POST /api/v1/captures/{capture_id}/stop": Role.OPERATOR,
    "POST /api/v1/captures/{capture_id}/trigger": Role.OPERATOR,
    "POST /api/v1/captures/{capture_id}/measure": Role.OPERATOR,
    "POST /api/v1/capture-groups": Role.OPERATOR,
    "GET /api/v1/capture-groups/{group_id}": Role.VIEWER,
    "POST /api/v1/capture-groups/{group_id}/stop": Role.OPERATOR,
    "POST /api/v1/capture-groups/{group_id}/trigger": Role.OPERATOR,
    "GET /api/v1/captures/{capture_id}/file": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/ledger": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/runs/{run}": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/points": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/points.csv": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/points.ply": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/points.parquet": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/points.mat": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/points.c3d": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/channels": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/channels.csv": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/fields/{n}.png": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/thumbnail.png": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/widths": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/replay/points": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/replay/pictures": Role.VIEWER,
    "GET /api/v1/calibrations": Role.VIEWER,
    "POST /api/v1/calibrations": Role.OPERATOR,
    "PUT /api/v1/calibrations/active": Role.OPERATOR,
    "PUT /api/v1/calibrations/{calibration_id}/rejection": Role.OPERATOR,
    "GET /api/v1/calibrations/{calibration_id}": Role.VIEWER,
    "GET /api/v1/calibrations/{calibration_id}/report": Role.VIEWER,
    "GET /api/v1/calibrations/{calibration_id}/report.json": Role.VIEWER,
    "GET /api/v1/calibration-frames": Role.VIEWER,
    "POST /api/v1/captures/{capture_id}/identification": Role.OPERATOR,
    "GET /api/v1/jobs": Role.VIEWER,
    "GET /api/v1/jobs/{job_id}": Role.VIEWER,
    "DELETE /api/v1/jobs/{job_id}": Role.OPERATOR,
    "GET /api/v1/settings": Role.VIEWER,
    "PUT /api/v1/settings": Role.OPERATOR,
    "GET /api/v1/config": Role.ADMIN,
    "GET /api/v1/diagnostics": Role.ADMIN,
}


@cache
def least_roles() -> Mapping[str, Role | None]:
    """The minimum role by method and path, for the program and its extensions."""
    routes = [route for one in extensions() for place in one.routes for route in load(place.target).routes]
    added = [(method, route.path) for route in routes for method in route.methods]
    return _OWN | {
        f"{method} /api/v1{path}": Role.VIEWER if method == "GET" else Role.OPERATOR for method, path in added
    }


class _Row(NamedTuple):
    method: str
    path: re.Pattern[str]
    least: Role | None


def _row(key: str, least: Role | None) -> _Row:
    method, _, template = key.partition(" ")
    return _Row(method, compile_path(template)[0], least)


REMEMBERED = 1024
"""Number of cached paths; trying all rows takes longer than everything else in the gate."""
LONGEST_REMEMBERED = 200
"""Longest cached path in characters: the client is not yet known and may send 32 KB."""


def _find(scope: Scope) -> _Row | None:
    method = "WEBSOCKET" if scope["type"] == "websocket" else scope["method"]
    find = _row_of if len(scope["path"]) <= LONGEST_REMEMBERED else _row_of.__wrapped__
    return find("GET" if method == "HEAD" else method, scope["path"])


@cache
def _rows() -> tuple[_Row, ...]:
    return tuple(_row(key, least) for key, least in least_roles().items())


@lru_cache(REMEMBERED)
def _row_of(method: str, path: str) -> _Row | None:
    return next((row for row in _rows() if row.method == method and row.path.match(path)), None)


def is_declared(method: str, path: str) -> bool:
    """True if the table has a row for this method and path."""
    return _row_of(method, path) is not None


def least_role(scope: Scope) -> Role | None:
    """The role that a request requires; a viewer may learn that a path does not exist."""
    row = _find(scope)
    return Role.VIEWER if row is None else row.least


async def check_declared(connection: HTTPConnection) -> None:
    """Reserves routes that are missing from the table for admins; a dependency of every route.

    Raises:
        Refusal: 403, the route is missing from the table and the client is not an admin.
    """
    identity: Identity | None = getattr(connection.state, "identity", None)
    if _find(connection.scope) is None and (identity is None or not identity.covers(Role.ADMIN)):
        raise Refusal(
            403,
            "undeclared-route",
            f"no role is declared for {connection.url.path}",
            "this is an internal error, please report it",
        )
