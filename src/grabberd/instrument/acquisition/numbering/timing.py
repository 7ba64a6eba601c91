"""Times of the fields: the camera's clock, steered by the trustworthy timestamps.

Timestamps jitter, run backward, are always zero or change their clock; the clock is filtered from those that
are trusted, and predicts the time of a field whose stamp is not.
"""

import math

from grabberd.core.ledger import Rebase, numbers_off
from grabberd.instrument.acquisition.device import StreamInfo
from grabberd.instrument.acquisition.numbering.arrivals import Arrivals
from grabberd.instrument.acquisition.numbering.pace import Pace
from grabberd.instrument.acquisition.numbering.paths import Step
from grabberd.instrument.acquisition.numbering.pending import Pending, uncounted
from grabberd.instrument.acquisition.numbering.stamps import FUTURE_NS, MOVED, OF_DOUBTED, OF_GOOD, Stamps

_SLOWEST_GAIN = 0.02
_PERIOD_GAIN = _SLOWEST_GAIN**2 / 4  # critically damped: follows the camera's clock without overshoot
_JITTER = 0.1
"""σ of a stamp in periods."""
_PERIOD_TOLERANCE = 5e-3  # a crystal is good to some 100 ppm, a camera in the field to 50.2 Hz
_FREE_TOLERANCE = 1e-2
_LEARNED = 5e-5
"""Least relative σ of the period: by so much it varies when stamps jitter."""
_KNOWN_AFTER = 250
"""Measured fields after which changes of the period are those of the camera."""


class FieldClock:
    """Prediction of field times from the nominal period, with a correction of phase and period.

    The gains are those of a Kalman filter, to which the σ of the period is a quarter of its tolerance at
    first, and never fall below 1/50 of the phase: so a jitter of 8 ms shrinks to some tenths of a millisecond
    within a second and a half, and a camera's own rate is known within the first seconds. The period never
    differs from the nominal one by more than .5 %, or by 1 % for a camera with a free pace.

    Args:
        period_ns: Nominal time from field to field.
        exact: True for the times of a recording, which are taken as they are.
        free: True for a camera that counts its pictures, and whose rate is known to some per mille at best.

    Attributes:
        measured: Number of fields with a measured time.
        locked: False before the first field.
    """

    def __init__(self, period_ns: float, exact: bool = False, *, free: bool = False) -> None:
        self._nominal_ns = period_ns
        self._exact = exact
        self._tolerance = _FREE_TOLERANCE if free else _PERIOD_TOLERANCE
        self._period_ns = period_ns
        self._base_ns = 0
        self._phase_ns = 0.0
        self._of_phase, self._of_both, self._of_period = _JITTER**2, 0.0, (self._tolerance / 4) ** 2
        self.measured = 1
        self.locked = False
        self._shortest_ns = self._longest_ns = math.nan

    @property
    def wander(self) -> float:
        """Relative amount by which the period has varied since it is known: by so much it may vary again."""
        return 0.0 if math.isnan(self._longest_ns) else self._longest_ns / self._shortest_ns - 1

    @property
    def period_ns(self) -> float:
        """Time from field to field, as learned."""
        return self._period_ns

    @property
    def time_ns(self) -> int:
        """Time of the current field."""
        return self._base_ns + round(self._phase_ns)

    @property
    def period_sigma(self) -> float:
        """Relative standard deviation of the period."""
        return math.sqrt(self._of_period)

    def lock(self, time_ns: int) -> None:
        """Restart at a field's time; the learned period is kept."""
        self._base_ns, self._phase_ns = time_ns, 0.0
        self._of_phase, self._of_both = _JITTER**2, 0.0
        self.locked = True

    def follow(self, period_ns: float, time_ns: int) -> None:
        """Restart at a field's time with another period."""
        self.lock(time_ns)
        self._nominal_ns = self._period_ns = period_ns
        self._of_period, self.measured = (self._tolerance / 4) ** 2, 1

    def steps_to(self, time_ns: int) -> float:
        """Number of periods from the current field to a given time."""
        return (time_ns - self._base_ns - self._phase_ns) / self._period_ns

    def advance(self, steps: int, time_ns: int | None = None) -> int:
        """Advance to the field `steps` later and return its time, corrected by a measured one if given."""
        due_ns = self._phase_ns + steps * self._period_ns
        self._of_phase += steps * (2 * self._of_both + steps * self._of_period)
        self._of_both += steps * self._of_period
        if time_ns is None:
            self._move(due_ns)
            return self.time_ns
        late_ns = time_ns - self._base_ns - due_ns
        phase, period = (1.0, 0.0) if self._exact else self._gains(steps)
        self._move(due_ns + phase * late_ns)
        self._period_ns = self._limited_ns(self._period_ns + period * late_ns)
        if self.measured > _KNOWN_AFTER:
            self._shortest_ns = min(self._period_ns, self._shortest_ns)
            self._longest_ns = max(self._period_ns, self._longest_ns)
        return self.time_ns

    def stretch(self, steps: int, measured: float, *, is_known: bool) -> None:
        """Correct the period, where so many steps have been measured as another number of periods."""
        self._period_ns = self._limited_ns(self._period_ns * measured / steps)
        if is_known:
            self._of_period = min(self._of_period, 2 * (_JITTER / steps) ** 2)

    def _limited_ns(self, period_ns: float) -> float:
        limit_ns = self._nominal_ns * self._tolerance
        return min(max(period_ns, self._nominal_ns - limit_ns), self._nominal_ns + limit_ns)

    def _gains(self, steps: int) -> tuple[float, float]:
        """Gains of phase and period for a measured time, which make both better known."""
        self.measured += 1
        of_all = self._of_phase + _JITTER**2
        phase, period = self._of_phase / of_all, self._of_both / of_all
        self._of_period = max(self._of_period - period * self._of_both, _LEARNED**2)
        self._of_phase *= 1 - phase
        self._of_both *= 1 - phase
        return max(phase, _SLOWEST_GAIN), max(period, _PERIOD_GAIN / steps)

    def _move(self, phase_ns: float) -> None:
        # Whole nanoseconds are kept in an integer: a float would lose precision within a day.
        whole_ns = int(phase_ns)
        self._base_ns += whole_ns
        self._phase_ns = phase_ns - whole_ns


_LATE = 0.75
"""Periods by which a stamp may be off before the field's time is predicted instead."""
_DUE, _OFF, _APART = 0.2, 0.4, 0.3
"""Periods about which a field came just when it was due, by which its stamp may be off then, and by which the
stamp must differ from the arrival, with which it may have come."""
_USUAL_WAY = 1.5
"""Periods from the middle of an exposure to the arrival: half of one, and one to read the field out."""
_SURELY = 2.5
"""Standard deviations of the period within which it surely is."""
_IN_TIME = 0.6
"""Periods after the shortest way, within which a field has arrived in time."""
_EARLY = 3
"""Fields in a row that are early by a whole one, after which the clock is wrong and not they."""
_PULLS = 3.0
"""Periods by which such a field may be early and still correct the clock: more would spoil the period."""
_NEW_FOR = 100
"""Fields of a stream within which its first stamps may turn out to have been late. Later on, early stamps are
those of another clock."""
_OFF_TICK = 0.15
"""Periods by which a clock is set in addition to a tick of its stamps."""
_TAKEN_OVER = 5
"""Consecutive untrusted stamps after which arrivals are used instead: fewer are a few bad ones, or the first
of another clock."""


class Timing:
    """Determines the time of each field in turn, when its number is settled.

    A stamp corrects the clock; if it is not trusted, or is off, the clock predicts the time, and the reason
    is given.

    Args:
        info: The stream as granted. The times of a recording are taken as they are.
        pace: Of the camera.
        stamps, arrivals: Those of the stream.
        since_ns: When the stream was requested, before which nothing was exposed; None if unknown.

    Attributes:
        rebases: Changes of the time base from the last field on, each with its reason; whoever takes them
            clears them.
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
        self._may_begin_late = False
        self._early = self._doubted = self._uncounted = 0
        self._arrives_after_ns: int | None = None
        self._late = self._ahead = 0.0
        self._behind: list[float] = []
        self.rebases: list[tuple[Rebase, str]] = []

    @property
    def period_ns(self) -> float:
        """Time from field to field of the camera's clock, as learned."""
        return self._clock.period_ns

    @property
    def _usual_way_ns(self) -> int:
        """Time from the middle of an exposure to the arrival of its field, without a stamp that shows it."""
        return round(_USUAL_WAY * self._pace.period_ns)

    def bridge(self, fields: int, steps: float, *, is_counted: bool) -> None:
        """Learn the period from a gap of so many fields that measures so many steps, if it is not known well
        enough to tell how many they are.
        """
        is_gap = fields > 1 and self._spread_of_rate(fields) > 0.5
        if is_gap and 0.5 < abs(steps - fields) < self.spread(fields):
            self._clock.stretch(fields, steps, is_known=is_counted)

    def spread(self, steps: int) -> float:
        """Periods by which a field so many steps later may come sooner or later than predicted."""
        return self._spread_of_rate(steps) + self._arrivals.grid + _LATE / 2

    def _spread_of_rate(self, steps: int) -> float:
        """The part of it that comes from the rate; stamps on a grid tilt what was learned of that."""
        by_field = max(_SURELY * self._clock.period_sigma, self._clock.wander)
        by_field += self._arrivals.grid / self._clock.measured
        return steps * min(by_field, _PERIOD_TOLERANCE)

    def steps_to(self, time_ns: int | None) -> float | None:
        """Periods from the last settled field to a time; None if either is unknown."""
        return self._clock.steps_to(time_ns) if time_ns is not None and self._clock.locked else None

    def follow_pace(self, too_high_by: int) -> None:
        """Continue from the previous field by the camera's present pace, and report it."""
        self._clock.follow(self._pace.period_ns, self._pace.before_ns)
        self._early = 0
        self._stamps.fits()
        self._stamps.arrive_anew()
        if changed := self._pace.take_changed():
            self.rebases.append((Rebase.RATE, changed))
        if too_high_by:
            self.rebases.append((Rebase.NUMBERS, numbers_off(0, too_high_by).reason))

    def take_ahead(self) -> float:
        """Periods by which the last field showed that numbers had run ahead; 0 when called again."""
        ahead, self._ahead = self._ahead, 0.0
        return ahead

    def take_late(self) -> float:
        """Periods by which all fields before the last one turned out to be late; 0 when called again."""
        late, self._late = self._late, 0.0
        return late

    def begin(
        self, pending: Pending, late_ns: int = 0, *, may_be_late: bool = False
    ) -> tuple[int, str | None]:
        """Begin with the first field, given the delay of its stamp, and if it may be late beyond that; its
        time, and why that is predicted.
        """
        self._may_begin_late = may_be_late
        time_ns = pending.time_ns
        if time_ns is None and pending.arrival.time_ns is not None:
            time_ns = pending.arrival.time_ns - self._usual_way_ns
        if time_ns is None:
            return pending.stamp_ns, pending.doubt
        time_ns -= late_ns
        self._first_ns = time_ns
        self._clock.lock(time_ns)
        self._arrivals.learn(pending.arrival, time_ns)
        return time_ns, pending.doubt

    def come_to(self, pending: Pending, step: Step, n: int) -> tuple[int, str | None]:
        """Advance the clock to field `n`; its time, and why that is predicted."""
        self._uncounted += uncounted(pending, step)
        time_ns, reason = self._come_to(pending, step, n)
        arrived_ns = pending.arrival.time_ns
        if arrived_ns is None:
            return time_ns, reason
        if pending.time_ns is not None and pending.in_time and reason is None and not pending.arrival.joined:
            longer = self._stamps.arrived(arrived_ns - pending.time_ns)
            if abs(longer) > MOVED and not self._arrivals.beats:
                self._stamps.keep_way(longer)
        exposed_ns, grace_ns = arrived_ns, FUTURE_NS
        if self._arrivals.way.is_known and n >= _NEW_FOR:  # before that, the first ones may have been late
            exposed_ns = self._arrivals.exposed_ns(pending.arrival) or arrived_ns
            grace_ns = round(_IN_TIME * self._pace.period_ns)
        if self._doubted >= _TAKEN_OVER and exposed_ns > arrived_ns:
            # Without stamps there is no clock of theirs that could be ahead of that of the arrivals.
            exposed_ns, grace_ns = arrived_ns, 0
        if time_ns <= exposed_ns + grace_ns:
            return time_ns, reason
        # A field in the future: the clock was set while fields waited, which was mistaken for losses.
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
        if (
            not self._live
            or abs(late) <= self._latest(pending, step, late)
            or self._arrivals.ticks_over(late)
        ):
            self._stamps.fits()
            self._early = 0
            return self._clock.advance(step.fields, pending.time_ns), None
        if abs(self._arrived_late_by(pending, step)) < _IN_TIME:
            return self._come_in_time(pending, step, late, n)
        return self._come_off(pending, step, late, n)

    def _latest(self, pending: Pending, step: Step, late: float) -> float:
        """Periods by which a stamp may be off that is late by so many: less if its field came when due."""
        arrived = self._arrived_late_by(pending, step)
        is_due = self._arrivals.way.is_known and pending.in_time and abs(arrived) < _DUE
        return max(_OFF, self._arrivals.grid) if is_due and abs(late - arrived) > _APART else _LATE

    def _come_off(self, pending: Pending, step: Step, late: float, n: int) -> tuple[int, str | None]:
        """Advance to a field that is as late or early as its stamp, judged by its arrival."""
        assert pending.time_ns is not None, "a stamp that is not believed is off in no way"
        self._stamps.fits()
        if late > 0:
            if not self._falls_behind(pending, late):
                return self._clock.advance(step.fields), "late timestamp"
            self._run_ahead(-late, pending.time_ns)
            return pending.time_ns, None
        if self._arrivals.way.is_known and self._arrived_late_by(pending, step) > _IN_TIME:
            # It has waited, so its arrival is no evidence: a later one in time will reveal the clock.
            return self._clock.advance(step.fields), "early timestamp"
        way_is_known = self._arrivals.way.is_known
        # A loss that was not counted may be none: then the numbers run ahead, and no stamp was late.
        may_be_late = not self._uncounted or (self._may_begin_late and not way_is_known)
        is_new = pending.stamped_on_arrival and may_be_late and (n < _NEW_FOR or not way_is_known)
        if is_new and not self._is_before_request(pending.time_ns, step):
            return self._begin_again(pending, step)
        return self._come_early(pending.time_ns, step, late), None

    def _falls_behind(self, pending: Pending, late: float) -> bool:
        """True if stamps of exposures are late alike, of fields in time whose way is unknown: then so many
        fields were lost unnoticed.
        """
        if self._arrivals.way.is_known or not self._arrivals.tells_of_stamps or not pending.in_time:
            return False
        alike = self._behind and abs(late - self._behind[-1]) <= _LATE
        self._behind = [*self._behind, late] if alike else [late]
        return len(self._behind) >= OF_GOOD

    def _come_in_time(self, pending: Pending, step: Step, late: float, n: int) -> tuple[int, str | None]:
        """Advance to a field that arrived in time, although its stamp is off."""
        if late < 0 and n < _NEW_FOR and not self._arrivals.way.is_known:
            return self._begin_again(pending, step)
        predicted_ns = self._clock.advance(step.fields)
        self._watch(pending.stamp_ns, predicted_ns, OF_GOOD)
        return predicted_ns, "late timestamp" if late > 0 else "early timestamp"

    def _begin_again(self, pending: Pending, step: Step) -> tuple[int, str | None]:
        """Advance to a field of a new stream that is early; after some of them the first stamps were late."""
        time_ns = pending.time_ns or pending.stamp_ns
        if self._is_before_request(time_ns, step):
            predicted_ns = self._clock.advance(step.fields)
            self._watch(pending.stamp_ns, predicted_ns, OF_GOOD)
            return predicted_ns, "early timestamp"
        self._early += 1
        if self._early < _EARLY:
            return self._clock.advance(step.fields), "early timestamp"
        late_ns = self._clock.advance(step.fields) - time_ns
        if self._first_ns is not None:
            self._first_ns -= late_ns
        self.rebases.append((Rebase.BEGIN, f"the first timestamps were late by {late_ns / 1e6:.0f} ms"))
        self._early, self._late = 0, late_ns / self._pace.period_ns
        self._clock.lock(time_ns)
        return time_ns, None

    def _is_before_request(self, time_ns: int, step: Step) -> bool:
        """True if first stamps that late would mean that the stream began before it was requested."""
        if self._since_ns is None or self._first_ns is None:
            return False
        late_ns = (self._clock.steps_to(time_ns) - step.fields) * self._pace.period_ns
        return self._first_ns + late_ns < self._since_ns - self._pace.period_ns / 2

    def _come_early(self, time_ns: int, step: Step, late: float) -> int:
        """Advance to a field that is early; after some of them the numbers have run ahead of the camera."""
        self._early += 1
        if self._early < _EARLY:
            return self._clock.advance(step.fields, time_ns if late > -_PULLS else None)
        self._run_ahead(-late, time_ns)
        return time_ns

    def _run_ahead(self, periods: float, time_ns: int) -> None:
        """Note that the numbers have run ahead of the camera, and continue from a time."""
        self._ahead = periods
        self._behind = []
        self._clock.lock(time_ns)

    def _go_without(self, pending: Pending, predicted_ns: int) -> None:
        """Note a stamp that is not trusted."""
        self._watch(pending.stamp_ns, predicted_ns, OF_DOUBTED)
        if self._stamps.explains(pending.stamp_ns, predicted_ns):
            return  # it came before the other clock was known
        self._doubted += 1
        if self._doubted == _TAKEN_OVER:
            reason = f"arrivals have taken over from the timestamps ({pending.doubt})"
            self.rebases.append((Rebase.ARRIVALS, reason))

    def _believe_again(self) -> None:
        if self._doubted >= _TAKEN_OVER:
            self.rebases.append((Rebase.TIMESTAMPS, "the timestamps are believed again"))
        self._doubted, self._arrives_after_ns = 0, None

    def _watch(self, stamp_ns: int, predicted_ns: int, sightings: int) -> None:
        set_by_ns = self._stamps.watch(stamp_ns, predicted_ns, sightings)
        # Stamps that tick may all come a tick sooner or later.
        if abs(set_by_ns) > (self._arrivals.tick + _OFF_TICK) * self._pace.period_ns:
            reason = f"the clock of the timestamps was set by {set_by_ns / 1e9:+.3f} s"
            self.rebases.append((Rebase.CLOCK, reason))

    def _arrived_late_by(self, pending: Pending, step: Step) -> float:
        """Periods by which a field arrived later than it was due; NaN if that is unknown."""
        steps = self.steps_to(self._arrivals.exposed_ns(pending.arrival))
        return math.nan if steps is None else steps - step.fields

    def _predicted_ns(self, pending: Pending, step: Step) -> int:
        """Time of a field without a stamp that is trusted: the clock follows the arrivals instead."""
        arrived_ns = pending.arrival.time_ns
        if not self._clock.locked:
            if arrived_ns is None:
                return pending.stamp_ns
            self._clock.lock(arrived_ns - self._usual_way_ns)
            return self._clock.time_ns
        if self._doubted < _TAKEN_OVER or not pending.in_time or arrived_ns is None:
            return self._clock.advance(step.fields)
        if self._arrives_after_ns is None:
            self._arrives_after_ns = arrived_ns - self._clock.advance(step.fields)
            return self._clock.time_ns
        time_ns = arrived_ns - self._arrives_after_ns
        late = self._clock.steps_to(time_ns) - step.fields
        return self._clock.advance(step.fields, time_ns if abs(late) <= _LATE else None)
