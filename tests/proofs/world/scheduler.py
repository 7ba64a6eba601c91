"""A runtime in which one thread runs at a time, chosen by a seed, and time is simulated.

Each thread of the program is a greenlet. Wherever threads meet – a lock, a condition, an event, a queue, a
sleep, a commit – the running one may be put back, and the seed says who goes on. Time stands while anybody
can run; when all wait, it jumps to the next moment that somebody waits for. If nobody waits for a moment, or
if threads wait for each other's locks, that is a deadlock, which is printed with all stacks. The same seed
makes the same decisions, and so the same trace.

Not simulated: switches between two bytecodes that share data without any of the above, and what computing
costs; a busy computer is simulated by lateness.
"""

import heapq
import itertools
import random
import traceback
from collections import deque
from collections.abc import Callable, Iterable
from datetime import UTC, datetime, timedelta
from threading import Thread

from greenlet import GreenletExit, getcurrent, greenlet
from tests.proofs.world.waiting import Condition, Deadlock, Event, Lock, Pool, Queue, RLock, Task

from grabberd.runtime import Runtime

START_NS = 1_000_000_000_000
START_UTC = datetime(2026, 1, 1, tzinfo=UTC)
TICK_NS = 200
"""By which reading the clock moves it on: whoever waits for a time by asking for it again comes to an end."""
STUCK_NS = 3600 * 10**9
_MASK = (1 << 64) - 1


class Killed(GreenletExit):
    """Ends a thread of a daemon that has crashed."""


class Scheduler(Runtime):
    """Simulated time and threads; to be installed while `run` runs.

    Args:
        seed: of all decisions.
        switch_every: Mean number of meetings of threads from one switch that is not needed to the next.

    Attributes:
        now_ns: Simulated CLOCK_MONOTONIC.
        utc_step: By how much the time of day was set on.
        trace: Hash of all decisions and their times.
        switches: Number of decisions.
        lateness_ns: Time for which a thread of the daemon, by its name, that could run does not; None: 0.
        halts: Set while the daemon crashes: its threads run no more.
    """

    def __init__(self, seed: int, switch_every: float = 40.0) -> None:
        self.random = random.Random(seed)
        self.now_ns = START_NS
        self.utc_step = timedelta()
        self.trace = self.switches = 0
        self.lateness_ns: Callable[[str], int] | None = None
        self.halts = False
        self.tasks: dict[int, Task] = {}
        self.current: Task
        self._ready: list[Task] = []
        self._timers: list[tuple[int, int, Task, int]] = []
        self._order = itertools.count()
        self._numbers = itertools.count(1)
        self._rate = 1.0 / switch_every
        self._countdown = 1
        self._hub = getcurrent()

    # Time

    def monotonic_ns(self) -> int:  # type: ignore[override]
        self.now_ns += TICK_NS
        return self.now_ns

    def monotonic(self) -> float:  # type: ignore[override]
        return self.monotonic_ns() / 1e9

    def utc_now(self) -> datetime:
        return START_UTC + self.utc_step + timedelta(microseconds=(self.now_ns - START_NS) // 1000)

    def sleep(self, seconds: float) -> None:  # type: ignore[override]
        self.block(self.now_ns + max(round(seconds * 1e9), 0))

    def sleep_until_ns(self, due_ns: int) -> None:
        """Waits for a moment; for none that has passed."""
        if due_ns > self.now_ns:
            self.block(due_ns)

    def stop_computer(self, seconds: float) -> None:
        """Time goes on, and nobody runs."""
        self.now_ns += round(seconds * 1e9)

    # Threads

    def start(self, thread: Thread) -> None:  # type: ignore[override]
        if hasattr(thread, "simulated"):
            raise RuntimeError("threads can only be started once")
        thread.simulated = self.spawn(thread.run, thread.name)  # type: ignore[attr-defined]
        self.meet()

    def join(self, thread: Thread, timeout: float | None = None) -> None:  # type: ignore[override]
        task: Task = thread.simulated  # type: ignore[attr-defined]
        if not task.ended:
            task.joining.append(self.current)
            self.block(self._due(timeout))

    def is_alive(self, thread: Thread) -> bool:  # type: ignore[override]
        task: Task | None = getattr(thread, "simulated", None)
        return task is not None and not task.ended

    def spawn(self, run: Callable[[], None], name: str, *, is_daemons: bool | None = None) -> Task:
        """Makes a thread that can run; it belongs to whom the one that makes it belongs to."""
        if is_daemons is None:
            is_daemons = self.current.is_daemons
        task = Task(name, next(self._numbers), is_daemons=is_daemons)
        task.greenlet = greenlet(lambda *_: self._lives(task, run), self._hub)
        self.tasks[task.number] = task
        self._can_run(task)
        return task

    def run(self, main: Callable[[], None]) -> None:
        """Runs the world from its first thread's begin to its end; all others end with it.

        Raises:
            Deadlock: See there.
        """
        self._hub = getcurrent()
        first = Task("world", 0, is_daemons=False)
        first.greenlet = greenlet(lambda: self._lives(first, main), self._hub)
        self.tasks[0] = self.current = first
        first.greenlet.switch()
        self.kill(self.tasks.values())
        if first.failure is not None:
            raise first.failure

    def kill(self, tasks: Iterable[Task]) -> None:
        """Ends threads where they are; what they do on their way out meets nobody."""
        for task in list(tasks):
            if task is self.current and not task.ended:
                continue
            task.is_dying = True
            if not task.ended:
                before, self.current = self.current, task
                task.greenlet.parent = getcurrent()
                task.greenlet.throw(Killed)
                self.current = before
                if not task.ended:  # it never began
                    self._ends(task)
        self._ready = [one for one in self._ready if not one.is_dying]

    def give_up(self, *_: object) -> None:
        """Ends a world that does not end; a signal's handler."""
        self._hub.throw(Deadlock(f"it does not end\n{self.stacks()}"))

    def stacks(self) -> str:
        """Where everybody is."""

        def frames(task: Task) -> list[str]:
            frame = task.greenlet.gr_frame
            running = task is self.current and frame is None
            return traceback.format_stack()[:-4] if running else traceback.format_stack(frame)

        return "\n".join(
            f"--- {one.name} ({one.number})\n{''.join(frames(one)[-6:])}" for one in self.tasks.values()
        )

    def _lives(self, task: Task, run: Callable[[], None]) -> None:
        try:
            run()
        except Killed:
            pass
        except BaseException as error:
            task.failure = error
            if task.number:
                self.failed(task, error)
        self._ends(task)
        if not task.is_dying and task.number:
            # A greenlet that ends goes on in its parent: one that never came back would never be freed.
            self.current = self._chosen()
            task.greenlet.parent = self.current.greenlet

    def _ends(self, task: Task) -> None:
        task.ended = True
        self.tasks.pop(task.number, None)
        for one in task.joining:
            self.wake(one)

    def failed(self, task: Task, error: BaseException) -> None:
        """A thread has ended by an error, which the interpreter would print; a world notes it."""
        raise error

    def time_jumped(self) -> None:
        """Called when time has gone on."""

    # Decisions

    def meet(self) -> None:
        """A point where threads meet: now and then another one goes on."""
        self._countdown -= 1
        if self._countdown <= 0:
            self._countdown = 1 + int(self.random.expovariate(self._rate))
            if not self.current.is_dying and self._ready:
                self._can_run(self.current)
                self._go_on()

    def block(self, due_ns: int | None = None) -> bool:
        """Waits for `wake`; False if the time came first."""
        task = self.current
        if task.is_dying:
            raise Killed
        task.waits += 1
        task.in_time = False
        if due_ns is not None:
            heapq.heappush(self._timers, (due_ns, next(self._order), task, task.waits))
        self._go_on()
        return task.in_time

    def wake(self, task: Task) -> None:
        """Has a thread that waits go on."""
        if not task.ended:
            task.waits += 1
            task.in_time = True
            self._can_run(task)

    def _can_run(self, task: Task) -> None:
        if self.lateness_ns is not None and task.is_daemons and (late := self.lateness_ns(task.name)) > 0:
            task.waits += 1
            heapq.heappush(self._timers, (self.now_ns + late, next(self._order), task, -task.waits))
        else:
            self._ready.append(task)

    def _go_on(self) -> None:
        task = self._chosen()
        if task is self.current:
            return
        self.current = task
        task.greenlet.switch()
        # Back again: whoever has switched here has set `current`.

    def _chosen(self) -> Task:
        ready = self._ready
        while True:
            self._ring()
            while not ready:
                if not self._timers:
                    self._hub.throw(Deadlock(f"nobody can run\n{self.stacks()}"))
                self.now_ns = max(self.now_ns, self._timers[0][0])
                self.time_jumped()
                self._ring()
            place = int(self.random.random() * len(ready)) if len(ready) > 1 else 0
            task = ready[place]
            ready[place] = ready[-1]
            ready.pop()
            if task.is_dying or (self.halts and task.is_daemons):
                continue
            self.switches += 1
            self.trace = (self.trace * 1000003 ^ self.now_ns ^ task.number << 40) & _MASK
            return task

    def _ring(self) -> None:
        """Wakes those whose time has come."""
        timers, now_ns = self._timers, self.now_ns
        while timers and timers[0][0] <= now_ns:
            _, _, task, waits = heapq.heappop(timers)
            if waits == task.waits:
                task.waits += 1
                self._can_run(task)
            elif waits == -task.waits:  # it was only late
                self._ready.append(task)

    def _due(self, timeout_s: float | None) -> int | None:
        return None if timeout_s is None else self.now_ns + max(round(timeout_s * 1e9), 0)

    # What threads meet at

    def lock(self) -> Lock:  # type: ignore[override]
        return Lock(self)

    def rlock(self) -> RLock:  # type: ignore[override]
        return RLock(self)

    def condition(self, of: Lock | None = None) -> Condition:  # type: ignore[override]
        return Condition(self, of)

    def event(self) -> Event:  # type: ignore[override]
        return Event(self)

    def simple_queue(self) -> Queue:  # type: ignore[override]
        return Queue(self)

    def pool(self, threads: int, name: str) -> Pool:
        return Pool(self, name)

    def any_of(self, tasks: deque[Task]) -> Task:
        """Takes one of those who wait, by the seed."""
        if len(tasks) > 1:
            tasks.rotate(int(self.random.random() * len(tasks)))
        return tasks.popleft()
