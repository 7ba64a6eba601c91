"""Current status of a device; written by its threads, read by any other.

It includes the fields of the last minute, and whether the capture thread is alive, which is checked from the
event loop.
"""

import logging
from collections import Counter, deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import NamedTuple

from grabberd import runtime
from grabberd.core.field import PAL_HZ
from grabberd.core.ledger import LossCause, Outcome, Rebase, Slot, cause_of_loss
from grabberd.documents.enums import DeviceState, Rung
from grabberd.errors import Cause, DeviceError, GrabberdError, PictureError
from grabberd.instrument.acquisition import Standstill
from grabberd.instrument.acquisition.device import Signal, StreamInfo
from grabberd.instrument.device.recovery import Step
from grabberd.instrument.device.scheduling import Standstills
from grabberd.runtime import UtcClock, iso_utc

KEPT_S = 60
LATELY_S = 10
"""Shorter window, for current losses."""
NOT_WHOLE = frozenset({Outcome.LOST, Outcome.DAMAGED, Outcome.OVERRUN})
_SECOND_NS = 1_000_000_000


class RecentCount(NamedTuple):
    """Number of fields in a window of time: all due ones, and those that are not good."""

    due: int = 0
    lost: int = 0

    @property
    def share(self) -> float:
        """Share of those that are not good; 0 if none was due."""
        return self.lost / self.due if self.due else 0.0


class RecentFields:
    """Counts by the second; written by the capture thread, read by any thread."""

    def __init__(self) -> None:
        self._lock = runtime.lock()
        self._seconds: deque[tuple[int, int, int]] = deque(maxlen=KEPT_S + 1)

    def count(self, now_ns: int, outcome: Outcome, count: int) -> None:
        """Counts fields that were due."""
        second, lost = now_ns // _SECOND_NS, count if outcome in NOT_WHOLE else 0
        with self._lock:
            due = count
            if self._seconds and self._seconds[-1][0] == second:
                _, known_due, known_lost = self._seconds.pop()
                due, lost = known_due + due, known_lost + lost
            self._seconds.append((second, due, lost))

    def within(self, now_ns: int, seconds: int = KEPT_S) -> RecentCount:
        """Counts of the last seconds, at most `KEPT_S`."""
        first = now_ns // _SECOND_NS - seconds
        with self._lock:
            recent = [one for one in self._seconds if one[0] > first]
        return RecentCount(sum(due for _, due, _ in recent), sum(lost for _, _, lost in recent))


log = logging.getLogger(__name__)

_S = DeviceState
STREAMING = frozenset({_S.NO_SIGNAL, _S.READY, _S.CAPTURING})
"""The device delivers fields; a capture can be started."""
_TROUBLED = frozenset({_S.ABSENT, _S.RECOVERING, _S.FAILED})
TRANSITIONS: Mapping[DeviceState, frozenset[DeviceState]] = {
    _S.OPENING: STREAMING | _TROUBLED | {_S.ENDED},
    **{state: (STREAMING - {state}) | _TROUBLED | {_S.ENDED} for state in STREAMING},
    **{state: (_TROUBLED - {state}) | {_S.OPENING, _S.ENDED} for state in _TROUBLED},
    _S.ENDED: frozenset({_S.OPENING}),
}
"""After trouble, a device is first `opening` again: open, but without a field yet.

`absent` and `failed` are retried automatically; `recovering` means that a step of the ladder is in progress.
`ended` is a recording that was played to its end; a real grabber never reaches it.
"""

RATE_S = 2.0
"""Time over which the rate is measured."""
_FEWEST = 5
"""Minimum number of fields over which it is measured."""
STUCK_HINT = "the program is restarted if that lasts; if it comes again, unplug the grabber, then restart"
SILENT_NS = 1_000_000_000
"""Silence after which there is no rate; longer than it takes to notice a stall."""


@dataclass(frozen=True, slots=True)
class DeviceStatus:
    """Status of a device at one moment.

    Attributes:
        state: State in one word.
        since_utc: Time at which it entered this state.
        cause: Cause of the state in a sentence, or None.
        hint: What an operator can do about it, or None.
        code: Machine-readable code of the cause, or None.
        stream: The last granted stream, or None before the first opening.
        signal: Camera signal as the driver reports it.
        outcomes: Number of fields since the daemon started, by outcome.
        losses: Number of those that are not good, by the cause.
        rebases: Number of changes of the base of numbers and times, by kind.
        openings: Number of times that the device has been opened.
        recoveries: Number of times that each step of recovery has been taken.
        last_failure: Failure that caused the last step.
        last_failure_utc: Time since which it has been the last failure.
        refusals: What the device or the system does not permit, in sentences.
    """

    state: DeviceState
    since_utc: str
    cause: str | None = None
    hint: str | None = None
    code: Cause | None = None
    stream: StreamInfo | None = None
    signal: Signal = Signal.UNKNOWN
    outcomes: Counter[Outcome] = field(default_factory=Counter)
    losses: Counter[LossCause] = field(default_factory=Counter)
    rebases: Counter[Rebase] = field(default_factory=Counter)
    openings: int = 0
    recoveries: Counter[Rung] = field(default_factory=Counter)
    last_failure: str | None = None
    last_failure_utc: str | None = None
    refusals: tuple[str, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings for the operator, in sentences."""
        return (*(self.stream.remarks if self.stream else ()), *self.refusals)


class StatusBoard:
    """The status of one device; logs each change of state or cause once.

    Attributes:
        name: Name of the device.
        changed: Condition notified with every change of state.
        standstills: Times for which the program took no fields.
        recent: Fields of the last minute.
    """

    def __init__(self, name: str, clock: UtcClock) -> None:
        self.name = name
        self.changed = runtime.condition()
        self.standstills = Standstills(clock)
        self.recent = RecentFields()
        self._clock = clock
        self._status = DeviceStatus(
            DeviceState.ABSENT, iso_utc(clock.utc_now()), "not opened yet", code=Cause.NOT_OPENED
        )
        self._logged: tuple[DeviceState, str | None] | None = None
        self._beat_ns = clock.now_ns()
        self._stuck_since: str | None = None
        self._refusals: dict[str, tuple[str, ...]] = {}
        self._arrivals_ns: deque[int] = deque(maxlen=_fields(PAL_HZ))

    def beat(self) -> None:
        """Notes that the capture thread is alive; called by itself, in every state of its device."""
        silent_s, self._beat_ns = self.silent_s, self._clock.now_ns()
        if self._stuck_since is not None:
            with self.changed:
                self._stuck_since = None
                self.changed.notify_all()
            log.warning("device %s: the capture thread continues after %.0f s", self.name, silent_s)

    def find_stuck(self) -> None:
        """Notes that the capture thread is stuck, until it beats again."""
        if self._stuck_since is None:
            with self.changed:
                self._stuck_since = iso_utc(self._clock.utc_now())
                self.changed.notify_all()
            log.critical(
                "device %s: the capture thread has not answered for %.0f s; %s",
                self.name,
                self.silent_s,
                STUCK_HINT,
            )

    @property
    def silent_s(self) -> float:
        """Seconds since the last beat of the capture thread."""
        return (self._clock.now_ns() - self._beat_ns) / 1e9

    @property
    def now(self) -> DeviceStatus:
        """The current status, with copies of the counters."""
        with self.changed:
            now = self._status
            if self._stuck_since is not None:
                now = replace(
                    now,
                    state=DeviceState.FAILED,
                    since_utc=self._stuck_since,
                    cause="the capture thread does not answer",
                    hint=STUCK_HINT,
                    code=Cause.CAPTURE_STUCK,
                )
            return replace(
                now,
                outcomes=now.outcomes.copy(),
                losses=now.losses.copy(),
                rebases=now.rebases.copy(),
                recoveries=now.recoveries.copy(),
            )

    @property
    def state(self) -> DeviceState:
        """The state alone."""
        return self._status.state if self._stuck_since is None else DeviceState.FAILED

    @property
    def rate_hz(self) -> float | None:
        """Fields per second over the last `RATE_S`; None while none come."""
        arrivals_ns = list(self._arrivals_ns)  # a copy: the capture thread continues to append
        if len(arrivals_ns) < 2 or self._clock.now_ns() - arrivals_ns[-1] > SILENT_NS:
            return None
        return (len(arrivals_ns) - 1) * 1e9 / max(arrivals_ns[-1] - arrivals_ns[0], 1)

    def enter(
        self, state: DeviceState, cause: str | None = None, hint: str | None = None, code: Cause | None = None
    ) -> None:
        """Changes the state to one that may follow the present one.

        Raises:
            ValueError: It may not; this is a fault of the program.
        """
        with self.changed:
            if not may_follow(self._status.state, state):
                raise ValueError(f"device {self.name}: {state} may not follow {self._status.state}")
            if (state, cause) == (self._status.state, self._status.cause):
                return
            since = iso_utc(self._clock.utc_now())
            self._status = replace(
                self._status, state=state, since_utc=since, cause=cause, hint=hint, code=code
            )
            self.changed.notify_all()
        self._log_change(state, cause, hint)

    def opened(self, stream: StreamInfo) -> None:
        """Notes that the device has been opened and granted this stream."""
        with self.changed:
            known = self._status.warnings
            self._arrivals_ns = deque(maxlen=_fields(stream.rate_hz))  # the rate must not span the gap
            self._status = replace(self._status, stream=stream, openings=self._status.openings + 1)
        self._warn(known)

    def recovers(self, step: Step, error: GrabberdError) -> None:
        """Notes that a step of recovery is about to be taken because of an error."""
        with self.changed:
            self._status.recoveries[step.rung] += 1
            if error.message != self._status.last_failure:
                since = iso_utc(self._clock.utc_now())
                self._status = replace(self._status, last_failure=error.message, last_failure_utc=since)
        self.enter(step.state, error.message, error.hint, cause_of(error))

    def refused(self, what: str, refusal: GrabberdError | None) -> None:
        """Notes why something is not permitted, such as a reset of the device; None if it is."""
        with self.changed:
            known = self._status.warnings
            self._refusals[what] = (f"{refusal.message}; {refusal.hint}",) if refusal else ()
            self._status = replace(self._status, refusals=tuple(chain(*self._refusals.values())))
        self._warn(known)

    def saw_signal(self, signal: Signal) -> None:
        """Notes the camera signal as the driver reports it."""
        with self.changed:
            self._status = replace(self._status, signal=signal)

    def stood_still(self, standstill: Standstill) -> None:
        """Notes that the program took no fields for so long that the driver's buffers were full."""
        if self.standstills.note(standstill):
            hint = self.standstills.hint_of(standstill)
            log.warning("device %s: %s; %s", self.name, standstill.reason, hint)

    def count(self, slot: Slot) -> None:
        """Counts a field, the ones lost before it, and its changes of the base of numbers and times."""
        if slot.outcome is not Outcome.NO_SIGNAL:
            self._arrivals_ns.append(self._clock.now_ns())
        with self.changed:
            self._count(slot.outcome, slot.reason, 1)
            for entry in slot.lost_before:
                self._count(entry.outcome, entry.reason, entry.count)
            self._status.rebases.update(event.kind for event in slot.rebases)
        for event in slot.rebases:
            log.warning("device %s: %s, from field %d on", self.name, event.reason, event.n)

    def _count(self, outcome: Outcome, reason: str | None, count: int) -> None:
        self.recent.count(self._clock.now_ns(), outcome, count)
        self._status.outcomes[outcome] += count
        if outcome is not Outcome.RECEIVED:
            self._status.losses[cause_of_loss(outcome, reason or "")] += count

    def _log_change(self, state: DeviceState, cause: str | None, hint: str | None) -> None:
        """Logs a new state or cause: a device that is retried is logged once per cause."""
        if state is DeviceState.OPENING or (state, cause) == self._logged:
            return
        self._logged = (state, cause)
        reason = "; ".join(part for part in (cause, hint) if part)
        log.log(_level(state), "device %s is %s%s", self.name, state, f": {reason}" if reason else "")

    def _warn(self, known: tuple[str, ...]) -> None:
        for warning in self._status.warnings:
            if warning not in known:
                log.warning("device %s: %s", self.name, warning)


def _fields(rate_hz: float) -> int:
    """Number of fields over which a rate is measured."""
    return max(round(RATE_S * rate_hz), _FEWEST)


def may_follow(current: DeviceState, following: DeviceState) -> bool:
    """True if `following` may come after `current`; staying is always allowed."""
    return following is current or following in TRANSITIONS[current]


def cause_of(error: GrabberdError) -> Cause | None:
    """Cause code of an error of a device or of a replayed recording; None for any other."""
    if isinstance(error, PictureError):
        return Cause.RECORDING_DAMAGED
    return error.cause if isinstance(error, DeviceError) else None


def _level(state: DeviceState) -> int:
    return logging.WARNING if state in _TROUBLED else logging.INFO


STUCK_AFTER_S = 5.0
"""Silence after which a thread that takes fields is stuck: it beats fifty times per second."""
SLOW_AFTER_S = 15.0
"""The same while a device is opened or reset, which may take ten seconds. Also the silence after which the
daemon must be restarted, unless systemd's watchdog is shorter."""
_IN_TIME_S = 2.5
"""Pause between two checks after which the whole program may have been stopped, not only a thread."""


class Liveness:
    """Finds capture threads that are stuck: in the kernel's driver, or in the program.

    The threads beat in every state of their devices.

    Args:
        boards: Status of each device.

    Attributes:
        restart_after_s: Silence of a thread after which the daemon must be restarted.
        silent: Devices whose threads have been silent for that long.
    """

    def __init__(self, boards: Iterable[StatusBoard]) -> None:
        self.boards = tuple(boards)
        self.restart_after_s = SLOW_AFTER_S
        self._looked_s: float | None = None
        self._excused = False
        self.silent: tuple[str, ...] = ()

    def look(self, now_s: float) -> None:
        """Checks every thread; called about once a second.

        Args:
            now_s: Time of a monotonic clock.
        """
        before_s, self._looked_s = self._looked_s, now_s
        late = before_s is not None and now_s - before_s > _IN_TIME_S
        # Only once: even an event loop that is always late must find stuck threads.
        self._excused = late and not self._excused
        if self._excused:
            return
        for board in self.boards:
            if board.silent_s > _limit_s(board):
                board.find_stuck()
        self._judge()

    @property
    def is_well(self) -> bool:
        """False if the daemon must be restarted now; it is not restarted while another device records."""
        return not self.silent or self._another_records()

    def _judge(self) -> None:
        limit_s = self.restart_after_s
        silent = tuple(board.name for board in self.boards if board.silent_s > limit_s)
        if silent and silent != self.silent:
            log.critical(
                "the capture thread of %s has not beaten for %.0f s: the watchdog may restart the daemon, "
                "when no other device records",
                " and ".join(silent),
                limit_s,
            )
        self.silent = silent

    def _another_records(self) -> bool:
        others = (board for board in self.boards if board.name not in self.silent)
        return any(board.state is DeviceState.CAPTURING for board in others)


def _limit_s(board: StatusBoard) -> float:
    return STUCK_AFTER_S if board.state in STREAMING else SLOW_AFTER_S
