"""Limit of the live streams to one client."""

from collections import Counter
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from typing import Annotated

from fastapi import Depends
from fastapi.requests import HTTPConnection

from grabberd.config import HttpLimits
from grabberd.server.api.guard.authentication import client_of
from grabberd.server.api.guard.refusals import Refusal


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
