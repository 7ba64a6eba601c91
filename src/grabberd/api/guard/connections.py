"""Connections: how many there are, how long a head may take, and how long a client may read nothing.

The server itself bounds none of these by time, so its protocol is extended here by two timers.
"""

import asyncio
from collections.abc import Callable
from typing import Any, ClassVar

import h11
from starlette.types import Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from grabberd.api.problems import problem
from grabberd.config import HttpLimits


async def too_busy(scope: Scope, receive: Receive, send: Send) -> None:
    """The application of a connection that is one too many."""
    answer = problem(
        503, "too-many-connections", "the daemon has as many connections as it may", "try again in a moment"
    )
    answer.headers.update({"Retry-After": "5", "Connection": "close"})
    await answer(scope, receive, send)


class LimitedConnection(H11Protocol):
    """A connection within limits: one too many is told so, twice too many is hung up on."""

    limits: ClassVar[HttpLimits]

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._head_timer: asyncio.TimerHandle | None = None
        self._write_timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """A client has connected."""
        super().connection_made(transport)
        self._start_head_timer()
        if len(self.connections) > self.limits.connections:
            self.app = too_busy
        if len(self.connections) > 2 * self.limits.connections:
            transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """The client has gone."""
        self._stop_timers()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Some of a request has come; what has been answered already is not waited for any longer."""
        super().data_received(data)
        answered = getattr(self.cycle, "response_complete", False)
        if answered or self.conn.their_state is h11.IDLE:
            self._start_head_timer()
        else:
            self._stop_head_timer()

    def on_response_complete(self) -> None:
        """A request has been answered, whether all of it had come or not."""
        super().on_response_complete()
        if self.conn.their_state is h11.SEND_BODY:
            self._start_head_timer()

    def pause_writing(self) -> None:
        """The client reads more slowly than is written to it."""
        super().pause_writing()
        self._write_timer = self._after(self.limits.write_timeout_s, self.transport.abort)

    def resume_writing(self) -> None:
        """It has read on."""
        self._stop_write_timer()
        super().resume_writing()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """The connection becomes a WebSocket's, with timers of its own."""
        self._stop_timers()
        super().handle_websocket_upgrade(event)

    def _should_upgrade(self) -> bool:
        return self.app is not too_busy and super()._should_upgrade()

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


def connection_class(limits: HttpLimits) -> type[LimitedConnection]:
    """The class of a server's connections."""
    return type("Connection", (LimitedConnection,), {"limits": limits})
