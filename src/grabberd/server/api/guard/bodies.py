"""Request bodies: their size, the time that they take, and how much of them is in memory at once."""

import asyncio

from starlette.datastructures import Headers
from starlette.types import Message, Receive, Scope

from grabberd.config import HttpLimits
from grabberd.server.api.guard.refusals import Refusal

LARGEST_AT_ONCE = 4
"""Request bodies of the largest size that may be in memory at the same time."""
SHORT_BYTES = 65_536
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
