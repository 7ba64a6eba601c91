"""A repeated message that is made once for all listeners, and only while there are any."""

import asyncio
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Generic, TypeVar

from starlette.concurrency import run_in_threadpool

log = logging.getLogger(__name__)

T = TypeVar("T")


class Broadcast(Generic[T]):
    """Repeats a message without a queue: a late listener gets the newest one and misses the rest.

    Used within one event loop; the messages are made in a thread.

    Args:
        make: Makes a message, or returns None if there is nothing new; called in a thread of the server's
            pool.
        every_s: Shortest time between two calls of `make`.

    Attributes:
        closed: True once no further message will come.
    """

    def __init__(self, make: Callable[[], T | None], every_s: float) -> None:
        self.closed = False
        self._make = make
        self._every_s = every_s
        self._newest: T | None = None
        self._count = 0
        self._changed = asyncio.Event()
        self._listeners = 0
        self._task: asyncio.Task[None] | None = None
        self._failed = False

    @contextmanager
    def listening(self) -> Iterator["Listener[T]"]:
        """A listener for the duration of the block."""
        self._listeners += 1
        if self._task is None:
            self._newest = None  # it may be old
            self._task = asyncio.create_task(self._run())
        try:
            # One less than the count if there is a message: the new listener has not seen it.
            yield Listener(self, self._count - (self._newest is not None))
        finally:
            self._listeners -= 1
            if not self._listeners:
                self._task.cancel()
                self._task = None

    def close(self) -> None:
        """Ends every listener; to be called in the event loop."""
        self.closed = True
        self._wake()

    async def _run(self) -> None:
        loop = asyncio.get_running_loop()
        while not self.closed:
            due_s = loop.time() + self._every_s
            await self._make_one()
            await asyncio.sleep(due_s - loop.time())

    async def _make_one(self) -> None:
        try:
            made = await run_in_threadpool(self._make)
        except Exception:
            if not self._failed:
                log.exception("live data cannot be made at this moment")
            self._failed = True
            return
        self._failed = False
        if made is not None:
            self._newest, self._count = made, self._count + 1
            self._wake()

    def _wake(self) -> None:
        # Replaced before it is set: a listener that wakes up and waits again needs an event that is not set.
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()


class Listener(Generic[T]):
    """One listener's position in a broadcast."""

    def __init__(self, broadcast: Broadcast[T], seen: int) -> None:
        self._broadcast = broadcast
        self._seen = seen

    async def next(self, patience_s: float) -> T | None:
        """The newest message if it is unseen, else the next one; None if none comes in time, or ever."""
        with suppress(TimeoutError):
            async with asyncio.timeout(patience_s):
                while self._broadcast._count == self._seen and not self._broadcast.closed:
                    await self._broadcast._changed.wait()
        if self._broadcast._count == self._seen or self._broadcast.closed:
            return None
        self._seen = self._broadcast._count
        return self._broadcast._newest
