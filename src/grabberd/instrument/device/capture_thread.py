"""The only thread that uses a device: opens it, takes its fields, and recovers it when none come."""

import logging
import math
from collections.abc import Callable, Iterable
from typing import Protocol

from grabberd import runtime
from grabberd.core.ledger import NO_SIGNAL, Slot
from grabberd.documents.enums import DeviceState, Rung
from grabberd.errors import (
    Cause,
    DeviceError,
    DeviceRefused,
    GrabberdError,
    PictureError,
    StreamEnded,
    StreamFailed,
)
from grabberd.instrument.acquisition.device import Grabber, Signal, StreamInfo
from grabberd.instrument.acquisition.numbering.standstill import Standstill
from grabberd.instrument.device.field_pipeline import FieldPipeline
from grabberd.instrument.device.recovery import Failure, FaultLog, Ladder, Step, reason_of, trouble_of
from grabberd.instrument.device.scheduling import Scheduling, ThreadAccount
from grabberd.instrument.device.status_board import StatusBoard, cause_of
from grabberd.runtime import UtcClock

log = logging.getLogger(__name__)

DEQUEUE_TIMEOUT_S = 0.05
"""Longest wait for a field, unless two field periods are longer; also the longest delay of a stop."""
TIMEOUT_PERIODS, STALLED_PERIODS = 2.5, 5.0
"""For a slow camera, in periods: wait for a field, and silence after which the stream has failed."""
STALLED_AFTER_S = 0.8
"""Silence after which the stream has failed."""
SIGNAL_EVERY_NS = 500_000_000
"""Time between queries of the signal, made between fields, since only this thread may use the device."""
SIGNAL_WAIT = 20
"""Least time between queries, in durations of the last one: a decoder that no longer answers holds the thread
for seconds, in which no field is taken."""
POLL_S = 0.001
"""Pause if there is no room for a field, or if a device immediately reports that it has none."""
MOST_POLLS = 5
"""Maximum number of pauses after a field: four fields are taken in one field period."""
LESS_WORK = (
    "a smaller picture or a lower rate takes less; until a restart, fields may be lost on a busy computer"
)
BEAT_EVERY_S = 1.0
"""Far below half the watchdog's time, after which the heartbeat considers this thread stuck."""


class ThreadCaptures(Protocol):
    """The captures of a device, as seen by its capture thread."""

    @property
    def has_room(self) -> bool:
        """True if a source that waits for its reader may deliver another field."""
        ...

    @property
    def is_recording(self) -> bool:
        """True if a capture is recording."""
        ...

    def interrupted(self, error: GrabberdError) -> None:
        """Called whenever fields fail to come."""
        ...

    def source_ended(self, error: GrabberdError) -> None:
        """Called when the previous stream is over: a recording has ended, or a device grants different
        pictures.
        """
        ...


class FieldFlow:
    """Times of the first and the newest field since the last step of recovery, in ns of the clock."""

    def __init__(self, now_ns: int) -> None:
        self._first_ns: int | None = None
        self._newest_ns = now_ns

    @property
    def flowed_s(self) -> float:
        """Seconds for which fields came."""
        return 0.0 if self._first_ns is None else (self._newest_ns - self._first_ns) / 1e9

    def came(self, now_ns: int) -> None:
        """Notes that a field has come."""
        self._first_ns = now_ns if self._first_ns is None else self._first_ns
        self._newest_ns = now_ns

    def excuse(self, now_ns: int) -> None:
        """Notes that silence was expected until now."""
        self._newest_ns = max(self._newest_ns, now_ns)

    def silent_s(self, now_ns: int) -> float:
        """Seconds since the newest field, or since the last excuse."""
        return (now_ns - self._newest_ns) / 1e9


class CaptureThread(runtime.Thread):
    """Opens the device, takes its fields into the ring, and climbs the ladder when they fail to come.

    It requests real-time scheduling as soon as a camera streams.
    It never waits for other threads, except with a source that waits for its reader, which is read only while
    there is room. All other waits are on `stopping`, which `stop` sets. It beats on the board as long as it
    runs.
    """

    def __init__(
        self,
        name: str,
        grabber: Grabber,
        pipeline: FieldPipeline,
        board: StatusBoard,
        clock: UtcClock,
        captures: ThreadCaptures,
        stopping: runtime.Event | None = None,
        account: ThreadAccount | None = None,
    ) -> None:
        super().__init__(name=f"capture-{name}", daemon=True)
        self._grabber = grabber
        self._pipeline = pipeline
        self._board = board
        self._clock = clock
        self._captures = captures
        self._stopping = stopping or runtime.event()
        self._open = False
        self._flow = FieldFlow(clock.now_ns())
        self._account = account or ThreadAccount()
        self._scheduling = Scheduling(clock, self._account, lambda: grabber.called_ns)
        self._asked_to_come_first = False
        self._returned_ns: int | None = None
        self._signal_due_ns = 0
        self._timeout_s, self._stalled_s = DEQUEUE_TIMEOUT_S, STALLED_AFTER_S
        self._signal = Signal.UNKNOWN
        self._faults = FaultLog(log, f"device {name}: the capture thread failed")
        self._take_step: dict[Rung, Callable[[], StreamInfo]] = {
            Rung.RESTART: grabber.restart,
            Rung.REOPEN: self._reopen,
            Rung.RESET: self._reset,
            Rung.RETRY: self._reopen,
        }

    def stop(self) -> None:
        """Ends the thread within a dequeue's time-out; the device is closed."""
        self._stopping.set()

    def run(self) -> None:
        """Streams and recovers until stopped."""
        self._board.enter(DeviceState.OPENING)
        ladder, rung = Ladder(), Rung.REOPEN
        try:
            while (error := self._until_it_fails(rung)) is not None:
                failure = Failure(trouble_of(error), self._open, self._flow.flowed_s)
                ladder, step = ladder.next(failure, self._clock.now_ns())
                self._prepare(step, error)
                rung = step.rung
        finally:
            self._close()

    def _until_it_fails(self, rung: Rung) -> GrabberdError | None:
        """Performs a step, then takes fields; returns why no more come, or None when it is stopped."""
        asked_ns = self._clock.now_ns()
        self._flow = FieldFlow(asked_ns)
        self._board.beat()
        try:
            if not self._stopping.is_set():
                self._stream(self._take_step[rung](), asked_ns)
        except (StreamEnded, PictureError) as error:
            self._ended(error)
        except DeviceError as error:
            return error
        except Exception as error:
            return self._faults.refusal(error)
        return None

    def _prepare(self, step: Step, error: GrabberdError) -> None:
        self._interrupted(reason_of(error))
        self._captures.interrupted(error)
        self._board.recovers(step, error)
        if step.rung is not Rung.RESTART:
            self._close()  # before the wait: an open device cannot come back under its old name
        self._wait(step.wait_s)

    def _interrupted(self, reason: str) -> None:
        """Keeps the first reason: later ones are only its consequences."""
        if self._pipeline.interruption is None:
            self._count(self._pipeline.interrupted(reason))

    def _count(self, slots: Iterable[Slot]) -> None:
        for slot in slots:
            self._board.count(slot)

    def _close(self) -> None:
        self._grabber.close()
        self._open = False

    def _reopen(self) -> StreamInfo:
        self._close()
        info = self._grabber.open()
        self._open = True
        return info

    def _reset(self) -> StreamInfo:
        self._close()
        try:
            self._grabber.reset()
            self._board.refused("reset", None)
        except DeviceRefused as refusal:
            # Reopened anyway: that may help where a reset is not permitted.
            self._board.refused("reset", refusal)
        return self._reopen()

    def _stream(self, info: StreamInfo, asked_ns: int) -> None:
        self._opened(info, asked_ns)
        while not self._stopping.is_set():
            self._take(info)

    def _opened(self, info: StreamInfo, asked_ns: int) -> None:
        self._board.enter(DeviceState.OPENING)
        change = self._pipeline.opened(info, asked_ns)
        self._board.opened(info)
        if change:
            log.warning("device %s: %s", self._board.name, change)
            self._captures.source_ended(DeviceRefused(change, "begin a new capture"))
        self._timeout_s = max(DEQUEUE_TIMEOUT_S, TIMEOUT_PERIODS / info.rate_hz)
        self._stalled_s = max(STALLED_AFTER_S, STALLED_PERIODS / info.rate_hz)
        self._scheduling.paced(info.rate_hz)
        # The time of opening does not count as silence of the stream.
        self._scheduling.excuse()
        self._flow = FieldFlow(self._clock.now_ns())
        self._ask_signal()
        if info.live:
            self._come_first()
        if info.waits_for_reader:
            self._show_state()  # it delivers nothing until a capture runs, and a capture needs it ready

    def _come_first(self) -> None:
        """Requests real time once; for a recording it would take the processors from everything else."""
        if self._asked_to_come_first:
            return
        self._asked_to_come_first = True
        try:
            if how := self._account.come_first():
                log.info("device %s: fields are taken %s", self._board.name, how)
        except DeviceRefused as refusal:
            self._board.refused("real time", refusal)

    def _keep_to_share(self, now_ns: int) -> None:
        if how := self._account.keep_to_share(now_ns):
            self._board.refused("real time", DeviceRefused(f"fields are taken {how}", LESS_WORK))

    def _take(self, info: StreamInfo) -> None:
        self._board.beat()
        if info.waits_for_reader and not self._captures.has_room:
            self._flow.excuse(self._clock.now_ns())
            self._scheduling.excuse()
            self._show_state()
            self._stopping.wait(POLL_S)
            return
        asked_ns = self._scheduling.asks()
        with self._grabber.dequeue(self._timeout_s) as fields:
            now_ns = self._clock.now_ns()
            standstill = self._stood_still(info, now_ns, len(fields))
            self._pipeline.shedding.saw(0 if standstill is None else standstill.time_ns, now_ns)
            if fields and self._signal is Signal.ABSENT:
                self._ask_signal()  # the last answer may be half a second old
            if standstill is not None and standstill.time_ns > info.buffered_ns:
                self._board.stood_still(standstill)
            for grabbed in fields:
                in_time, returned_ns = self._scheduling.was_in_time, self._returned_ns
                slots = self._pipeline.take(
                    grabbed, self._signal, now_ns, standstill, in_time=in_time, returned_ns=returned_ns
                )
                self._count(slots)
                standstill = None
        self._returned_ns = self._clock.now_ns() if fields else self._returned_ns
        if now_ns >= self._signal_due_ns:
            self._ask_signal()
            self._keep_to_share(now_ns)
        if fields:
            self._came(now_ns)
            self._leave_room()
        elif info.live or info.waits_for_reader:  # a recording at its own pace may pause
            self._nothing_came(asked_ns, now_ns)

    def _stood_still(self, info: StreamInfo, now_ns: int, fields: int) -> Standstill | None:
        """Cause for which these fields were taken late, if others may be lost by that; else None."""
        standstill = self._scheduling.came(
            now_ns, self._timeout_s, fields, found_empty=self._grabber.found_empty
        )
        # What a recording lacks was lost before, however late it is read.
        return standstill if info.live and not info.waits_for_reader else None

    def _came(self, now_ns: int) -> None:
        self._flow.came(now_ns)
        if self._pipeline.ring.newest is not None:  # the first fields of a stream wait for their numbers
            self._show_state()

    def _leave_room(self) -> None:
        """Lets other threads run while waiting fields are taken faster than they came.

        Otherwise a thread in real time would keep the driver's threads off a slow processor, and overwrite
        slots that no reader had time to read. The driver's buffers hold the fields that come meanwhile.
        """
        ring = self._pipeline.ring
        for _ in range(MOST_POLLS):
            if self._grabber.found_empty or self._stopping.is_set():
                return
            self._stopping.wait(POLL_S)
            if ring.waiting <= ring.slots // 2:
                return

    def _nothing_came(self, asked_ns: int, now_ns: int) -> None:
        """Handles an empty dequeue.

        Many grabbers deliver nothing without a camera; that is not a failure.

        Raises:
            StreamFailed: The stream has stalled.
        """
        if now_ns - asked_ns < self._timeout_s * 0.5e9:
            self._stopping.wait(POLL_S)  # a device that does not wait must not take a processor in real time
        if self._signal is Signal.ABSENT:
            self._flow.excuse(now_ns)
            self._interrupted(NO_SIGNAL)
            self._show_state()
        # Silence counts until the empty dequeue began, not until now: else a computer that was stopped for
        # a second would look like a grabber that was.
        elif self._flow.silent_s(asked_ns) > self._stalled_s - self._timeout_s:
            raise StreamFailed(
                f"no field for {self._stalled_s:g} s", "if it stays, check camera, cable and port"
            )

    def _ask_signal(self) -> None:
        asked_ns = self._clock.now_ns()
        self._signal = self._grabber.signal()
        took_ns = self._clock.now_ns() - asked_ns
        self._signal_due_ns = asked_ns + max(SIGNAL_EVERY_NS, SIGNAL_WAIT * took_ns)
        self._board.saw_signal(self._signal)

    def _show_state(self) -> None:
        if self._signal is Signal.ABSENT:
            self._board.enter(DeviceState.NO_SIGNAL, "no camera signal", None, Cause.NO_SIGNAL)
        elif generated := self._pipeline.no_picture:
            self._board.enter(DeviceState.NO_SIGNAL, generated, None, Cause.NO_PICTURE)
        else:
            self._board.enter(self._state())

    def _state(self) -> DeviceState:
        return DeviceState.CAPTURING if self._captures.is_recording else DeviceState.READY

    def _ended(self, error: GrabberdError) -> None:
        self._count(self._pipeline.settle())
        self._board.enter(DeviceState.ENDED, error.message, error.hint, cause_of(error))
        self._captures.source_ended(error)
        self._wait(math.inf)  # the thread keeps running, since the heartbeat checks it

    def _wait(self, seconds: float) -> None:
        """Waits for a time or until stopped, and beats meanwhile."""
        end_ns = self._clock.now_ns() + seconds * 1e9
        while (left_s := (end_ns - self._clock.now_ns()) / 1e9) > 0:
            if self._stopping.wait(min(left_s, BEAT_EVERY_S)):
                return
            self._board.beat()
