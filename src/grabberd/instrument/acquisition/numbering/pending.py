"""A field whose number is not settled yet."""

from dataclasses import dataclass, replace
from typing import Self

from grabberd.core.ledger import NO_SIGNAL, UNCERTAIN, Outcome
from grabberd.instrument.acquisition.numbering.arrivals import Arrival
from grabberd.instrument.acquisition.numbering.paths import Seen


@dataclass(frozen=True, slots=True)
class Pending:
    """A field that waits for more evidence.

    Attributes:
        parity: Of the field; `phase`: the same, or None if all have one parity.
        stamp_ns: Its timestamp; `time_ns`: the time that it means, or None if it is not believed.
        doubt: Why it is not believed, or None.
        arrival: Its arrival; `stamped_on_arrival`: true if the time may be that of the arrival.
        sequence: The driver's number of it, or None.
        count: Fields since the one before by the driver's count; None if that cannot tell.
        recounted: True if that count has restarted.
        outcome, reason: What is known of it without its number.
        no_signal: True if the driver reports no camera.
        in_time: False if it may have waited in the driver's buffers, as far as the program knows.
        may_have_waited: Number of fields for which it may have waited in the driver's buffers, after an
            interruption.
        interruption: Why the stream stopped before it, or None.
        standstill: Why the driver's buffers may have been full before it, or None.
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

    def overcounts(self, fields: int) -> bool:
        """True if the driver counts more fields since the one before than there were."""
        return self.count is not None and self.interruption is None and self.count > fields

    def seen(self, stamp: float | None, arrival: float | None) -> Seen:
        """Evidence that it brings, with its stamp and its arrival in periods."""
        return Seen(
            stamp,
            arrival,
            self.stamped_on_arrival,
            self.arrival.burst,
            self.arrival.joined,
            self.count,
            self.phase,
            self.interruption is not None,
        )

    def damaged(self, reason: str) -> Self:
        """The same, damaged for this reason, unless it is no good field anyway."""
        if self.outcome is not Outcome.RECEIVED:
            return self
        return replace(self, outcome=Outcome.DAMAGED, reason=reason)

    def uncertain(self, fields: int) -> Self:
        """The same with a number that may be off by so many; whatever else is wrong with it is said after."""
        reason = f"{UNCERTAIN} {fields}"
        outcome = Outcome.DAMAGED if self.outcome is Outcome.RECEIVED else self.outcome
        return replace(self, outcome=outcome, reason=f"{reason}; {self.reason}" if self.reason else reason)


def outcome_of(no_signal: str | None, damage: str | None) -> tuple[Outcome, str | None]:
    """Outcome of a field, and its reason, by what driver and content tell."""
    if no_signal:
        return Outcome.NO_SIGNAL, no_signal
    if damage and damage.startswith(NO_SIGNAL):  # as a recording tells of it
        return Outcome.NO_SIGNAL, damage
    if damage:
        return Outcome.DAMAGED, damage
    return Outcome.RECEIVED, None
