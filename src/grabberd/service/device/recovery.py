"""What is done about a grabber that delivers no more: which step is next, and how long to wait before it.

Nothing here touches a device or a clock. `Ladder.next` says what to do; the capture thread does it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

from grabberd.documents.states import Rung
from grabberd.errors import DeviceAbsent, DeviceLost, GrabberdError, StreamFailed
from grabberd.service.device.device_state import DeviceState


class Trouble(StrEnum):
    """What is wrong, as far as it matters for what to do."""

    STREAM = "stream"
    """It is there, but nothing comes."""
    ABSENT = "absent"
    """It is not there."""
    REFUSED = "refused"
    """It is there and says no: a person has to act."""


class BackOff(NamedTuple):
    """Waits that double each time."""

    first_s: float
    longest_s: float

    def wait_s(self, times: int) -> float:
        """The wait after so many of them."""
        return min(self.longest_s, self.first_s * 2.0 ** min(times, 30))


RUNGS: Mapping[tuple[Trouble, bool], tuple[Rung, ...]] = {
    (Trouble.STREAM, True): (Rung.RESTART, Rung.REOPEN, Rung.RESET),
    (Trouble.STREAM, False): (Rung.REOPEN, Rung.RESET),
    (Trouble.ABSENT, True): (Rung.REOPEN,),
    (Trouble.ABSENT, False): (),
    (Trouble.REFUSED, True): (Rung.REOPEN,),
    (Trouble.REFUSED, False): (),
}
"""What helps against a trouble of a device that is open or not; after these it is tried again, with back-off.
"""

RETRIES: Mapping[Trouble, BackOff] = {
    Trouble.STREAM: BackOff(0.5, 2.0),
    Trouble.ABSENT: BackOff(0.25, 1.0),
    Trouble.REFUSED: BackOff(0.5, 10.0),
}
RESETS = BackOff(60.0, 3600.0)
"""Between two resets: each may cost the other devices of its bus their streams."""

PROVEN_S = 10.0
"""Fields that came for so long mean that the last step has helped."""

LINK_S = 10.0
"""How long a device may take to come back after its reset."""

STATES: Mapping[Trouble, DeviceState] = {
    Trouble.STREAM: DeviceState.FAILED,
    Trouble.ABSENT: DeviceState.ABSENT,
    Trouble.REFUSED: DeviceState.FAILED,
}
"""What a device is called while it is tried again; while it is helped it is recovering."""


class Failure(NamedTuple):
    """What the ladder has to know of a failure.

    Attributes:
        trouble: of what sort it is.
        is_open: whether the device is still open.
        flowed_s: for how long fields had come since the step before; 0 where none came.
    """

    trouble: Trouble
    is_open: bool
    flowed_s: float


class Step(NamedTuple):
    """What to do, after which wait, and what the device is called until then."""

    rung: Rung
    wait_s: float
    state: DeviceState


@dataclass(frozen=True, slots=True)
class Ladder:
    """Where a recovery stands; the ladder is left only when fields have come for `PROVEN_S`.

    So a grabber that delivers a field after each restart climbs on, and does not stay on the first rung.

    Attributes:
        trouble: the last one.
        tried: the rungs that were taken since fields had come for long.
        retries: how often it has been tried again with back-off against this trouble.
        resets: how often it has been reset since fields had come for long.
        reset_ns: when it was reset last.
    """

    trouble: Trouble | None = None
    tried: frozenset[Rung] = frozenset()
    retries: int = 0
    resets: int = 0
    reset_ns: int | None = None

    def next(self, failure: Failure, now_ns: int) -> tuple["Ladder", Step]:
        """The next step, and where the recovery then stands."""
        ladder = Ladder(reset_ns=self.reset_ns) if failure.flowed_s >= PROVEN_S else self
        ladder = ladder._facing(failure.trouble, now_ns)
        rung = ladder._rung(failure.is_open, now_ns)
        return ladder._after(rung, now_ns), ladder._step(rung, now_ns)

    def _facing(self, trouble: Trouble, now_ns: int) -> "Ladder":
        # After a reset the device is away for a moment, and there before its rights are.
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
    """Of what sort an error is."""
    if isinstance(error, StreamFailed):
        return Trouble.STREAM
    return Trouble.ABSENT if isinstance(error, DeviceLost | DeviceAbsent) else Trouble.REFUSED


def reason_of(error: GrabberdError) -> str:
    """What the ledger calls the fields that an error costs."""
    return "unplugged" if trouble_of(error) is Trouble.ABSENT else error.message
