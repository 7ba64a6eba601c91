"""Limits for one client: size and duration of a request body, and the number of live streams."""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from typing import Annotated

from fastapi import Depends
from fastapi.requests import HTTPConnection
from starlette.datastructures import Headers
from starlette.types import Message, Receive, Scope

from grabberd.api.guard.authentication import client_of
from grabberd.api.guard.refusals import Refusal
from grabberd.config import HttpLimits

CLOSE = {"Connection": "close"}
"""Closes the connection, because the rest of the request is not read."""


def check_length(scope: Scope, limits: HttpLimits) -> None:
    """Checks the length of the body that a request declares.

    Raises:
        Refusal: 413, the body is too long.
    """
    declared = Headers(scope=scope).get("content-length", "0")
    if declared.isdigit() and int(declared) > limits.body_bytes:
        raise _too_large(limits)


class LimitedBody:
    """A `receive` that limits the size and the duration of the request body."""

    def __init__(self, receive: Receive, limits: HttpLimits) -> None:
        self._receive = receive
        self._limits = limits
        self._bytes = 0
        self._until: float | None = None
        self._complete = False

    async def __call__(self) -> Message:
        """Receives the next message.

        Raises:
            Refusal: 413, the body is too long; 408, it takes too long.
        """
        if self._complete:
            return await self._receive()
        message = await self._in_time()
        self._bytes += len(message.get("body", b""))
        self._complete = not message.get("more_body", False)
        if self._bytes > self._limits.body_bytes:
            raise _too_large(self._limits)
        return message

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
"""Parameter of every streaming route: counts a stream until its response or its WebSocket has ended."""


def _too_large(limits: HttpLimits) -> Refusal:
    return Refusal(
        413,
        "content-too-large",
        f"the request body has more than {limits.body_bytes} bytes",
        "send less, or raise http.limits.body_bytes",
        CLOSE,
    )
