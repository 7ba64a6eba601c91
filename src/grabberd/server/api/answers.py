"""Memory that answers to requests may take together, so that no captures suffer from whoever asks for much.

Every heavy read holds its part from before it begins until its answer has been sent. If there is no room, it
waits for a moment, and is then refused. Whole answers are sent in parts, at the pace of the client.
"""

import asyncio
import weakref
from collections.abc import Callable
from functools import partial

from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from grabberd.server.api.problems import Refusal

MOST_BYTES = 64 << 20
"""Memory for all answers: two thirds of what a daemon may take beyond what it takes while nobody asks."""
OF_A_READ = 3 << 19
"""Memory that a read counts for until its answer is known; 40 of them may run and wait."""
WAIT_S = 5.0
"""Longest wait for room."""
_PART = 1 << 16
"""Bytes sent at once; shorter answers are not counted any longer once they are made."""


class Hold:
    """A part of the memory, held until it is released."""

    def __init__(self, memory: "AnswerMemory", size: int) -> None:
        self._memory = memory
        self._size = size

    def grow_to(self, size: int) -> None:
        """Holds more, if the answer has become larger than expected.

        Raises:
            Refusal: 503, there is no room.
        """
        more = size - self._size
        if more > 0:
            self._memory.take_now(more)
            self._size = size

    def release(self) -> None:
        """Gives it back; may be called twice."""
        size, self._size = self._size, 0
        if size:
            self._memory.give(size)


class AnswerMemory:
    """The memory of all answers.

    Args:
        most: Its size in bytes.
        wait_s: See `WAIT_S`.
    """

    def __init__(self, most: int = MOST_BYTES, wait_s: float = WAIT_S) -> None:
        self.count = 0
        self._most = most
        self._wait_s = wait_s
        self._waiting: dict[asyncio.Future[None], int] = {}

    async def hold(self, size: int) -> Hold:
        """Holds a part, as soon as there is room.

        Raises:
            Refusal: 503, there was none in time.
        """
        size = min(size, self._most)
        room: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._waiting[room] = size
        self._admit()
        try:
            async with asyncio.timeout(self._wait_s):
                await room
        except BaseException as error:
            if self._waiting.pop(room, None) is None:  # admitted just now
                self.give(size)
            if isinstance(error, TimeoutError):
                raise self._refusal() from None
            raise
        return Hold(self, size)

    def take_now(self, size: int) -> None:
        """Takes memory without waiting.

        Raises:
            Refusal: 503, there is no room.
        """
        if self.count + size > self._most:
            raise self._refusal()
        self.count += size

    def give(self, size: int) -> None:
        """Gives memory back, to those that wait for it."""
        self.count -= size
        self._admit()

    def _admit(self) -> None:
        for room, size in list(self._waiting.items()):
            # One that has just given up waiting removes itself.
            if not room.done() and self.count + size <= self._most:
                del self._waiting[room]
                room.set_result(None)
                self.count += size

    def _refusal(self) -> Refusal:
        return Refusal(
            503,
            "too-many-answers",
            f"answers of {self.count >> 20} MB are being made or sent already",
            "try again in a moment, or ask for less at once; running captures are not affected",
            {"Retry-After": "5"},
        )


class HeldAnswer(Response):
    """A whole answer that is sent in parts, so that its memory is known until the client has it."""

    def __init__(self, answer: Response, hold: Hold) -> None:
        self.body, self.status_code, self.background = answer.body, answer.status_code, answer.background
        self.raw_headers = answer.raw_headers
        self._hold = hold

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Sends the answer."""
        start = {"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers}
        try:
            await send(start)
            for first in range(0, len(self.body), _PART):
                part = bytes(self.body[first : first + _PART])
                more = first + _PART < len(self.body)
                await send({"type": "http.response.body", "body": part, "more_body": more})
        finally:
            self._hold.release()


def held(answer: Response, hold: Hold) -> Response:
    """The same answer, which holds its memory until it has been sent.

    Raises:
        Refusal: 503, it is larger than there is room for.
    """
    if len(answer.body) <= _PART:
        hold.release()
        return answer
    hold.grow_to(len(answer.body))
    return released_with(HeldAnswer(answer, hold), hold.release)


def released_with(answer: Response, release: Callable[[], None]) -> Response:
    """The same answer; its memory is given back at the latest when it is dropped."""
    weakref.finalize(answer, partial(release)).atexit = False
    return answer
