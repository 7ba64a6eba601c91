"""What simulated threads wait for: locks, conditions, events, queues and pools, by a scheduler."""

import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from typing import TYPE_CHECKING, Any

from greenlet import greenlet

from grabberd.runtime import Empty

if TYPE_CHECKING:
    from tests.proofs.world.scheduler import Scheduler


class Deadlock(Exception):
    """Nobody can run, or threads wait for each other."""


class Task:
    """A simulated thread.

    Attributes:
        name: of the thread.
        number: in the order of their starts.
        is_daemons: False if it belongs to the world around the daemon, and survives its crash.
        waits: Number of its present wait; older timers are stale.
        waits_for: The lock that it waits for.
        failure: What it ended by.
    """

    __slots__ = (
        *("ended", "failure", "greenlet", "in_time", "is_daemons", "is_dying", "joining", "name", "number"),
        *("waits", "waits_for"),
    )

    def __init__(self, name: str, number: int, *, is_daemons: bool) -> None:
        self.name, self.number, self.is_daemons = name, number, is_daemons
        self.greenlet: greenlet
        self.waits = 0
        self.waits_for: Lock | None = None
        self.in_time = self.ended = self.is_dying = False
        self.joining: list[Task] = []
        self.failure: BaseException | None = None


class Lock:
    __slots__ = ("_by", "_scheduler", "_waiting")

    def __init__(self, scheduler: "Scheduler") -> None:
        self._scheduler = scheduler
        self._by: Task | None = None
        self._waiting: deque[Task] = deque()

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        scheduler = self._scheduler
        scheduler.meet()
        if self._by is None:
            self._by = scheduler.current
            return True
        if not blocking:
            return False
        return self._wait(None if timeout < 0 else scheduler._due(timeout))

    def _wait(self, due_ns: int | None) -> bool:
        scheduler = self._scheduler
        me = scheduler.current
        me.waits_for = self
        try:
            while self._by is not None:
                if due_ns is None:
                    self._check_cycle(me)
                self._waiting.append(me)
                if not scheduler.block(due_ns):
                    self._waiting.remove(me)
                    return False
            self._by = me
            return True
        finally:
            me.waits_for = None

    def _check_cycle(self, me: Task) -> None:
        """Whoever holds it may wait for one that I hold."""
        held_by, names = self._by, [me.name]
        while held_by is not None and held_by.waits_for is not None:
            names.append(held_by.name)
            if held_by is me:
                stacks = self._scheduler.stacks()
                here = "".join(traceback.format_stack()[-8:])
                self._scheduler._hub.throw(Deadlock(f"locks: {' → '.join(names)}\n{here}\n{stacks}"))
            held_by = held_by.waits_for._by

    def release(self) -> None:
        if self._by is None:
            raise RuntimeError("release unlocked lock")
        self._by = None
        if self._waiting:
            self._scheduler.wake(self._scheduler.any_of(self._waiting))

    def locked(self) -> bool:
        return self._by is not None

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()

    def free(self) -> int:
        """For a condition: lets it go, however often it is held."""
        self.release()
        return 1

    def take_back(self, times: int) -> None:
        """The reverse."""
        scheduler = self._scheduler
        if self._by is None:
            self._by = scheduler.current
        elif scheduler.current.is_dying:
            self._by = scheduler.current  # its holder is dying, too, or waits for ever
        else:
            self._wait(None)


class RLock(Lock):
    __slots__ = ("_times",)

    def __init__(self, scheduler: "Scheduler") -> None:
        super().__init__(scheduler)
        self._times = 0

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        if self._by is self._scheduler.current or super().acquire(blocking, timeout):
            self._times += 1
            return True
        return False

    def release(self) -> None:
        self._times -= 1
        if not self._times:
            super().release()

    def free(self) -> int:
        times, self._times = self._times, 1
        self.release()
        return times

    def take_back(self, times: int) -> None:
        super().take_back(times)
        self._times = times


class Condition:
    __slots__ = ("_lock", "_scheduler", "_waiting", "acquire", "release")

    def __init__(self, scheduler: "Scheduler", of: Lock | None) -> None:
        self._scheduler = scheduler
        self._lock = of or RLock(scheduler)
        self._waiting: deque[Task] = deque()
        self.acquire, self.release = self._lock.acquire, self._lock.release

    def __enter__(self) -> bool:
        return self._lock.acquire()

    def __exit__(self, *_: object) -> None:
        self._lock.release()

    def wait(self, timeout: float | None = None) -> bool:
        scheduler = self._scheduler
        me = scheduler.current
        self._waiting.append(me)
        times = self._lock.free()
        notified = False
        try:
            notified = scheduler.block(scheduler._due(timeout))
        finally:
            if not notified and me in self._waiting:
                self._waiting.remove(me)
            self._lock.take_back(times)
        return notified

    def wait_for(self, predicate: Callable[[], Any], timeout: float | None = None) -> Any:
        due_ns = self._scheduler._due(timeout)
        while not (found := predicate()):
            left_s = None if due_ns is None else (due_ns - self._scheduler.now_ns) / 1e9
            if left_s is not None and left_s <= 0:
                break
            self.wait(left_s)
        return found

    def notify(self, n: int = 1) -> None:
        while n > 0 and self._waiting:
            n -= 1
            self._scheduler.wake(self._scheduler.any_of(self._waiting))

    def notify_all(self) -> None:
        while self._waiting:
            self._scheduler.wake(self._waiting.popleft())


class Event:
    __slots__ = ("_is_set", "_scheduler", "_waiting")

    def __init__(self, scheduler: "Scheduler") -> None:
        self._scheduler = scheduler
        self._is_set = False
        self._waiting: list[Task] = []

    def is_set(self) -> bool:
        return self._is_set

    def set(self) -> None:
        self._is_set = True
        waiting, self._waiting = self._waiting, []
        for one in waiting:
            self._scheduler.wake(one)
        self._scheduler.meet()

    def clear(self) -> None:
        self._is_set = False

    def wait(self, timeout: float | None = None) -> bool:
        scheduler = self._scheduler
        if self._is_set:
            scheduler.meet()
            return True
        me = scheduler.current
        self._waiting.append(me)
        if not scheduler.block(scheduler._due(timeout)) and me in self._waiting:
            self._waiting.remove(me)
        return self._is_set


class Queue:
    __slots__ = ("_changed", "_items")

    def __init__(self, scheduler: "Scheduler") -> None:
        self._items: deque[Any] = deque()
        self._changed = Condition(scheduler, Lock(scheduler))

    def put(self, item: Any) -> None:
        with self._changed:
            self._items.append(item)
            self._changed.notify()

    def get(self, block: bool = True, timeout: float | None = None) -> Any:
        with self._changed:
            if not self._changed.wait_for(lambda: self._items, timeout if block else 0.0):
                raise Empty
            return self._items.popleft()

    def empty(self) -> bool:
        return not self._items


class _Result:
    def __init__(self, scheduler: "Scheduler") -> None:
        self.ended = Event(scheduler)
        self.value: Any = None
        self.error: BaseException | None = None

    def result(self, timeout: float | None = None) -> Any:
        if not self.ended.wait(timeout):
            raise TimeoutError
        if self.error is not None:
            raise self.error
        return self.value


class Pool(Executor):
    """A thread for each call: what its number would hold up is not simulated."""

    def __init__(self, scheduler: "Scheduler", name: str) -> None:
        self._scheduler, self._name = scheduler, name
        self._results: list[_Result] = []

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Any:
        result = _Result(self._scheduler)

        def call() -> None:
            try:
                result.value = fn(*args, **kwargs)
            except Exception as error:
                result.error = error
            result.ended.set()

        self._results.append(result)
        self._scheduler.spawn(call, self._name)
        return result

    def map(self, fn: Callable[..., Any], *iterables: Iterable[Any], **_: Any) -> Iterator[Any]:
        results = [self.submit(fn, *one) for one in zip(*iterables, strict=False)]
        return iter([one.result() for one in results])

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        for one in self._results:
            one.ended.wait()
