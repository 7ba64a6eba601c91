"""Heavy reads: made in a few threads of their own, within a time, and no longer than somebody waits for them.

A request that reads captures may take any time, by their length or by what is wrong with them. So it never
takes a thread that short requests need, such as those for the state or to stop a capture; what is too much
at once is refused; and it ends when its client leaves.
"""

import asyncio
import inspect
import time
from collections.abc import AsyncIterator, Callable, Coroutine, Generator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from contextvars import copy_context
from functools import partial
from typing import Annotated, Any, TypeVar

from anyio import CancelScope
from fastapi import Depends, Request
from fastapi.responses import Response
from pydantic import BaseModel
from starlette.types import Receive

from grabberd.api.guard.refusals import Refusal
from grabberd.api.streams.downloads import Download
from grabberd.api.turns import Turns
from grabberd.config import HttpLimits
from grabberd.storage.patience import CURRENT, Patience, check_patience

T = TypeVar("T")

WAITING_A_THREAD = 4
"""Reads that may wait for each thread: a page asks for several things at once."""
RETRY_S = 2
_END = object()


class Readings:
    """Threads for heavy reads, and what waits for them.

    Args:
        limits: Number of threads, and the time for a read, waiting included.
        now_s: Source of monotonic time.
    """

    def __init__(self, limits: HttpLimits, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._threads = limits.reads
        self._longest_s = limits.read_timeout_s
        self._pool = ThreadPoolExecutor(limits.reads, thread_name_prefix="reading")
        self._patiences: set[Patience] = set()
        self._turns = Turns()

    @property
    def count(self) -> int:
        """Number of reads that run or wait."""
        return len(self._patiences)

    @property
    def is_full(self) -> bool:
        """True if no further read may wait."""
        return self.count >= self._threads * (1 + WAITING_A_THREAD)

    async def answer(self, read: Callable[[], T], receive: Receive) -> T:
        """The result of a read for a request; given up when its client leaves.

        Args:
            read: Called in one of the threads.
            receive: The request's `receive`, after its body has been read.

        Raises:
            Refusal: 503, too many reads wait already.
            ReadingGivenUp: It takes too long.
        """
        if self.is_full:
            raise _busy(self.count)
        patience = self._patience()
        watch = asyncio.create_task(_give_up_when_gone(patience, receive))
        try:
            return await self._run(read, patience)
        finally:
            watch.cancel()

    async def pieces(self, source: Generator[T, None, None]) -> AsyncIterator[T]:
        """The pieces of a download; between them, while the client reads, no thread is taken.

        Raises:
            ReadingGivenUp: A piece takes too long.
        """
        while (piece := await self._run(partial(_next, source), self._patience())) is not _END:
            yield piece  # type: ignore[misc]

    def close(self) -> None:
        """Gives up all reads; none is accepted afterwards."""
        for patience in tuple(self._patiences):
            patience.give_up()
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _patience(self) -> Patience:
        return Patience(self._now_s() + self._longest_s, self._now_s, between=self._turns.pass_on)

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
            check_patience("what was asked for")  # it may have waited for a thread for too long
            return read()
        finally:
            self._turns.give()


def _next(source: Generator[T, None, None]) -> T | object:
    return next(source, _END)


async def _ended(work: "Future[T]", patience: Patience) -> T:
    """The result of work in a thread; whoever is cancelled waits until the thread has let go of it."""
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
    """Gives up as soon as the client has left, or has sent what is refused."""
    with suppress(Exception):
        while (await receive())["type"] != "http.disconnect":
            pass
    patience.give_up()


def _busy(count: int) -> Refusal:
    return Refusal(
        503,
        "too-many-reads",
        f"{count} requests that read captures run or wait already",
        "try again in a moment; the state and running captures are not affected",
        {"Retry-After": str(RETRY_S)},
    )


def _request(request: Request) -> Request:
    return request


def reads(endpoint: Callable[..., Any]) -> Callable[..., Coroutine[Any, Any, Any]]:
    """Decorator of a route that reads captures, reports or the like: it runs among the heavy reads."""

    async def read(*, request_of_read: Request, **parameters: Any) -> Any:
        readings: Readings = request_of_read.app.state.readings
        whole = partial(_response, endpoint, parameters)
        answer = await readings.answer(whole, request_of_read.receive)
        if isinstance(answer, Download):
            answer.pieces = readings.pieces
        return answer

    kind = inspect.Parameter.KEYWORD_ONLY
    own = inspect.Parameter("request_of_read", kind, annotation=Annotated[Request, Depends(_request)])
    plain = inspect.signature(endpoint)
    taken = [one.replace(kind=kind) for one in plain.parameters.values()]
    read.__signature__ = plain.replace(parameters=[*taken, own])  # type: ignore[attr-defined]
    read.__name__, read.__doc__, read.__module__ = endpoint.__name__, endpoint.__doc__, endpoint.__module__
    return read


def _response(endpoint: Callable[..., Any], parameters: dict[str, Any]) -> Any:
    """An endpoint's return value; a document as JSON, which takes long for many points."""
    found = endpoint(**parameters)
    if isinstance(found, BaseModel):
        return Response(found.model_dump_json(by_alias=True), media_type="application/json")
    return found
