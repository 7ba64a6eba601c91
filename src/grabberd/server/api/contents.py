"""Contents of captures over HTTP, read in a separate process that is started on demand.

The daemon only passes the bytes on, so captures, health and state never wait for a read. If the process does
not answer in time, it is killed and its reads are abandoned. The limit of waiting reads also applies to reads
in threads (`readings`).
"""

import asyncio
import itertools
import pickle
import subprocess
import time
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

from starlette.responses import Response
from starlette.types import Receive

from grabberd.archive.capture_contents import LIMITS, read
from grabberd.config import HttpLimits
from grabberd.errors import ReadingGivenUp
from grabberd.files.reading import given_up
from grabberd.server.api.answers import AnswerMemory, held, released_with
from grabberd.server.api.problems import Refusal
from grabberd.server.api.streams.downloads import Download, download
from grabberd.server.daemon.descriptors import exhaustion
from grabberd.work.child import Limits
from grabberd.work.frames import HEAD, NUMBER, Answer, Call, Frame, Question, unpacked_error
from grabberd.work.process import start

WAITING_A_THREAD = 9
"""Reads that may wait per thread: a page makes several requests at once."""
RETRY_S = 2


def check_room(count: int, limits: HttpLimits) -> None:
    """Refuses a read if too many are waiting already.

    Args:
        count: Number of reads that are running or waiting.
        limits: Limits with the number of threads.

    Raises:
        Refusal: 503.
    """
    if count >= limits.reads * (1 + WAITING_A_THREAD):
        raise Refusal(
            503,
            "too-many-reads",
            f"{count} requests that read captures run or wait already",
            "try again in a moment; the state and running captures are not affected",
            {"Retry-After": str(RETRY_S)},
        )


async def client_left(receive: Receive) -> None:
    """Waits until the client has disconnected, or has sent more than is allowed."""
    with suppress(Exception):
        while (await receive())["type"] != "http.disconnect":
            pass


GRACE_S = 5.0
"""Time to abandon a read that was cancelled or is late; a process that takes longer hangs and is killed."""
KILLED_S = 3.0
"""Longest wait for a killed process to end: it may be stuck on a missing disk."""
READ_AHEAD_BYTES = 1 << 20
"""Bytes of answers that are buffered before the process has to wait to write more."""
_REAPED_EVERY_S = 0.02


class ContentReader:
    """The process and the requests that wait for its answers; created by `start`.

    Args:
        process: A process that runs `grabberd.work.child`.
    """

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        self._process = process
        self._numbers = itertools.count(1)
        self._waiting: dict[int, asyncio.Future[Frame]] = {}
        self._open: set[int] = set()
        self._alive = True
        self._answers = asyncio.StreamReader(READ_AHEAD_BYTES)
        self._questions: asyncio.WriteTransport | None = None
        self._pipe: asyncio.ReadTransport | None = None
        self._listening: asyncio.Task[None] | None = None

    @classmethod
    async def start(cls, limits: Limits) -> "ContentReader":
        """Starts a process, which can be asked at once.

        Raises:
            OSError: The limit of processes or file descriptors has been reached.
        """
        # Not with asyncio: before Python 3.12 it starts a thread for each process and, if that fails, leaves
        # the process orphaned.
        process = start(limits)
        reader = cls(process)
        try:
            await reader._connect()
        except BaseException:
            process.kill()
            process.communicate()
            raise
        return reader

    @property
    def is_alive(self) -> bool:
        """False once the process has ended or was killed."""
        return self._alive

    @property
    def count(self) -> int:
        """Number of outstanding answers, including abandoned ones."""
        return len(self._waiting)

    @property
    def is_idle(self) -> bool:
        """True if nothing is being read and no content is partly sent."""
        return not self._waiting and not self._open

    def new_number(self) -> int:
        """A new number for a reading."""
        return next(self._numbers)

    def ask(self, question: Frame, until_s: float) -> Coroutine[None, None, Frame]:
        """Sends a question; returns a coroutine for the answer, which abandons the reading if cancelled.

        Args:
            question: The question.
            until_s: Monotonic time at which the reading gives up.

        Raises:
            ReadingGivenUp: No answer arrived in time, or the process has ended.
            GrabberdError: The reading failed.
        """
        if not self._alive:
            raise _ended()
        answer: asyncio.Future[Frame] = asyncio.get_running_loop().create_future()
        self._waiting[question.number] = answer
        self._tell(question)
        return self._answer(question.number, answer, until_s)

    def give_up(self, number: int) -> None:
        """Abandons a reading; does nothing if it has ended."""
        answer = self._waiting.get(number)
        if self._alive and (answer is not None or number in self._open):
            self._open.discard(number)
            self._tell(Frame(number, Question.GIVE_UP, b""))
            if answer is not None:
                asyncio.get_running_loop().call_later(GRACE_S, self._kill_if_waiting, answer)

    def kill(self) -> None:
        """Kills the process; its readings are abandoned."""
        self._alive = False
        if self._process.poll() is None:
            self._process.kill()

    async def close(self, grace_s: float = GRACE_S) -> None:
        """Ends the process and its readings; kills it if it does not end in time."""
        assert self._questions is not None
        assert self._listening is not None
        self._questions.close()
        await asyncio.wait((self._listening,), timeout=grace_s)
        self.kill()
        await asyncio.wait((self._listening,), timeout=KILLED_S)

    async def _connect(self) -> None:
        loop = asyncio.get_running_loop()
        protocol = asyncio.StreamReaderProtocol(self._answers)
        self._pipe, _ = await loop.connect_read_pipe(lambda: protocol, self._process.stdout)
        self._questions, _ = await loop.connect_write_pipe(asyncio.BaseProtocol, self._process.stdin)
        self._listening = asyncio.create_task(self._listen())

    def _tell(self, question: Frame) -> None:
        assert self._questions is not None
        self._questions.write(question.head())
        self._questions.write(question.content)

    async def _answer(self, number: int, answer: asyncio.Future[Frame], until_s: float) -> Frame:
        try:
            async with asyncio.timeout(until_s - time.monotonic() + GRACE_S):
                found = await answer
        except TimeoutError:
            self.kill()
            raise given_up("what was asked for") from None
        except asyncio.CancelledError:
            self.give_up(number)
            raise
        if found.kind == Answer.ERROR:
            raise unpacked_error(found.content)
        return found

    def _kill_if_waiting(self, answer: asyncio.Future[Frame]) -> None:
        if answer in self._waiting.values():
            self.kill()

    async def _listen(self) -> None:
        """Delivers answers until the process ends, then reaps it."""
        try:
            while True:
                number, kind, length = HEAD.unpack(await self._answers.readexactly(HEAD.size))
                self._hand_on(Frame(number, kind, await self._answers.readexactly(length)))
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            self.kill()  # it may have closed its output alone
            self._leave()
        while self._process.poll() is None:
            await asyncio.sleep(_REAPED_EVERY_S)

    def _hand_on(self, answer: Frame) -> None:
        waiting = self._waiting.pop(answer.number, None)
        if waiting is None or waiting.done():  # it was given up
            return
        if answer.kind == Answer.BEGUN:
            self._open.add(answer.number)
        elif answer.kind != Answer.PIECE:
            self._open.discard(answer.number)
        waiting.set_result(answer)

    def _leave(self) -> None:
        """Fails all outstanding answers."""
        for waiting in self._waiting.values():
            if not waiting.done():
                waiting.set_exception(_ended())
        self._waiting.clear()
        self._open.clear()
        for pipe in (self._questions, self._pipe):
            if pipe is not None:
                pipe.close()


def _ended() -> ReadingGivenUp:
    return ReadingGivenUp(
        "the process that reads captures ended while reading the requested data",
        "ask again; if it ends each time, 'grabberd storage verify' shows whether the capture is damaged",
    )


READ = f"{read.__module__}:{read.__name__}"
IDLE_S = 120.0
"""Idle time after which the process is ended, to free its memory."""
LOOK_EVERY_S = 0.5
"""Interval of further checks while a slow client still needs the process."""
CLOSED_S = 1.0
"""Time to end the process at shutdown, for which the daemon has nine seconds in all."""


class Content(NamedTuple):
    """Content that a route returns, to be read in the process.

    Attributes:
        read: One of `grabberd.archive.capture_contents.CONTENTS`.
        arguments: Its arguments.
        response: Makes the response from content that is needed as a whole, for its ETag.
        media_type: Media type of any other.
        name: File name of content that is downloaded.
        weight: Memory that it takes at most, in bytes, until it has been sent.
    """

    read: Callable[..., Any]
    arguments: tuple[Any, ...]
    response: Callable[[bytes], Response] | None = None
    media_type: str = ""
    name: str = ""
    weight: int = 2 << 20


class Contents:
    """The process that reads contents: started on demand, ended when idle.

    Args:
        limits: Number of concurrent readings, and the time for each, waiting included.
        function: Called in the process with the content's name and arguments.
        idle_s: See `IDLE_S`.
        memory: Memory that the answers take.
    """

    def __init__(
        self,
        limits: HttpLimits,
        function: str = READ,
        idle_s: float = IDLE_S,
        memory: AnswerMemory | None = None,
    ) -> None:
        self._limits = limits
        self._memory = memory or AnswerMemory()
        self._function = function
        self._idle_s = idle_s
        self._reader: ContentReader | None = None
        self._starting = asyncio.Lock()
        self._used_s = 0.0
        self._timer: asyncio.TimerHandle | None = None
        self._ending: set[asyncio.Task[None]] = set()
        self._closed = False

    @property
    def count(self) -> int:
        """Number of readings that are running or waiting for a thread."""
        return self._reader.count if self._reader else 0

    async def answer(self, content: Content, receive: Receive) -> Response:
        """The response with a content; the reading is abandoned if the client disconnects.

        Args:
            content: The content to read.
            receive: The request's `receive`, after its body has been read.

        Raises:
            Refusal: 503, too many readings are waiting already, or their answers take too much memory.
            ReadingGivenUp: The reading takes too long, or has ended the process.
            GrabberdError: The reading failed.
        """
        hold = await self._memory.hold(content.weight)
        try:
            answer = await self._answer(content, receive)
            if isinstance(answer, Download):
                return released_with(answer, hold.release)
            return held(answer, hold)
        except BaseException:
            hold.release()
            raise

    async def _answer(self, content: Content, receive: Receive) -> Response:
        reader = await self._ready()
        check_room(reader.count, self._limits)  # nothing else runs between this and `ask`
        until_s = self._until_s()
        call = Call(self._function, (content.read.__name__, *content.arguments), until_s)
        question = Frame(reader.new_number(), Question.CALL, pickle.dumps(call))
        answer = await _unless_left(reader, question, until_s, receive)
        self._used_s = time.monotonic()
        if answer.kind == Answer.WHOLE:
            return (content.response or partial(Response, media_type=content.media_type))(answer.content)
        opened = _Opened(reader, answer.number)
        if content.response is not None:
            return content.response(b"".join([piece async for piece in self._pieces(opened)]))
        response = download(opened, content.media_type, content.name)
        response.pieces = self._pieces
        return response

    async def close(self) -> None:
        """Ends the process and its readings for good."""
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
            return await ContentReader.start(replace(LIMITS, threads=self._limits.reads))
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
            question = Frame(opened.number, Question.NEXT, NUMBER.pack(until_s))
            answer = await opened.reader.ask(question, until_s)
            self._used_s = time.monotonic()
            if answer.kind == Answer.END:
                return
            yield answer.content

    def _until_s(self) -> float:
        return time.monotonic() + self._limits.read_timeout_s


class _Opened(NamedTuple):
    """Content that is being streamed."""

    reader: ContentReader
    number: int

    def close(self) -> None:
        """Abandons the reading; does nothing after its last piece."""
        self.reader.give_up(self.number)


async def _unless_left(reader: ContentReader, question: Frame, until_s: float, receive: Receive) -> Frame:
    """The answer to a question, which is abandoned if the client disconnects."""
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
