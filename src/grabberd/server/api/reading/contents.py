"""Contents of captures over HTTP: read by a process of their own, which is started when it is needed.

The daemon's interpreter does no more than hand them on, so that a capture, health and state do not wait for
them. A process that does not answer in time is killed, and what it was reading is given up.
"""

import asyncio
import pickle
import time
from collections.abc import AsyncIterator, Callable
from typing import Any, NamedTuple

from starlette.responses import Response
from starlette.types import Receive

from grabberd.archive.content_process import PROGRAM
from grabberd.config import HttpLimits
from grabberd.files.patience import given_up
from grabberd.server.api.guard.refusals import Refusal
from grabberd.server.api.reading.content_reader import KILLED_S, ContentReader
from grabberd.server.api.reading.room import RETRY_S, check_room, client_left
from grabberd.server.api.streams.downloads import download
from grabberd.server.daemon.descriptors import exhaustion
from grabberd.work.content_frames import UNTIL, Answer, Frame, Question

IDLE_S = 120.0
"""Time after the last reading until the process ends: an idle daemon does without its memory."""
LOOK_EVERY_S = 0.5
"""Interval at which a process that only a slow client still needs is looked at again."""
CLOSED_S = 1.0
"""Time to end the process when the daemon ends, which has nine seconds for everything."""


class Content(NamedTuple):
    """A content that a route answers with.

    Attributes:
        read: One of `grabberd.archive.content_process.CONTENTS`.
        arguments: Its arguments.
        response: Makes the response of what comes whole.
        media_type: Type of what comes in pieces.
        name: Name under which a client saves that.
    """

    read: Callable[..., Any]
    arguments: tuple[Any, ...]
    response: Callable[[bytes], Response] = Response
    media_type: str = ""
    name: str = ""


class Contents:
    """The process that reads contents; one at a time, and none while nobody has asked for long.

    Args:
        limits: Number of readings at a time, and the time for each, waiting included.
        program: Code of the process.
        idle_s: See `IDLE_S`.
    """

    def __init__(self, limits: HttpLimits, program: str = PROGRAM, idle_s: float = IDLE_S) -> None:
        self._limits = limits
        self._program = program
        self._idle_s = idle_s
        self._reader: ContentReader | None = None
        self._starting = asyncio.Lock()
        self._used_s = 0.0
        self._timer: asyncio.TimerHandle | None = None
        self._ending: set[asyncio.Task[None]] = set()
        self._closed = False

    @property
    def count(self) -> int:
        """Number of readings that run or wait for a thread."""
        return self._reader.count if self._reader else 0

    async def answer(self, content: Content, receive: Receive) -> Response:
        """The response with a content; reading it is given up when the client leaves.

        Args:
            content: What is read.
            receive: The request's `receive`, after its body has been read.

        Raises:
            Refusal: 503, too many readings wait already.
            ReadingGivenUp: It takes too long, or ends the process.
            GrabberdError: As the reading does.
        """
        reader = await self._ready()
        check_room(reader.count, self._limits)  # nothing else runs between this and `ask`
        until_s = self._until_s()
        asked = pickle.dumps((content.read.__name__, content.arguments, until_s))
        question = Frame(reader.new_number(), Question.READ, asked)
        answer = await _unless_left(reader, question, until_s, receive)
        self._used_s = time.monotonic()
        if answer.kind == Answer.WHOLE:
            return content.response(answer.content)
        opened = _Opened(reader, answer.number)
        response = download(opened, content.media_type, content.name)
        response.pieces = self._pieces
        return response

    async def close(self) -> None:
        """Ends the process, and what it reads; none is started afterwards."""
        self._closed = True
        if self._timer is not None:
            self._timer.cancel()
        if self._reader is not None:
            self._end(self._reader)
        if self._ending:
            await asyncio.wait(self._ending, timeout=CLOSED_S + KILLED_S)

    async def _ready(self) -> ContentReader:
        async with self._starting:
            if self._reader is not None and not self._reader.is_alive:
                self._end(self._reader)
            if self._reader is None:
                self._reader = await self._start()
                self._look_in(self._idle_s)
            self._used_s = time.monotonic()
            return self._reader

    async def _start(self) -> ContentReader:
        if self._closed:
            raise given_up("what was asked for")
        try:
            return await ContentReader.start(self._program, self._limits.reads)
        except OSError as error:
            if exhaustion.explains(error):
                raise
            raise Refusal(
                503,
                "too-many-processes",
                f"the process that reads captures cannot be started: {error}",
                "try again in a moment; if it happens again, raise TasksMax= or MemoryMax= of the unit",
                {"Retry-After": str(RETRY_S)},
            ) from error

    def _end(self, reader: ContentReader) -> None:
        """Ends a process in the background; the next reading starts another."""
        self._reader = None
        ending = asyncio.create_task(reader.close(CLOSED_S))
        self._ending.add(ending)
        ending.add_done_callback(self._ending.discard)

    def _look_in(self, seconds: float) -> None:
        self._timer = asyncio.get_running_loop().call_later(seconds, self._end_if_idle)

    def _end_if_idle(self) -> None:
        if self._reader is None:
            return
        left_s = self._used_s + self._idle_s - time.monotonic()
        if left_s <= 0 and self._reader.is_idle:
            self._end(self._reader)
        else:
            self._look_in(max(left_s, LOOK_EVERY_S))

    async def _pieces(self, opened: "_Opened") -> AsyncIterator[bytes]:
        while True:
            until_s = self._until_s()
            question = Frame(opened.number, Question.NEXT, UNTIL.pack(until_s))
            answer = await opened.reader.ask(question, until_s)
            self._used_s = time.monotonic()
            if answer.kind == Answer.END:
                return
            yield answer.content

    def _until_s(self) -> float:
        return time.monotonic() + self._limits.read_timeout_s


class _Opened(NamedTuple):
    """A content that comes in pieces."""

    reader: ContentReader
    number: int

    def close(self) -> None:
        """Ends reading it; does nothing after its last piece."""
        self.reader.give_up(self.number)


async def _unless_left(reader: ContentReader, question: Frame, until_s: float, receive: Receive) -> Frame:
    """The answer to a question, which is given up when the client leaves."""
    asked = asyncio.create_task(reader.ask(question, until_s))
    left = asyncio.create_task(client_left(receive))
    try:
        await asyncio.wait((asked, left), return_when=asyncio.FIRST_COMPLETED)
        if not asked.done():
            raise given_up("what was asked for")
        return asked.result()
    finally:
        asked.cancel()
        left.cancel()
