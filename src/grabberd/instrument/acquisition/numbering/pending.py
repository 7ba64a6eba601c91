"""Fields whose numbers are not settled yet, and the first fields of a stream.

Those of a stream that begins are kept back until it is known how late the first one was: there is nothing to
compare it with.
"""

import math
from dataclasses import dataclass, replace
from statistics import median
from typing import Self

from grabberd.core.ledger import NO_SIGNAL, UNCERTAIN, Outcome
from grabberd.instrument.acquisition.device import StreamInfo
from grabberd.instrument.acquisition.numbering.arrivals import Arrival, Arrivals, Way
from grabberd.instrument.acquisition.numbering.pace import Pace
from grabberd.instrument.acquisition.numbering.paths import Paths, Seen, Step
from grabberd.instrument.acquisition.numbering.standstill import Standstill


@dataclass(frozen=True, slots=True)
class Pending:
    """A field that waits for more evidence.

    Attributes:
        parity: Of the field; `phase`: the same, or None if all have one parity.
        stamp_ns: Its timestamp; `time_ns`: the time that it means, or None if it is not believed.
        doubt: Why it is not believed, or None.
        arrival: Its arrival; `stamped_on_arrival`: true if the time may be that of the arrival.
        sequence: The driver's number of it, or None.
        count: Fields since the previous one by the driver's count; None if unknown.
        recounted: True if that count has restarted.
        outcome, reason: Its outcome and the reason, as known without its number.
        no_signal: True if the driver reports no camera.
        in_time: False if the program has reason to believe that it waited in the driver's buffers.
        may_have_waited: Number of fields for which it may have waited in the driver's buffers, after an
            interruption.
        interruption: Why the stream stopped before it, or None.
        standstill: Why the driver's buffers may have been full before it, or None.
        of_driver: Standstills shortly before it in which the driver may have stood still as well, the latest
            first.
        may_be_held: True if that was right before it.
    """

    parity: int
    phase: int | None
    stamp_ns: int
    time_ns: int | None
    doubt: str | None
    arrival: Arrival
    stamped_on_arrival: bool
    sequence: int | None
    count: int | None
    recounted: bool
    outcome: Outcome
    reason: str | None
    no_signal: bool
    in_time: bool
    may_have_waited: int
    interruption: str | None
    standstill: str | None
    of_driver: tuple[Standstill, ...] = ()
    may_be_held: bool = False

    def overcounts(self, fields: int) -> bool:
        """True if the driver has counted more fields since the previous one than there were."""
        return self.count is not None and self.interruption is None and self.count > fields

    def seen(self, stamp: float | None, arrival: float | None) -> Seen:
        """Its evidence, with its stamp and its arrival in periods."""
        return Seen(
            stamp,
            arrival,
            self.stamped_on_arrival,
            self.arrival.burst,
            self.arrival.joined,
            self.count,
            self.phase,
            self.interruption is not None,
            not self.in_time,
        )

    def damaged(self, reason: str) -> Self:
        """The same, damaged for this reason, unless it is not good anyway."""
        if self.outcome is not Outcome.RECEIVED:
            return self
        return replace(self, outcome=Outcome.DAMAGED, reason=reason)

    def uncertain(self, fields: int) -> Self:
        """The same with a number that may be off by so many; other problems are mentioned after that."""
        reason = f"{UNCERTAIN} {fields}"
        outcome = Outcome.DAMAGED if self.outcome is Outcome.RECEIVED else self.outcome
        return replace(self, outcome=outcome, reason=f"{reason}; {self.reason}" if self.reason else reason)


def outcome_of(no_signal: str | None, damage: str | None) -> tuple[Outcome, str | None]:
    """Outcome of a field, and its reason, as reported by the driver and the content check."""
    if no_signal:
        return Outcome.NO_SIGNAL, no_signal
    if damage and damage.startswith(NO_SIGNAL):  # as reported by a recording
        return Outcome.NO_SIGNAL, damage
    if damage:
        return Outcome.DAMAGED, damage
    return Outcome.RECEIVED, None


_LATE = 0.75
"""Delay in periods with which a field may arrive without having waited."""


def uncounted(pending: Pending, step: Step) -> int:
    """Number of fields lost before one that the driver has not counted."""
    if pending.interruption:
        return 0
    return abs(step.fields - (1 if pending.count is None else pending.count))


def is_held_up(pending: Pending, step: Step) -> bool:
    """True if a field came late although the program waited for it."""
    return pending.in_time and step.arrived is not None and step.arrived > _LATE


def contradiction(pending: Pending, step: Step) -> int:
    """Number of fields by which evidence differs: stamp and count, if no arrival shows which is wrong,
    or after an interruption the stamp and the arrival of a field that has not waited.
    """
    if pending.interruption:
        return math.ceil(step.arrived or 0.0) if is_held_up(pending, step) else 0
    if pending.count is None or step.arrived_in_time:
        return 0
    return abs(pending.count - step.fields)


_FIRST_LATE = 0.75
"""Maximum delay of the first stamp, in periods, beyond which the stream begins with a better one."""
_AT_ONCE = 1.5
"""Periods after the request during which a first field cannot have waited."""
_MARGIN = 1
"""Fields that may be exposed while a stream begins, in addition to those in the driver's buffers."""


class StreamStart:
    """The first fields of a stream, held until it is known how late the first one was.

    A stamp may be the time of an arrival, and on an overloaded computer every field waits for a different
    time. The delay is known once stamps come regularly, or single fields come by the same shortest way; or
    once stamps vary against the arrivals, since they are then those of exposures.

    Args:
        info: The stream as granted.
        arrivals: Those of the stream.
        since_ns: When the stream was requested: nothing was exposed before. None if unknown.
        most: Maximum number of fields that are held.
        pace: Of the camera.

    Attributes:
        fields: The held fields, the first of the stream first.
    """

    def __init__(
        self, info: StreamInfo, arrivals: Arrivals, since_ns: int | None, most: int, pace: Pace
    ) -> None:
        self._pace = pace
        self._waits = info.live and not info.waits_for_reader
        self._arrivals = arrivals
        self._paths = Paths(None, Way())
        self._since_ns = since_ns
        self._buffered = info.buffers
        self._most = most
        self.fields: list[Pending] = []

    def add(self, pending: Pending) -> None:
        """Hold the next field."""
        self.fields.append(pending)
        if len(self.fields) == 1:
            arrival = self._steps_to(pending.arrival.time_ns)
            way = Way() if arrival is None else Way().after(arrival)
            self._paths = Paths(pending.phase, way, exact=not self._waits)
        else:
            stamp, arrival = self._steps_to(pending.time_ns), self._steps_to(pending.arrival.time_ns)
            self._paths.see(pending.seen(stamp, arrival))

    @property
    def is_over(self) -> bool:
        """True if the delay is known, or the fields have waited as long as allowed."""
        return self.is_known or len(self.fields) > self._most

    @property
    def is_known(self) -> bool:
        """True if it is known how late the first field was."""
        if not self._waits or self.fields[0].arrival.time_ns is None or self._arrivals.tells_of_stamps:
            return True
        return self._longest_wait < _AT_ONCE or self._paths.best.way.is_known or self._stamps_are_regular

    @property
    def _stamps_are_regular(self) -> bool:
        """True if stamps are on the grid of the rate: then no fields have waited, however they arrived."""
        regular = Way().after(0.0)
        for field, step in zip(self.fields[1:], self._paths.best.steps, strict=True):
            if step.late is None:
                return False
            regular = regular.after(step.late, joined=field.arrival.joined)
        return regular.is_known

    @property
    def late_ns(self) -> int:
        """Time by which the first stamp was late."""
        late = [0.0, *(step.late for step in self._paths.best.steps if step.late is not None)]
        late = [one for one in late if -one <= self._longest_wait]
        if min(late) > -_FIRST_LATE:
            return 0
        return round(-median(one for one in late if one < min(late) + _FIRST_LATE) * self._pace.period_ns)

    @property
    def may_be_late_by(self) -> int:
        """Number of fields by which the first one may have been late."""
        return math.ceil(self._longest_wait)

    @property
    def _time_ns(self) -> int:
        first = self.fields[0]
        return first.time_ns or first.arrival.time_ns or first.stamp_ns

    @property
    def _longest_wait(self) -> float:
        """Longest possible wait of the first field, in periods."""
        asked = self._steps_to(self._since_ns)
        # A stamp from before the request is from another clock.
        return self._buffered + _MARGIN if asked is None or asked > 1 else max(-asked, 0.0)

    def _steps_to(self, time_ns: int | None) -> float | None:
        return None if time_ns is None else (time_ns - self._time_ns) / self._pace.period_ns
