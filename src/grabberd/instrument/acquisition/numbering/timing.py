"""Times of the fields: the camera's clock, led by the stamps that deserve it."""

from grabberd.core.ledger import Rebase, numbers_off
from grabberd.instrument.acquisition.device import StreamInfo
from grabberd.instrument.acquisition.numbering.arrivals import Arrivals
from grabberd.instrument.acquisition.numbering.field_clock import FieldClock
from grabberd.instrument.acquisition.numbering.pace import Pace
from grabberd.instrument.acquisition.numbering.paths import Step
from grabberd.instrument.acquisition.numbering.pending import Pending
from grabberd.instrument.acquisition.numbering.stamps import FUTURE_NS, Stamps

_LATE = 0.75
"""Periods by which a stamp may be off before the field's time is predicted instead."""
_IN_TIME = 0.6
"""Periods after the shortest way, within which a field has arrived in time."""
_EARLY = 3
"""Fields in a row that are early by a whole one, after which the clock is wrong and not they."""
_NEW_FOR = 100
"""Fields of a stream within which its first stamps may turn out to have been late. Later on, early stamps are
those of another clock."""
_TAKEN_OVER = 5
"""Stamps in a row that are not believed, after which arrivals have taken over: fewer are a few bad ones, or
the first of another clock."""


class Timing:
    """Comes to the time of each field in turn, when its number is settled.

    A stamp corrects the clock; one that is not believed, or that is off, leaves the clock to predict the
    time, and then there is a reason why.

    Args:
        info: The stream as granted. The times of a recording are taken as they are.
        pace: Of the camera.
        stamps, arrivals: Those of the stream.
        since_ns: When the stream was asked for, before which nothing was exposed; None if unknown.

    Attributes:
        rebases: What times go by from the last field on and did not before, each with its reason; whoever
            takes them clears them.
    """

    def __init__(
        self, info: StreamInfo, pace: Pace, stamps: Stamps, arrivals: Arrivals, since_ns: int | None = None
    ) -> None:
        self._live = info.live
        self._pace = pace
        self._clock = FieldClock(pace.period_ns, exact=not info.live, free=pace.is_followed)
        self._stamps = stamps
        self._arrivals = arrivals
        self._since_ns = since_ns
        self._first_ns: int | None = None
        self._early = self._doubted = 0
        self._late = self._ahead = 0.0
        self.rebases: list[tuple[Rebase, str]] = []

    def steps_to(self, time_ns: int | None) -> float | None:
        """Periods from the field that was settled last to a time; None if either is unknown."""
        return self._clock.steps_to(time_ns) if time_ns is not None and self._clock.locked else None

    def follow_pace(self, too_high_by: int) -> None:
        """Go on from the field before by the pace that the camera has now, and tell of it."""
        self._clock.follow(self._pace.period_ns, self._pace.before_ns)
        self._early = 0
        self._stamps.fits()
        if told := self._pace.take_told():
            self.rebases.append((Rebase.RATE, told))
        if too_high_by:
            self.rebases.append((Rebase.NUMBERS, numbers_off(0, too_high_by).reason))

    def take_ahead(self) -> float:
        """Periods by which numbers turned out with the last field to have run ahead; 0 when asked again."""
        ahead, self._ahead = self._ahead, 0.0
        return ahead

    def take_late(self) -> float:
        """Periods by which all fields before the last one turned out to be late; 0 when asked again."""
        late, self._late = self._late, 0.0
        return late

    def begin(self, pending: Pending, late_ns: int = 0) -> tuple[int, str | None]:
        """Begin with the first field, whose stamp is late by so much; its time, and why that is predicted."""
        time_ns = pending.arrival.time_ns if pending.time_ns is None else pending.time_ns
        if time_ns is None:
            return pending.stamp_ns, pending.doubt
        time_ns -= late_ns
        self._first_ns = time_ns
        self._clock.lock(time_ns)
        self._arrivals.learn(pending.arrival, time_ns)
        return time_ns, pending.doubt

    def come_to(self, pending: Pending, step: Step, n: int) -> tuple[int, str | None]:
        """Advance the clock to field `n`; its time, and why that is predicted."""
        time_ns, reason = self._come_to(pending, step, n)
        arrived_ns = pending.arrival.time_ns
        if arrived_ns is None:
            return time_ns, reason
        exposed_ns, grace_ns = arrived_ns, FUTURE_NS
        if self._arrivals.way.is_known and n >= _NEW_FOR:  # before that, the first ones may have been late
            exposed_ns = self._arrivals.exposed_ns(pending.arrival) or arrived_ns
            grace_ns = round(_IN_TIME * self._pace.period_ns)
        if time_ns <= exposed_ns + grace_ns:
            return time_ns, reason
        # A field of the future: a clock that was set while fields waited has passed for losses.
        self._run_ahead((time_ns - exposed_ns) / self._pace.period_ns, exposed_ns)
        return exposed_ns, reason or "far-off timestamp"

    def _come_to(self, pending: Pending, step: Step, n: int) -> tuple[int, str | None]:
        if pending.time_ns is None:
            predicted_ns = self._predicted_ns(pending, step)
            self._go_without(pending, predicted_ns)
            return predicted_ns, pending.doubt
        self._believe_again()
        late = self._clock.steps_to(pending.time_ns) - step.fields if self._clock.locked else 0.0
        if not self._clock.locked or (pending.interruption and abs(late) <= _LATE):
            self._stamps.fits()
            self._clock.lock(pending.time_ns)
            return pending.time_ns, None
        if not self._live or abs(late) <= _LATE:
            self._stamps.fits()
            self._early = 0
            return self._clock.advance(step.fields, pending.time_ns), None
        if self._arrived_in_time(pending, step):
            return self._come_in_time(pending, step, late, n)
        return self._come_off(pending, step, late, n)

    def _come_off(self, pending: Pending, step: Step, late: float, n: int) -> tuple[int, str | None]:
        """Advance to a field that is as late or early as its stamp, as far as its arrival tells."""
        assert pending.time_ns is not None, "a stamp that is not believed is off in no way"
        self._stamps.fits()
        if late > 0:
            return self._clock.advance(step.fields), "late timestamp"
        if self._arrivals.way.is_known and self._arrived_late(pending, step):
            # It has waited, so its arrival tells nothing: one that is in time will tell of the clock.
            return self._clock.advance(step.fields), "early timestamp"
        if pending.stamped_on_arrival and (n < _NEW_FOR or not self._arrivals.way.is_known):
            return self._begin_again(pending, step)
        return self._come_early(pending.time_ns, step, late), None

    def _come_in_time(self, pending: Pending, step: Step, late: float, n: int) -> tuple[int, str | None]:
        """Advance to a field that arrived in time, although its stamp is off."""
        if late < 0 and n < _NEW_FOR and not self._arrivals.way.is_known:
            return self._begin_again(pending, step)
        predicted_ns = self._clock.advance(step.fields)
        self._note_set_by(self._stamps.off(pending.stamp_ns, predicted_ns))
        return predicted_ns, "late timestamp" if late > 0 else "early timestamp"

    def _begin_again(self, pending: Pending, step: Step) -> tuple[int, str | None]:
        """Advance to a field of a new stream that is early; after some of them the first stamps were late."""
        time_ns = pending.time_ns or pending.stamp_ns
        if self._is_before_request(time_ns, step):
            predicted_ns = self._clock.advance(step.fields)
            self._note_set_by(self._stamps.off(pending.stamp_ns, predicted_ns))
            return predicted_ns, "early timestamp"
        self._early += 1
        if self._early < _EARLY:
            return self._clock.advance(step.fields), "early timestamp"
        late_ns = self._clock.advance(step.fields) - time_ns
        self.rebases.append((Rebase.BEGIN, f"the first timestamps were late by {late_ns / 1e6:.0f} ms"))
        self._early, self._late = 0, late_ns / self._pace.period_ns
        self._clock.lock(time_ns)
        return time_ns, None

    def _is_before_request(self, time_ns: int, step: Step) -> bool:
        """True if the stream would have begun before it was asked for, had its first stamps been so late."""
        if self._since_ns is None or self._first_ns is None:
            return False
        late_ns = (self._clock.steps_to(time_ns) - step.fields) * self._pace.period_ns
        return self._first_ns + late_ns < self._since_ns - self._pace.period_ns / 2

    def _come_early(self, time_ns: int, step: Step, late: float) -> int:
        """Advance to a field that is early; after some of them the numbers have run ahead of the camera."""
        self._early += 1
        if self._early < _EARLY:
            return self._clock.advance(step.fields, time_ns)
        self._run_ahead(-late, time_ns)
        return time_ns

    def _run_ahead(self, periods: float, time_ns: int) -> None:
        """Note that the numbers have run ahead of the camera, and go on from a time."""
        self._ahead = periods
        self._clock.lock(time_ns)

    def _go_without(self, pending: Pending, predicted_ns: int) -> None:
        """Note a stamp that is not believed."""
        self._note_set_by(self._stamps.doubted(pending.stamp_ns, predicted_ns))
        if self._stamps.explains(pending.stamp_ns, predicted_ns):
            return  # it came before the other clock was known
        self._doubted += 1
        if self._doubted == _TAKEN_OVER:
            reason = f"arrivals have taken over from the timestamps ({pending.doubt})"
            self.rebases.append((Rebase.ARRIVALS, reason))

    def _believe_again(self) -> None:
        if self._doubted >= _TAKEN_OVER:
            self.rebases.append((Rebase.TIMESTAMPS, "the timestamps are believed again"))
        self._doubted = 0

    def _note_set_by(self, set_by_ns: int) -> None:
        if set_by_ns:
            reason = f"the clock of the timestamps was set by {set_by_ns / 1e9:+.3f} s"
            self.rebases.append((Rebase.CLOCK, reason))

    def _arrived_late(self, pending: Pending, step: Step) -> bool:
        steps = self.steps_to(self._arrivals.exposed_ns(pending.arrival))
        return steps is not None and steps - step.fields > _IN_TIME

    def _arrived_in_time(self, pending: Pending, step: Step) -> bool:
        steps = self.steps_to(self._arrivals.exposed_ns(pending.arrival))
        return steps is not None and abs(steps - step.fields) < _IN_TIME

    def _predicted_ns(self, pending: Pending, step: Step) -> int:
        if self._clock.locked:
            return self._clock.advance(step.fields)
        if pending.arrival.time_ns is None:
            return pending.stamp_ns
        self._clock.lock(pending.arrival.time_ns)
        return pending.arrival.time_ns
