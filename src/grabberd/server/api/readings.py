"""Heavy reads: in a few dedicated threads, with a time limit, and cancelled when the client disconnects.

A request that reads captures can take any time, depending on their length or damage. So it never takes a
thread that short requests need, such as for the state or for stopping a capture, and beyond a limit it is
refused. Only one of the threads computes at a time: with eight, an answer of one millisecond would wait a
second for the interpreter, and captures would lose fields.
"""

import asyncio
import inspect
import threading
import time
from collections import deque
from collections.abc import AsyncIterator, Callable, Coroutine, Generator
from concurrent.futures import Future, ThreadPoolExecutor
from contextvars import copy_context
from typing import Annotated, Any, TypeVar

from anyio import CancelScope
from fastapi import Depends, Request
from fastapi.responses import Response
from starlette.types import Receive

from grabberd.config import HttpLimits
from grabberd.files.reading import CURRENT, Patience, check_patience
from grabberd.server.api.answers import OF_A_READ, held, released_with
from grabberd.server.api.contents import Content, Contents, check_room, client_left
from grabberd.server.api.responses import rendered
from grabberd.server.api.streams.downloads import Download

HELD_S = 0.25
"""Time after which a turn passes to the next thread in any case: its owner may be waiting for a disk."""


class Turns:
    """Passes the turn from one thread to the next, in order of arrival."""

    def __init__(self, held_s: float = HELD_S) -> None:
        self._held_s = held_s
        self._changed = threading.Condition()
        self._waiting: deque[int] = deque()
        self._owner: int | None = None
        self._since_s = 0.0

    def take(self) -> None:
        """Waits for the turn."""
        me = threading.get_ident()
        with self._changed:
            self._waiting.append(me)
            while self._waiting[0] != me or not self._is_free():
                self._changed.wait(self._held_s)
            self._waiting.popleft()
            self._owner, self._since_s = me, time.monotonic()
            self._changed.notify_all()

    def give(self) -> None:
        """Ends the turn, unless it has passed to another thread already."""
        with self._changed:
            if self._owner == threading.get_ident():
                self._owner = None
                self._changed.notify_all()

    def pass_on(self) -> None:
        """Yields the turn to a waiting thread and waits for the next; called between two steps."""
        if self._waiting:
            self.give()
            self.take()

    def _is_free(self) -> bool:
        return self._owner is None or time.monotonic() >= self._since_s + self._held_s


T = TypeVar("T")

_END = object()


class Readings:
    """Threads for heavy reads, and the queue of reads.

    Args:
        limits: Number of threads, and the time for a read, waiting included.
        now_s: Source of monotonic time.
    """

    def __init__(self, limits: HttpLimits, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._limits = limits
        self._pool = ThreadPoolExecutor(limits.reads, thread_name_prefix="reading")
        self._patiences: set[Patience] = set()
        self._turns = Turns()

    @property
    def count(self) -> int:
        """Number of reads that are running or waiting."""
        return len(self._patiences)

    async def answer(self, read: Callable[[], T], receive: Receive) -> T:
        """The result of a read for a request; cancelled if its client disconnects.

        Args:
            read: Called in one of the threads.
            receive: The request's `receive`, after its body has been read.

        Raises:
            Refusal: 503, too many reads are waiting already.
            ReadingGivenUp: The read takes too long.
        """
        check_room(self.count, self._limits)
        patience = self._patience()
        watch = asyncio.create_task(_give_up_when_gone(patience, receive))
        try:
            return await self._run(read, patience)
        finally:
            watch.cancel()

    async def pieces(self, source: Generator[T, None, None]) -> AsyncIterator[T]:
        """The pieces of a download; no thread is occupied while the client reads.

        Raises:
            ReadingGivenUp: A piece takes too long.
        """
        while (piece := await self._run(lambda: next(source, _END), self._patience())) is not _END:
            yield piece  # type: ignore[misc]

    def close(self) -> None:
        """Cancels all reads; no more are accepted."""
        for patience in tuple(self._patiences):
            patience.give_up()
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _patience(self) -> Patience:
        return Patience(self._now_s() + self._limits.read_timeout_s, self._now_s, between=self._turns.pass_on)

    async def _run(self, read: Callable[[], T], patience: Patience) -> T:
        context = copy_context()
        context.run(CURRENT.set, patience)
        self._patiences.add(patience)
        try:
            work = self._pool.submit(context.run, self._in_turn, read)
            return await _ended(work, patience)
        finally:
            self._patiences.discard(patience)

    def _in_turn(self, read: Callable[[], T]) -> T:
        self._turns.take()
        try:
            check_patience("what was asked for")  # it may have waited too long for a thread
            return read()
        finally:
            self._turns.give()


async def _ended(work: "Future[T]", patience: Patience) -> T:
    """The result of work in a thread; a cancelled caller waits until the thread has stopped."""
    over = asyncio.Event()
    loop = asyncio.get_running_loop()
    work.add_done_callback(lambda _: loop.call_soon_threadsafe(over.set))
    try:
        return await asyncio.wrap_future(work)
    except asyncio.CancelledError:
        patience.give_up()
        with CancelScope(shield=True):
            await over.wait()
        raise


async def _give_up_when_gone(patience: Patience, receive: Receive) -> None:
    await client_left(receive)
    patience.give_up()


async def _request(request: Request) -> Request:
    return request


def reads(endpoint: Callable[..., Any]) -> Callable[..., Coroutine[Any, Any, Any]]:
    """Decorator for a route that reads captures, reports or the like: runs it as a heavy read.

    If the route returns a `Content`, that is read in the process for contents.
    """

    async def read(*, request_of_read: Request, **parameters: Any) -> Any:
        readings: Readings = request_of_read.app.state.readings
        hold = await request_of_read.app.state.answers.hold(OF_A_READ)
        try:
            answer = await readings.answer(lambda: rendered(endpoint(**parameters)), request_of_read.receive)
            if isinstance(answer, Response) and hasattr(answer, "body"):
                return held(answer, hold)
        except BaseException:
            hold.release()
            raise
        if isinstance(answer, Download):
            answer.pieces = readings.pieces
            return released_with(answer, hold.release)
        hold.release()
        if isinstance(answer, Content):
            contents: Contents = request_of_read.app.state.contents
            return await contents.answer(answer, request_of_read.receive)
        return answer

    kind = inspect.Parameter.KEYWORD_ONLY
    own = inspect.Parameter("request_of_read", kind, annotation=Annotated[Request, Depends(_request)])
    plain = inspect.signature(endpoint)
    taken = [one.replace(kind=kind) for one in plain.parameters.values()]
    answered = Response if plain.return_annotation is Content else plain.return_annotation
    whole = plain.replace(parameters=[*taken, own], return_annotation=answered)
    read.__signature__ = whole  # type: ignore[attr-defined]
    read.__name__, read.__doc__, read.__module__ = endpoint.__name__, endpoint.__doc__, endpoint.__module__
    return read
