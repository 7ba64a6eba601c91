"""Recovery of a grabber that stops delivering: the next step, and the wait before it.

Nothing here uses a device or a clock. `Ladder.next` decides what to do; the capture thread does it.
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

from grabberd.documents.enums import DeviceState, Rung
from grabberd.errors import Cause, DeviceAbsent, DeviceLost, DeviceRefused, GrabberdError, StreamFailed


class Trouble(StrEnum):
    """Kinds of failure that require different steps."""

    STREAM = "stream"
    """The device is connected, but delivers nothing."""
    ABSENT = "absent"
    """The device is not connected."""
    REFUSED = "refused"
    """The device is connected, but refuses: a person has to act."""


class BackOff(NamedTuple):
    """Waits that double each time, up to the longest."""

    first_s: float
    longest_s: float

    def wait_s(self, times: int) -> float:
        """The wait after this many waits."""
        # The exponent is limited: a device may be absent for months, and 2.0 ** 1024 overflows.
        return min(self.longest_s, self.first_s * 2.0 ** min(times, 30))


RUNGS: Mapping[tuple[Trouble, bool], tuple[Rung, ...]] = {
    (Trouble.STREAM, True): (Rung.RESTART, Rung.REOPEN, Rung.RESET),
    (Trouble.STREAM, False): (Rung.REOPEN, Rung.RESET),
    (Trouble.ABSENT, True): (Rung.REOPEN,),
    (Trouble.ABSENT, False): (),
    (Trouble.REFUSED, True): (Rung.REOPEN,),
    (Trouble.REFUSED, False): (),
}
"""Steps against each trouble of a device that is open, or not; after them it is retried with back-off.
"""

# An absent device may be plugged in at any moment; a refusal ends only when somebody acts on it.
RETRIES: Mapping[Trouble, BackOff] = {
    Trouble.STREAM: BackOff(0.5, 2.0),
    Trouble.ABSENT: BackOff(0.25, 1.0),
    Trouble.REFUSED: BackOff(0.5, 10.0),
}
RESETS = BackOff(60.0, 3600.0)
"""Waits between two resets: each may interrupt the streams of other devices on its bus."""

PROVEN_S = 10.0
"""Time of delivery that proves that the last step has helped."""

LINK_S = 10.0
"""Time that a device may take to come back after its reset."""

STATES: Mapping[Trouble, DeviceState] = {
    Trouble.STREAM: DeviceState.FAILED,
    Trouble.ABSENT: DeviceState.ABSENT,
    Trouble.REFUSED: DeviceState.FAILED,
}
"""State of a device while it is retried; while a step of `RUNGS` is taken it is recovering."""


class Failure(NamedTuple):
    """A failure, as seen by the ladder.

    Attributes:
        trouble: Kind of failure.
        is_open: True if the device is still open.
        flowed_s: Seconds for which fields had come since the last step; 0 if none came.
    """

    trouble: Trouble
    is_open: bool
    flowed_s: float


class Step(NamedTuple):
    """The next step of a recovery.

    Attributes:
        rung: The step to take.
        wait_s: Wait before it.
        state: State of the device until then.
    """

    rung: Rung
    wait_s: float
    state: DeviceState


@dataclass(frozen=True, slots=True)
class Ladder:
    """Progress of a recovery; the ladder is left only when fields have come for `PROVEN_S`.

    So a grabber that delivers one field after each restart does not stay on the first rung.

    Attributes:
        trouble: The last trouble.
        tried: Rungs taken since fields last came for `PROVEN_S`.
        retries: Number of retries with back-off against this trouble.
        resets: Number of resets since fields last came for `PROVEN_S`.
        reset_ns: Time of the last reset.
    """

    trouble: Trouble | None = None
    tried: frozenset[Rung] = frozenset()
    retries: int = 0
    resets: int = 0
    reset_ns: int | None = None

    def next(self, failure: Failure, now_ns: int) -> tuple["Ladder", Step]:
        """The ladder after the next step, and that step."""
        ladder = Ladder(reset_ns=self.reset_ns) if failure.flowed_s >= PROVEN_S else self
        ladder = ladder._facing(failure.trouble, now_ns)
        rung = ladder._rung(failure.is_open, now_ns)
        return ladder._after(rung, now_ns), ladder._step(rung, now_ns)

    def _facing(self, trouble: Trouble, now_ns: int) -> "Ladder":
        # After a reset the device disappears for a moment, and udev sets its permissions when it is back.
        if trouble is Trouble.REFUSED and self._waits_for_link(now_ns):
            trouble = Trouble.ABSENT
        return self if trouble is self.trouble else replace(self, trouble=trouble, retries=0)

    def _rung(self, is_open: bool, now_ns: int) -> Rung:
        assert self.trouble is not None
        rungs = RUNGS[self.trouble, is_open]
        return next((rung for rung in rungs if self._may_take(rung, now_ns)), Rung.RETRY)

    def _may_take(self, rung: Rung, now_ns: int) -> bool:
        if rung is not Rung.RESET:
            return rung not in self.tried
        return self._since_reset_s(now_ns) >= RESETS.wait_s(max(self.resets - 1, 0))

    def _step(self, rung: Rung, now_ns: int) -> Step:
        assert self.trouble is not None
        if rung is not Rung.RETRY:
            return Step(rung, 0.0, DeviceState.RECOVERING)
        state = DeviceState.RECOVERING if self._waits_for_link(now_ns) else STATES[self.trouble]
        return Step(rung, RETRIES[self.trouble].wait_s(self.retries), state)

    def _after(self, rung: Rung, now_ns: int) -> "Ladder":
        if rung is Rung.RETRY:
            return replace(self, retries=self.retries + 1)
        if rung is Rung.RESET:
            return replace(self, resets=self.resets + 1, reset_ns=now_ns)
        return replace(self, tried=self.tried | {rung})

    def _since_reset_s(self, now_ns: int) -> float:
        return float("inf") if self.reset_ns is None else (now_ns - self.reset_ns) / 1e9

    def _waits_for_link(self, now_ns: int) -> bool:
        return self.trouble is not Trouble.STREAM and self._since_reset_s(now_ns) < LINK_S


def trouble_of(error: GrabberdError) -> Trouble:
    """Kind of failure of an error."""
    if isinstance(error, StreamFailed):
        return Trouble.STREAM
    return Trouble.ABSENT if isinstance(error, DeviceLost | DeviceAbsent) else Trouble.REFUSED


def reason_of(error: GrabberdError) -> str:
    """Reason in the ledger for the fields lost by an error."""
    return "unplugged" if trouble_of(error) is Trouble.ABSENT else error.message


class FaultLog:
    """Logs faults of the program in a thread that retries forever, without filling the journal by tracebacks.

    Args:
        log: Receives the entries.
        what: What failed, in words.
    """

    def __init__(self, log: logging.Logger, what: str) -> None:
        self._log, self._what = log, what
        self._last: str | None = None

    def refusal(self, fault: Exception) -> DeviceRefused:
        """The error for the fault being handled: its device is retried like one that refuses."""
        message = f"{type(fault).__name__}: {fault}"
        if message != self._last:
            self._last = message
            self._log.exception(self._what)
        return DeviceRefused(message, "please report this", Cause.FAULT)
