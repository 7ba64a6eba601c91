"""The middleware that admits or refuses every request; plain ASGI, so that streams are not buffered.

A foreign page can make a browser in the barn send any request to the daemon, and can point a name of its own
at the daemon's address (DNS rebinding). Therefore host name and origin are checked for every request, with or
without tokens. The port is not checked: a tunnel changes it, and a page cannot choose the host in front of
it.
"""

import asyncio
import ipaddress
import re
import time
from collections.abc import Awaitable, Callable

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from grabberd.api.guard.authentication import Authenticator, check_role
from grabberd.api.guard.front import LOOPBACK_NAMES, Front
from grabberd.api.guard.refusals import Refusal
from grabberd.api.guard.roles import least_role
from grabberd.config import HttpLimits
from grabberd.documents.roles import Role
from grabberd.service.access import Identity

_HOST = re.compile(r"(?P<name>\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+)(:[0-9]{1,5})?")
UNSAFE = frozenset({"POST", "PUT", "PATCH", "DELETE"})
FOREIGN_SITES = frozenset({"cross-site", "same-site"})
RECHECK_S = 10.0
"""Longest time that a stream outlives the token it was opened with."""
POLICY_VIOLATION = 1008
LARGEST_AT_ONCE = 4
"""Request bodies of the largest size that may be in memory at the same time."""
SHORT_BYTES = 65_536
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "SAMEORIGIN",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "same-origin",
}
"""Headers that keep pages of other sites from showing or embedding the daemon's responses."""
CLOSE = {"Connection": "close"}
"""Closes the connection, because the rest of the request is not read."""


def check_host(scope: Scope, front: Front) -> None:
    """Checks that a request uses one of the daemon's names, or the address on which it came in.

    The names of loopback are valid on its addresses and on Unix sockets: nobody calls the daemon by them from
    another computer, unless to get past a rule of somebody's proxy.

    Raises:
        Refusal: 421, it uses another name.
    """
    given = Headers(scope=scope).getlist("host")
    match = _HOST.fullmatch(given[0]) if len(given) == 1 else None
    name = match["name"].strip("[]").rstrip(".").lower() if match else ""
    if not (name in front.hosts or _is_own_address(name, scope) or _is_loopback(name, scope)):
        raise Refusal(
            421,
            "foreign-host",
            f"this daemon does not have the name {', '.join(given)[:100]!r}",
            "use its address, or add the name to http.hosts in its configuration",
        )


def _is_loopback(name: str, scope: Scope) -> bool:
    """True if the name is one of loopback's, and the connection came in there or on a Unix socket."""
    server = scope.get("server")
    if name not in LOOPBACK_NAMES:
        return False
    try:
        return not server or _address(str(server[0])).is_loopback
    except ValueError:  # the path of a Unix socket
        return True


def _is_own_address(name: str, scope: Scope) -> bool:
    """True if the name is the address the connection came in on; an address cannot be rebound."""
    server = scope.get("server")
    if not name or not server:
        return False
    try:
        return _address(name) == _address(str(server[0]))
    except ValueError:
        return False


def _address(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    address = ipaddress.ip_address(text.partition("%")[0])
    return getattr(address, "ipv4_mapped", None) or address


def check_page(scope: Scope, front: Front) -> None:
    """Checks that a request comes from one of the daemon's own pages, or from no page.

    Raises:
        Refusal: 403, it comes from a foreign page.
    """
    headers = Headers(scope=scope)
    origin = headers.get("origin")
    if origin is not None and not _is_own_page(origin, headers, front):
        raise _foreign(f"the page {origin[:100]!r}")
    if headers.get("sec-fetch-site") in FOREIGN_SITES and not _follows_a_link(scope, headers):
        raise _foreign("a page of another site")


def check_page_is_named(scope: Scope) -> None:
    """Checks that a request with a session cookie that changes something names its origin.

    Raises:
        Refusal: 403, it does not, so a foreign page may have sent it.
    """
    changes = scope["type"] == "websocket" or scope["method"] in UNSAFE
    if changes and "origin" not in Headers(scope=scope):
        raise _foreign("a page that does not name its origin")


def _is_own_page(origin: str, headers: Headers, front: Front) -> bool:
    # A proxy may terminate TLS in front of plain HTTP; a daemon with TLS serves no plain pages.
    schemes = ("https",) if front.tls else ("https", "http")
    return origin.lower() in {f"{scheme}://{headers['host'].lower()}" for scheme in schemes}


def _follows_a_link(scope: Scope, headers: Headers) -> bool:
    return scope.get("method") in ("GET", "HEAD") and headers.get("sec-fetch-mode") == "navigate"


def _foreign(who: str) -> Refusal:
    return Refusal(
        403,
        "foreign-page",
        f"{who} may not use this daemon",
        "open the daemon's own page; scripts must not send Origin",
    )


def check_length(scope: Scope, limits: HttpLimits) -> None:
    """Checks the length of the body that a request declares.

    Raises:
        Refusal: 413, the body is too long.
    """
    declared = Headers(scope=scope).get("content-length", "0")
    if declared.isdigit() and int(declared) > limits.body_bytes:
        raise _too_large(limits)


class Bodies:
    """Bytes of all request bodies that are in memory.

    Short bodies have room always: large ones must not keep anybody from starting or annotating a capture.
    """

    def __init__(self, limits: HttpLimits) -> None:
        self.count = 0
        self._most = LARGEST_AT_ONCE * limits.body_bytes

    def add(self, size: int, of_one: int) -> None:
        """Counts further bytes of a body.

        Args:
            size: Number of bytes.
            of_one: Number of bytes of this body, these included.

        Raises:
            Refusal: 503, it is a large one, and too many are being received.
        """
        self.count += size
        if self.count > self._most and of_one > SHORT_BYTES:
            raise Refusal(
                503,
                "too-many-bodies",
                f"request bodies of {self.count} bytes are being received already",
                "try again in a moment; bodies up to 64 KiB are received all the same",
                {**CLOSE, "Retry-After": "5"},
            )

    def remove(self, size: int) -> None:
        """Counts no more what has been worked off."""
        self.count -= size


class LimitedBody:
    """A `receive` that limits the size and the duration of the request body."""

    def __init__(self, receive: Receive, limits: HttpLimits, bodies: Bodies | None = None) -> None:
        self._receive = receive
        self._limits = limits
        self._bodies = bodies or Bodies(limits)
        self._bytes = 0
        self._until: float | None = None
        self._complete = False

    async def __call__(self) -> Message:
        """Receives the next message.

        Raises:
            Refusal: 413, the body is too long; 408, it takes too long; 503, there are too many.
        """
        if self._complete:
            return await self._receive()
        message = await self._in_time()
        size = len(message.get("body", b""))
        self._bytes += size
        self._bodies.add(size, self._bytes)
        self._complete = not message.get("more_body", False)
        if self._bytes > self._limits.body_bytes:
            raise _too_large(self._limits)
        return message

    def close(self) -> None:
        """Counts the body no more."""
        self._bodies.remove(self._bytes)
        self._bytes = 0

    async def _in_time(self) -> Message:
        if self._until is None:
            self._until = asyncio.get_running_loop().time() + self._limits.body_timeout_s
        try:
            async with asyncio.timeout_at(self._until):
                return await self._receive()
        except TimeoutError:
            raise Refusal(
                408,
                "request-timeout",
                f"the request body took longer than {self._limits.body_timeout_s:g} s",
                "send it faster, or raise http.limits.body_timeout_s",
                CLOSE,
            ) from None


def _too_large(limits: HttpLimits) -> Refusal:
    return Refusal(
        413,
        "content-too-large",
        f"the request body has more than {limits.body_bytes} bytes",
        "send less, or raise http.limits.body_bytes",
        CLOSE,
    )


class Gate:
    """Checks host name, origin, token, role and length, in this order; a refused request reaches no route."""

    def __init__(
        self,
        app: ASGIApp,
        front: Front,
        authenticator: Authenticator,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._app = app
        self._front = front
        self._bodies = Bodies(front.limits)
        self._authenticator = authenticator
        self._now_s = now_s

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serves one request or one WebSocket."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        scope = self._front.proxies.seen_through(scope)
        answer = _Answer(send)
        try:
            await self._serve(scope, receive, answer)
        except Refusal as refusal:
            await answer.refuse(refusal, scope, receive)
        except _AccessEnded:
            await answer.end(scope)

    async def _serve(self, scope: Scope, receive: Receive, answer: "_Answer") -> None:
        least = await self._admit(scope)
        if least is not None:
            answer.watch(_Watch(lambda: self._authenticator.still_is(scope, least), self._now_s))
        # After the identity: a stranger does not learn how long a body may be.
        if scope["type"] == "websocket":
            await self._app(scope, receive, answer)
            return
        check_length(scope, self._front.limits)
        body = LimitedBody(receive, self._front.limits, self._bodies)
        try:
            await self._app(scope, body, answer)
        finally:
            body.close()

    async def _admit(self, scope: Scope) -> Role | None:
        """Admits a request and stores who sent it; returns the role that it requires."""
        check_host(scope, self._front)
        check_page(scope, self._front)
        least = least_role(scope)
        if least is not None:
            identity = await self._identify(scope)
            check_role(identity, least)
            scope.setdefault("state", {})["identity"] = identity
        return least

    async def _identify(self, scope: Scope) -> Identity:
        identity = await self._authenticator.identify(scope)
        if identity.by == "session":
            check_page_is_named(scope)
        return identity


class _AccessEnded(Exception):
    """A token was removed while a response was still being streamed to its holder."""


class _Answer:
    """A `send` that adds the headers, and rechecks the access during a long response."""

    def __init__(self, send: Send) -> None:
        self._send = send
        self._begun = False
        self._watch: _Watch | None = None

    def watch(self, watch: "_Watch") -> None:
        """Ends the response when the access ends."""
        self._watch = watch

    async def __call__(self, message: Message) -> None:
        """Sends the next message."""
        self._begun = True
        if message["type"] in ("http.response.start", "websocket.http.response.start"):
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)
        elif self._watch is not None:
            await self._watch.check()
        await self._send(message)

    async def refuse(self, refusal: Refusal, scope: Scope, receive: Receive) -> None:
        """Responds with the refusal; a response that has begun is cut off by the server instead."""
        if self._begun:
            return
        if scope["type"] == "websocket" and "websocket.http.response" not in scope.get("extensions", {}):
            await self._send({"type": "websocket.close", "code": POLICY_VIOLATION})
            return
        await refusal.response()(scope, receive, self)

    async def end(self, scope: Scope) -> None:
        """Closes a WebSocket; other responses are cut off by the server."""
        if scope["type"] == "websocket":
            await self._send({"type": "websocket.close", "code": POLICY_VIOLATION})


class _Watch:
    """Rechecks an access from time to time."""

    def __init__(self, still: Callable[[], Awaitable[bool]], now_s: Callable[[], float]) -> None:
        self._still = still
        self._now_s = now_s
        self._next_s = now_s() + RECHECK_S

    async def check(self) -> None:
        """Rechecks the access if it is due.

        Raises:
            _AccessEnded: the access has ended.
        """
        if self._now_s() < self._next_s:
            return
        self._next_s = self._now_s() + RECHECK_S
        if not await self._still():
            raise _AccessEnded


class _HeadSent(Exception):
    """The head has been sent, and the body is not wanted."""


class HeadAsGet:
    """Answers HEAD as GET without the body; a stream ends before its first byte."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serves one request; anything but HEAD passes unchanged."""
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self._app(scope, receive, send)
            return

        async def send_head(message: Message) -> None:
            if message["type"] != "http.response.body":
                await send(message)
                return
            await send({"type": "http.response.body", "body": b"", "more_body": False})
            raise _HeadSent

        try:
            await self._app({**scope, "method": "GET"}, receive, send_head)
        except _HeadSent:
            return
