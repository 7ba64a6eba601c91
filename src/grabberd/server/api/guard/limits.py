"""Limits of request bodies, of the live streams to one client, and of connections.

Limited are the size and duration of a body, the size of all bodies in memory, the live streams of a client,
the number of connections, the time for a request head and the time for which a client may stop reading. The
server itself has no such limits, so its protocol is extended here by two timers.
"""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any, ClassVar
from weakref import WeakSet

import h11
from fastapi import Depends
from fastapi.requests import HTTPConnection
from starlette.datastructures import Headers
from starlette.types import Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from grabberd.config import HttpLimits
from grabberd.server.api.guard.authentication import client_of
from grabberd.server.api.guard.front import Front
from grabberd.server.api.problems import ProblemResponse, Refusal, problem
from grabberd.server.daemon.descriptors import AT_ONCE

LARGEST_AT_ONCE = 4
"""Number of largest possible request bodies that may be in memory at the same time."""
MOST_PARTS = 500_000
"""Values of a JSON body: empty lists take twenty times the memory of their text."""
SHORT_BYTES = 65_536
CLOSE = {"Connection": "close"}
"""Closes the connection, because the rest of the request is not read."""


def check_framing(scope: Scope) -> None:
    """Checks that a request says in one way where its body ends, as RFC 9112 (6.1, 6.3) allows to require.

    The server itself follows the transfer coding. A proxy that follows the length sees another request after
    it, one that it never checked.

    Raises:
        Refusal: 400, it has a transfer coding beside a length, or in HTTP/1.0, which knows none.
    """
    if is_ambiguous(Headers(scope=scope), scope.get("http_version")):
        raise Refusal(
            400,
            "ambiguous-length",
            "the request has both Content-Length and Transfer-Encoding, or the latter in HTTP/1.0",
            "send one of them alone, the latter in HTTP/1.1",
            CLOSE,
        )


def is_ambiguous(headers: Headers, http_version: str | None) -> bool:
    """True if a request's body can be thought to end at two places."""
    return "transfer-encoding" in headers and ("content-length" in headers or http_version == "1.0")


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

    Short bodies are always accepted: large ones must not prevent starting or annotating a capture.
    """

    def __init__(self, limits: HttpLimits) -> None:
        self.count = 0
        self._most = LARGEST_AT_ONCE * limits.body_bytes

    def add(self, size: int, of_one: int) -> None:
        """Counts received bytes.

        Args:
            size: Number of bytes.
            of_one: Total of this body so far, these included.

        Raises:
            Refusal: 503, the body is large and too many are being received.
        """
        self.count += size
        if self.count > self._most and of_one > SHORT_BYTES:
            raise Refusal(
                503,
                "too-many-bodies",
                f"request bodies of {self.count} bytes are being received already",
                "try again in a moment; bodies up to 64 KiB are still received",
                {**CLOSE, "Retry-After": "5"},
            )

    def remove(self, size: int) -> None:
        """Stops counting bytes that are no longer in memory."""
        self.count -= size


class LimitedBody:
    """A `receive` that limits the size and the duration of the request body."""

    def __init__(self, receive: Receive, limits: HttpLimits, bodies: Bodies) -> None:
        self._receive = receive
        self._limits = limits
        self._bodies = bodies
        self._bytes = 0
        self._parts = 0
        self._until: float | None = None
        self._complete = False

    async def __call__(self) -> Message:
        """Receives the next message.

        Raises:
            Refusal: 413, the body is too long or has too many values; 408, it takes too long; 503, there are
                too many.
        """
        if self._complete:
            return await self._receive()
        message = await self._in_time()
        size = len(message.get("body", b""))
        self._bytes += size
        self._bodies.add(size, self._bytes)
        self._complete = not message.get("more_body", False)
        self._parts += sum(message.get("body", b"").count(sign) for sign in (b"[", b"{", b","))
        if self._bytes > self._limits.body_bytes:
            raise _too_large(self._limits)
        if self._parts > MOST_PARTS:
            raise Refusal(
                413,
                "content-too-large",
                f"the request body has more than {MOST_PARTS} values",
                "send less at once",
                CLOSE,
            )
        return message

    def close(self) -> None:
        """Stops counting the body."""
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


class Streams:
    """Counts the live streams to each client; it has entries only for clients with streams."""

    def __init__(self, limits: HttpLimits) -> None:
        self._most = limits.streams_per_client
        self._open: Counter[str] = Counter()

    @contextmanager
    def one(self, client: str) -> Iterator[None]:
        """Counts a stream to a client for the duration of the block.

        Raises:
            Refusal: 429, the client has too many streams.
        """
        if self._open[client] >= self._most:
            raise Refusal(
                429,
                "too-many-streams",
                f"{client} has {self._most} live streams already",
                "close a page that shows live data, or raise http.limits.streams_per_client",
                {"Retry-After": "5"},
            )
        self._open[client] += 1
        try:
            yield
        finally:
            self._open[client] -= 1
            self._open += Counter()  # drops zero counts

    @property
    def count(self) -> int:
        """Number of live streams to all clients."""
        return self._open.total()


async def _hold(connection: HTTPConnection) -> AsyncIterator[None]:
    streams: Streams = connection.app.state.streams
    with streams.one(client_of(connection.scope)):
        yield


OneStream = Annotated[None, Depends(_hold)]
"""Parameter of every streaming route: counts the stream until its response or WebSocket has ended."""


IDLE_S = 1.0
"""Time after which a connection without a request counts as idle; a new one needs time to send its first."""


async def too_busy(scope: Scope, receive: Receive, send: Send) -> None:
    """The application for connections beyond the limit."""
    answer = _turned_away(503, "the daemon has reached its limit of connections", "try again in a moment")
    await answer(scope, receive, send)


async def too_many_of_one(scope: Scope, receive: Receive, send: Send) -> None:
    """The application for connections beyond the limit per client."""
    hint = "close some, or raise http.limits.connections_per_client; name a proxy in http.proxies"
    await _turned_away(429, f"{client_of(scope)} has too many connections", hint)(scope, receive, send)


def _turned_away(status: int, detail: str, hint: str) -> ProblemResponse:
    answer = problem(status, "too-many-connections", detail, hint)
    answer.headers.update({"Retry-After": "5", "Connection": "close"})
    return answer


class LimitedConnection(H11Protocol):
    """A limited connection: beyond the limit, a new one replaces the one that has been idle for longest.

    If none is idle, connections beyond the limit get 503, and those beyond twice the limit are dropped. The
    same holds for each client with 429, except for proxies, which stand for many clients. Connections in
    their TLS handshake are dropped a little beyond twice the limit: each holds a file descriptor.
    """

    front: ClassVar[Front]
    limits: ClassVar[HttpLimits]
    clients: ClassVar[Counter[str]]
    handshaking: ClassVar["WeakSet[LimitedConnection]"]

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        if len(self.connections) + len(self.handshaking) >= 2 * self.limits.connections + 4 * AT_ONCE:
            # There is no transport yet to close; the socket is closed with the last reference to it.
            raise ConnectionRefusedError("far too many connections in their TLS handshake")
        self.handshaking.add(self)
        self._head_timer: asyncio.TimerHandle | None = None
        self._write_timer: asyncio.TimerHandle | None = None
        self._counted: str | None = None
        self._idle_since_s = 0.0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Handles a new connection."""
        self.handshaking.discard(self)
        self._idle_since_s = self.loop.time()
        super().connection_made(transport)
        self._start_head_timer()
        of_client = self._count()
        if of_client > self.limits.connections_per_client:
            self.app = too_many_of_one
        if len(self.connections) > self.limits.connections and not self._take_idle_place():
            self.app = too_busy
        if (
            len(self.connections) > 2 * self.limits.connections
            or of_client > 2 * self.limits.connections_per_client
        ):
            transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """Handles the end of the connection."""
        self._stop_timers()
        self._uncount()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Handles incoming data; after the response, the rest of the request has as much time as a head."""
        super().data_received(data)
        answered = getattr(self.cycle, "response_complete", False)
        if answered or self.conn.their_state is h11.IDLE:
            self._start_head_timer()
        else:
            self._stop_head_timer()

    def on_response_complete(self) -> None:
        """Handles the end of a response, which may precede the end of its request."""
        self._idle_since_s = self.loop.time()
        super().on_response_complete()
        if self.conn.their_state is h11.SEND_BODY:
            self._start_head_timer()

    def pause_writing(self) -> None:
        """Starts the timer for a client that has stopped reading."""
        super().pause_writing()
        self._write_timer = self._after(self.limits.write_timeout_s, self.transport.abort)

    def resume_writing(self) -> None:
        """Stops the timer, as the client has read on."""
        self._stop_write_timer()
        super().resume_writing()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Hands the connection to the WebSocket protocol, which has its own timers and its own limit."""
        self._stop_timers()
        self._uncount()
        super().handle_websocket_upgrade(event)

    def _should_upgrade(self) -> bool:
        if self.app in (too_busy, too_many_of_one) or is_ambiguous(Headers(raw=self.headers), None):
            return False  # answered by these, or refused by the gate
        return super()._should_upgrade()

    @property
    def _is_idle(self) -> bool:
        """True while no request is being answered."""
        return bool(getattr(self.cycle, "response_complete", True))

    def _take_idle_place(self) -> bool:
        """Drops the connection that has been idle for longest; False if no other one is idle."""
        idle = [one for one in self.connections if isinstance(one, LimitedConnection) and one._is_idle]
        long_s = self.loop.time() - IDLE_S
        open_ones = [one for one in idle if one is not self and not one.transport.is_closing()]
        others = [one for one in open_ones if one._idle_since_s <= long_s]
        if not others:
            return False
        min(others, key=lambda one: one._idle_since_s).transport.abort()
        return True

    def _count(self) -> int:
        """Counts the connection; returns the number of its client's connections."""
        if self.front.proxies.include(self.client[0] if self.client else None):
            return 0
        self._counted = client_of({"client": self.client})
        self.clients[self._counted] += 1
        return self.clients[self._counted]

    def _uncount(self) -> None:
        if self._counted is not None:
            self.clients[self._counted] -= 1
            if not self.clients[self._counted]:
                del self.clients[self._counted]
            self._counted = None

    def _after(self, seconds: float, act: Callable[[], None]) -> asyncio.TimerHandle:
        return self.loop.call_later(seconds, act)

    def _start_head_timer(self) -> None:
        if self._head_timer is None and not self.transport.is_closing():
            self._head_timer = self._after(self.limits.head_timeout_s, self.transport.close)

    def _stop_timers(self) -> None:
        self._stop_head_timer()
        self._stop_write_timer()

    def _stop_head_timer(self) -> None:
        if self._head_timer is not None:
            self._head_timer.cancel()
            self._head_timer = None

    def _stop_write_timer(self) -> None:
        if self._write_timer is not None:
            self._write_timer.cancel()
            self._write_timer = None


def connection_class(front: Front) -> type[LimitedConnection]:
    """The connection class of a server with this front."""
    own = {"front": front, "limits": front.limits, "clients": Counter(), "handshaking": WeakSet()}
    return type("Connection", (LimitedConnection,), own)
