"""`python -m tests.proofs.world.interleavings`: small objects that threads share, in many interleavings.

A model checker (frontrun) runs two threads of each, switching between bytecodes, in orders that differ where
they matter. What the object promises holds in all of them, and no longer does once its source has the one
mistake that stands here beside it: the check can fail. Worlds switch at locks and commits alone; whether
those locks hold what they should is asked here.
"""

import inspect
import logging
import os
import sys
import textwrap
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import partial
from types import CodeType, FunctionType, SimpleNamespace
from typing import Any, NamedTuple

import frontrun
import numpy as np

from grabberd import runtime
from grabberd.archive.access import Remembered
from grabberd.core.channels.logger import Dating
from grabberd.core.ledger import Outcome, Slot
from grabberd.documents.enums import DeviceState
from grabberd.errors import Cause, DeviceAbsent
from grabberd.fault_board import FaultBoard
from grabberd.instrument.acquisition import Backlog
from grabberd.instrument.acquisition.ring import Ring, RingReader
from grabberd.instrument.active_calibrations import _Rejections
from grabberd.instrument.capture_end import UnsealedCaptures
from grabberd.instrument.channels.feed import Feed, Part
from grabberd.instrument.channels.logger_board import LoggerBoard
from grabberd.instrument.device.status_board import RecentFields
from grabberd.instrument.device.worker import Latency

EXECUTIONS = 60
"""Most interleavings of each object; most have fewer that differ."""
PATIENCE_S = 60.0
"""Real time for one of them, which a busy computer may need; it takes some hundredths of a second."""
CLOCK = SimpleNamespace(now_ns=lambda: 0, utc_now=lambda: datetime(2026, 1, 1, tzinfo=UTC))
CAUSE = Cause.LOGGER_FAILED
State = SimpleNamespace


class Shared(NamedTuple):
    """An object that threads share.

    Attributes:
        setup: Makes it, with whatever its threads need and leave.
        threads: What two threads do with it.
        holds: What is true after that, in whatever order they went.
        mistake: A function, a part of its source, and what would be wrong in its place.
    """

    setup: Callable[[], State]
    threads: tuple[Callable[[State], object], ...]
    holds: Callable[[State], bool]
    mistake: tuple[Callable[..., Any], str, str]


class Patched(runtime.Runtime):
    """Hands out what `threading` has at this moment, since the model checker replaces it."""

    def lock(self) -> Any:  # type: ignore[override]
        return threading.Lock()

    def rlock(self) -> Any:  # type: ignore[override]
        return threading.RLock()

    def condition(self, of: Any = None) -> Any:  # type: ignore[override]
        return threading.Condition(of)

    def event(self) -> Any:  # type: ignore[override]
        return threading.Event()


# The ring: each field once, in order, as a slot or as an overrun.


def _ring() -> State:
    ring = Ring(1)
    state = State(ring=ring, reader=ring.reader(), fields=[])
    ring.put(_slot(0))
    return state


def _slot(n: int) -> Slot:
    return Slot(None, n, Outcome.RECEIVED, None, (), n)


def _take_slot(state: State) -> None:
    slot = state.reader.take(1.0)
    for entry in slot.lost_before:
        state.fields += range(entry.first_n, entry.end_n)
    state.fields.append(slot.n)


def _took_each(state: State) -> bool:
    while state.reader.waiting:
        _take_slot(state)
    return state.fields == [0, 1]


# The backlog: an index gives its own item, or says that it is forgotten.


def _backlog() -> State:
    backlog: Backlog[int] = Backlog(1)
    backlog.append(0)
    backlog.written(1)
    backlog.append(1)
    return State(backlog=backlog, item=None)


def _look_back(state: State) -> None:
    try:
        state.item = state.backlog.at(0, 1.0)
    except LookupError:
        state.item = "forgotten"


# The feed: who follows gets each part once.


def _put_parts(state: State) -> None:
    for number in range(2):
        times, values = np.array([number]), np.zeros((1, 1))
        state.feed.put(Part(number, times, values, values, (), Dating.MONOTONIC, 1))


def _follow(state: State) -> None:
    state.follower = state.feed.follow()


def _followed(state: State) -> bool:
    return [one.posted_ns for one in state.follower.take(10)] == [0, 1]


# Boards and counts: nothing that is noted is lost, and nobody sees it by half.


def _report(state: State) -> None:
    state.faults.report(CAUSE, "it fails", "mend it")


def _recent() -> State:
    state = State(recent=RecentFields(), due=None)
    state.recent.count(0, Outcome.RECEIVED, 1)
    return state


def _count(state: State) -> None:
    state.recent.count(0, Outcome.RECEIVED, 1)


def _look_at_count(state: State) -> None:
    state.due = state.recent.within(0).due


def _look_at_latency(state: State) -> None:
    state.seen = state.latency.histogram


def _board() -> State:
    board = LoggerBoard("vacuum", CLOCK)
    board.enter(DeviceState.READY, None)
    return State(board=board)


# Captures that wait for their seal, calibrations that were rejected: none is lost.


def _unsealed() -> State:
    captures = UnsealedCaptures(lambda: None, lambda one: None, lambda one: None, FaultBoard(CLOCK), CLOCK)
    first, second = (State(id=name, failure=None) for name in ("first", "second"))
    captures.add(first)
    return State(captures=captures, first=first, second=second)


def _rejections() -> State:
    kept: dict[str, Any] = {}
    return State(rejections=_Rejections(State(get=kept.get, put=kept.update), CLOCK))


# A cache: never older than the database once that stands still.


def _remembered() -> State:
    state = State(database=(1, "old"))
    state.cache = Remembered(State(now=lambda: state.database[0]), 4)
    return state


def _change(state: State) -> None:
    state.database = (2, "new")


def _read(state: State) -> str:
    return state.cache.get("key", lambda: state.database[1])


UNLOCKED = "if True:"
OBJECTS: dict[str, Shared] = {
    "ring": Shared(
        _ring,
        (lambda state: state.ring.put(_slot(1)), _take_slot),
        _took_each,
        (RingReader.take, "with self._ring._changed:", UNLOCKED),
    ),
    "backlog": Shared(
        _backlog,
        (lambda state: state.backlog.written(1), _look_back),
        lambda state: state.item in (0, "forgotten"),
        (Backlog.at, "with self._changed:", UNLOCKED),
    ),
    "feed": Shared(
        lambda: State(feed=Feed()),
        (_put_parts, _follow),
        _followed,
        (
            Feed.follow,
            "        with self.lock:\n            follower = Follower(self, list(self._kept))\n",
            "        follower = Follower(self, list(self._kept))\n        with self.lock:\n",
        ),
    ),
    "faults": Shared(
        lambda: State(faults=FaultBoard(CLOCK)),
        (_report, _report),
        lambda state: state.faults.counts[CAUSE] == 1,
        (
            FaultBoard.report,
            "        with self._lock:\n            known = self._now.get(cause)\n",
            "        known = self._now.get(cause)\n        with self._lock:\n",
        ),
    ),
    "recent fields": Shared(
        _recent,
        (_count, _look_at_count),
        lambda state: state.due in (1, 2),
        (RecentFields.count, "with self._lock:", UNLOCKED),
    ),
    "latency": Shared(
        lambda: State(latency=Latency(), seen=None),
        (lambda state: state.latency.add(10**9), _look_at_latency),
        lambda state: sum(state.seen.counts) == state.seen.sum_s,
        (Latency.histogram.fget, "with self._lock:", UNLOCKED),
    ),
    "logger's board": Shared(
        _board,
        (
            lambda state: state.board.came(1, ()),
            lambda state: state.board.enter(
                DeviceState.ABSENT, DeviceAbsent("it is unplugged", "plug it in")
            ),
        ),
        lambda state: state.board.now.readings == 1,
        (
            LoggerBoard.enter,
            "        with self._lock:\n            before = self._status\n",
            "        before = self._status\n        with self._lock:\n",
        ),
    ),
    "unsealed captures": Shared(
        _unsealed,
        (
            lambda state: state.captures.add(state.second),
            lambda state: state.captures._drop(state.first),
        ),
        lambda state: state.captures.captures == (state.second,),
        (UnsealedCaptures._drop, "with self._lock:", UNLOCKED),
    ),
    "rejected calibrations": Shared(
        _rejections,
        (
            lambda state: state.rejections.add("first", ""),
            lambda state: state.rejections.add("second", ""),
        ),
        lambda state: set(state.rejections.all()) == {"first", "second"},
        (_Rejections.add, "with self._lock:", UNLOCKED),
    ),
    "cache": Shared(
        _remembered,
        (_change, _read),
        lambda state: _read(state) == "new",
        (Remembered.get, "self._enter(key, value, before)", "self._enter(key, value, self._version.now())"),
    ),
}


class Explored(NamedTuple):
    """Interleavings of an object that were run, and whether its promise held in all of them."""

    holds: bool
    executions: int


def explored(shared: Shared) -> Explored:
    """Runs interleavings of an object until its promise does not hold, or there are no others."""
    with runtime.installed(Patched()):
        found = frontrun.explore(
            setup=shared.setup,
            workers=[partial(_run, one) for one in shared.threads],
            invariant=lambda state: not hasattr(state, "error") and shared.holds(state),
            max_executions=EXECUTIONS,
            timeout_per_run=PATIENCE_S,
            deadlock_timeout=PATIENCE_S,
            reproduce_on_failure=0,
            detect_io=False,
            clock="virtual",
        )
    return Explored(found.property_holds, found.num_explored)


def _run(thread: Callable[[State], object], state: State) -> None:
    try:
        thread(state)
    except Exception as error:
        state.error = error


@contextmanager
def mistaken(function: Callable[..., Any], right: str, wrong: str) -> Iterator[None]:
    """Puts a mistake into a function while the block lasts."""
    assert isinstance(function, FunctionType)
    source = inspect.getsource(function)
    assert source.count(right) == 1, right
    lines = "\n" * (function.__code__.co_firstlineno - 1)
    text = lines + textwrap.dedent(source.replace(right, wrong))
    module = compile(text, function.__code__.co_filename, "exec", dont_inherit=True)
    before = function.__code__
    function.__code__ = next(one for one in module.co_consts if isinstance(one, CodeType))
    try:
        yield
    finally:
        function.__code__ = before


def main() -> int:
    """Prints each object, with and without its mistake."""
    os.environ["FRONTRUN_ACTIVE"] = "1"  # as its own command does
    logging.disable()
    for name, shared in OBJECTS.items():
        right = explored(shared)
        with mistaken(*shared.mistake):
            wrong = explored(shared)
        found = f"mistake found in number {wrong.executions}" if not wrong.holds else "mistake NOT found"
        kept = "kept" if right.holds else "BROKEN"
        print(f"{name}: promise {kept} in {right.executions} interleavings, {found}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
