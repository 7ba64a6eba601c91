"""Authentication by bearer token, by browser session, or, while there are no tokens, by a private socket.

Failed attempts are throttled for each client address, and logged from time to time.
"""

import ipaddress
import logging
import math
import time
from collections import OrderedDict
from collections.abc import Callable
from contextlib import suppress
from typing import Annotated, NamedTuple, TypeVar

from fastapi import Depends
from fastapi.requests import HTTPConnection
from starlette.concurrency import run_in_threadpool
from starlette.types import Scope

from grabberd.archive.access import AT_THE_MACHINE, Access, Identity, NotRemembered, hash_of
from grabberd.documents.enums import Role
from grabberd.errors import AccessExpired, StorageError
from grabberd.server.api.problems import Refusal
from grabberd.server.api.sockets import ip_address

log = logging.getLogger(__name__)

K = TypeVar("K")
V = TypeVar("V")

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

    Previously valid tokens bypass throttling, so guessing from a shared address locks nobody out.
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

    def succeeded(self, client: str, secret: str) -> None:
        """Notes that a secret was valid."""
        self._records.pop(client, None)
        _touch(self._proven, hash_of(secret), None, PROVEN)

    def failed(self, client: str) -> None:
        """Notes that a secret was invalid."""
        now_s = self._now_s()
        before = self._records.get(client, _Record(0, now_s))
        failures = 1 if now_s - before.until_s > FORGOTTEN_AFTER_S else before.failures + 1
        _touch(self._records, client, _Record(failures, now_s + _wait_s(failures)), ADDRESSES)
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


def _touch(entries: OrderedDict[K, V], key: K, value: V, most: int) -> None:
    """Enters a key as the newest, and drops the oldest if there are too many."""
    entries[key] = value
    entries.move_to_end(key)
    if len(entries) > most:
        entries.popitem(last=False)


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
            self._attempts.succeeded(client, shown.secret)
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
