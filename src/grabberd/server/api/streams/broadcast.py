"""Messages that are made once for all listeners, and only while there are listeners."""

import asyncio
import logging
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Generic, TypeVar

from starlette.concurrency import run_in_threadpool

log = logging.getLogger(__name__)

T = TypeVar("T")


class Channel(Generic[T]):
    """The newest messages for all listeners, without a queue for each.

    A listener that falls behind the kept messages gets the newest one and misses the rest. Used within one
    event loop.

    Args:
        kept: Number of messages that are kept.

    Attributes:
        closed: True once there will be no more messages.
    """

    def __init__(self, kept: int = 1) -> None:
        self.closed = False
        self._newest: deque[T] = deque(maxlen=kept)
        self._count = 0
        self._changed = asyncio.Event()
        self._listeners = 0

    @contextmanager
    def listening(self) -> Iterator["Listener[T]"]:
        """A listener for the duration of the block."""
        if not self._listeners:
            self._newest.clear()  # they may be old
            self._begin()
        self._listeners += 1
        try:
            # One less than the count if a message is kept: the new listener has not seen it.
            yield Listener(self, self._count - bool(self._newest))
        finally:
            self._listeners -= 1
            if not self._listeners:
                self._end()

    def close(self) -> None:
        """Ends all listeners; to be called in the event loop."""
        self.closed = True
        self._wake()

    def _begin(self) -> None:
        """Starts making messages."""
        raise NotImplementedError

    def _end(self) -> None:
        """Stops making messages."""
        raise NotImplementedError

    def _put(self, message: T) -> None:
        self._newest.append(message)
        self._count += 1
        self._wake()

    def _wake(self) -> None:
        # Replaced before it is set: a listener that wakes up and waits again needs an unset event.
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()


class Broadcast(Channel[T]):
    """A channel whose messages are made periodically in a thread; a late listener gets the newest.

    Args:
        make: Makes a message, or returns None if nothing is new; called in a thread of the server's pool.
        every_s: Shortest interval between two calls of `make`.
    """

    def __init__(self, make: Callable[[], T | None], every_s: float) -> None:
        super().__init__()
        self._make = make
        self._every_s = every_s
        self._task: asyncio.Task[None] | None = None
        self._failed = False

    def _begin(self) -> None:
        self._task = asyncio.create_task(self._run())

    def _end(self) -> None:
        assert self._task is not None
        self._task.cancel()
        self._task = None

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
            self._put(made)


class Listener(Generic[T]):
    """One listener's position in a channel.

    Attributes:
        passed: Number of messages made between the last two calls of `next`, including the returned one.
    """

    def __init__(self, channel: Channel[T], seen: int) -> None:
        self.passed = 0
        self._channel = channel
        self._seen = seen

    async def next(self, patience_s: float) -> T | None:
        """The next message, or the newest if that is gone; None after the timeout or the channel's end."""
        channel = self._channel
        with suppress(TimeoutError):
            async with asyncio.timeout(patience_s):
                while channel._count == self._seen and not channel.closed:
                    await channel._changed.wait()
        late = self.passed = channel._count - self._seen
        if not late or channel.closed:
            return None
        if late > len(channel._newest):
            late = 1
        message = channel._newest[-late]
        self._seen = channel._count - late + 1
        return message
