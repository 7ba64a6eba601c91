"""A capture thread in simulated time: nothing sleeps, an hour passes in no time."""

import threading
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any, NamedTuple

from grabberd.config import DeviceConfig
from grabberd.core.ledger import LedgerEntry, Slot
from grabberd.documents.enums import DeviceState
from grabberd.errors import GrabberdError
from grabberd.instrument.acquisition.device import Grabber
from grabberd.instrument.device.capture_thread import CaptureThread
from grabberd.instrument.device.field_pipeline import FieldPipeline
from grabberd.instrument.device.scheduling import ThreadAccount
from grabberd.instrument.device.status_board import StatusBoard

START_NS = 1_000_000_000
SMALL = DeviceConfig(driver="test", threshold={"kind": "fixed", "value": 60}, ring={"lines": "field"})


class SimulatedClock:
    """Stands still until somebody waits on it; serves the program and the simulated grabber alike."""

    def __init__(self) -> None:
        self.ns = START_NS

    def now_ns(self) -> int:
        return self.ns

    def utc_now(self) -> datetime:
        return datetime(2026, 1, 1, tzinfo=UTC) + timedelta(microseconds=self.ns / 1000)

    def sleep(self, seconds: float) -> None:
        self.ns += max(0, round(seconds * 1e9))

    def sleep_until_ns(self, time_ns: int) -> None:
        self.ns = max(self.ns, time_ns)

    @property
    def passed_s(self) -> float:
        return (self.ns - START_NS) / 1e9


class Until(threading.Event):
    """Is set by itself when the clock has come to a time; waiting on it is how that comes."""

    def __init__(self, clock: SimulatedClock, end_s: float) -> None:
        super().__init__()
        self._clock, self._end_s = clock, end_s

    def is_set(self) -> bool:
        return super().is_set() or self._clock.passed_s >= self._end_s

    def wait(self, timeout: float | None = None) -> bool:
        self._clock.sleep(self._end_s if timeout is None else timeout)
        return self.is_set()


class Seen(NamedTuple):
    """A state that the device came to, and when."""

    at_s: float
    state: DeviceState
    cause: str | None
    hint: str | None


class NoCaptures:
    """The captures of a device that has none, and room for every field; tells what the thread tells them."""

    has_room = True
    is_recording = False

    def __init__(
        self, interrupted: Callable[[GrabberdError], None], source_ended: Callable[[GrabberdError], None]
    ) -> None:
        self.interrupted = interrupted
        self.source_ended = source_ended


class Run:
    """A capture thread over a grabber, from time 0 to `end_s`, in the thread of the test."""

    def __init__(
        self,
        grabber: Grabber,
        clock: SimulatedClock,
        end_s: float,
        interrupted: Callable[[GrabberdError], None] = lambda _: None,
        account: ThreadAccount | None = None,
    ) -> None:
        self.clock = clock
        self.pipeline = FieldPipeline(SMALL)
        self.board = StatusBoard("test", clock)
        self.seen: list[Seen] = []
        self.ended: list[GrabberdError] = []
        self.lost: list[LedgerEntry] = []
        self.taken: list[Slot] = []
        self.beats_s: list[float] = []
        self._enter, self._count = self.board.enter, self.board.count
        self.board.beat = lambda: self.beats_s.append(clock.passed_s)  # type: ignore[method-assign]
        self.board.enter = self._noted  # type: ignore[method-assign]
        self.board.count = self._counted  # type: ignore[method-assign]
        captures = NoCaptures(interrupted, self.ended.append)
        stopping = Until(clock, end_s)
        CaptureThread("test", grabber, self.pipeline, self.board, clock, captures, stopping, account).run()

    def _noted(self, state: DeviceState, *words: Any) -> None:
        self._enter(state, *words)
        now = self.board.now
        if not self.seen or self.seen[-1].state is not state:
            self.seen.append(Seen(round(self.clock.passed_s, 3), state, now.cause, now.hint))

    def _counted(self, slot: Slot) -> None:
        self._count(slot)
        self.lost += slot.lost_before
        self.taken.append(slot)

    @property
    def states(self) -> list[DeviceState]:
        return [one.state for one in self.seen]

    def first(self, state: DeviceState, after_s: float = 0.0) -> float:
        """When it first came to this state after a time."""
        return next(one.at_s for one in self.seen if one.state is state and one.at_s >= after_s)

    @property
    def recoveries(self) -> dict[str, int]:
        """How often each step was taken."""
        return {str(rung): count for rung, count in self.board.now.recoveries.items()}
