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
from grabberd.instrument.acquisition.numbering.pending import Pending

_SLOWEST_GAIN = 0.02
_PERIOD_GAIN = _SLOWEST_GAIN**2 / 4  # critically damped: follows the camera's clock without overshoot
_PERIOD_TOLERANCE = 1e-3  # a crystal is good to some 100 ppm; more would be jitter mistaken for drift
_FREE_TOLERANCE = 1e-2


class FieldClock:
    """Prediction of field times from the nominal period, with a slow correction of phase and period.

    The gain starts as that of a running mean and falls to 1/50, so a jitter of 8 ms shrinks to some tenths of
    a millisecond within a second and a half, while a camera clock that is off by some 100 ppm is still
    followed. The period never differs from the nominal one by more than 1000 ppm, or by 1 % for a camera
    with a free pace.

    Args:
        period_ns: Nominal time from field to field.
        exact: True for the times of a recording, which are taken as they are.
        free: True for a camera that counts its pictures, and whose rate is known to some per mille at best.
    """

    def __init__(self, period_ns: float, exact: bool = False, *, free: bool = False) -> None:
        self._nominal_ns = period_ns
        self._exact = exact
        self._tolerance = _FREE_TOLERANCE if free else _PERIOD_TOLERANCE
        self._period_ns = period_ns
        self._base_ns = 0
        self._phase_ns = 0.0
        self._corrections = 0
        self.locked = False

    @property
    def time_ns(self) -> int:
        """Time of the current field."""
        return self._base_ns + round(self._phase_ns)

    def lock(self, time_ns: int) -> None:
        """Restart at a field's time; the learned period is kept."""
        self._base_ns, self._phase_ns = time_ns, 0.0
        self._corrections = 1
        self.locked = True

    def follow(self, period_ns: float, time_ns: int) -> None:
        """Restart at a field's time with another period."""
        self.lock(time_ns)
        self._nominal_ns = self._period_ns = period_ns

    def steps_to(self, time_ns: int) -> float:
        """Number of periods from the current field to a given time."""
        return (time_ns - self._base_ns - self._phase_ns) / self._period_ns

    def advance(self, steps: int, time_ns: int | None = None) -> int:
        """Advance to the field `steps` later and return its time, corrected by a measured one if given."""
        due_ns = self._phase_ns + steps * self._period_ns
        late_ns = 0.0 if time_ns is None else time_ns - self._base_ns - due_ns
        if self._exact:
            self._move(due_ns + late_ns)
        elif time_ns is None:
            self._move(due_ns)
        else:
            self._move(due_ns + self._gain() * late_ns)
            self._correct_period(late_ns / steps)
        return self.time_ns

    def _gain(self) -> float:
        self._corrections += 1
        return max(1 / self._corrections, _SLOWEST_GAIN)

    def _correct_period(self, late_ns: float) -> None:
        limit_ns = self._nominal_ns * self._tolerance
        period_ns = self._period_ns + _PERIOD_GAIN * late_ns
        self._period_ns = min(max(period_ns, self._nominal_ns - limit_ns), self._nominal_ns + limit_ns)

    def _move(self, phase_ns: float) -> None:
        # Whole nanoseconds are kept in an integer: a float would lose precision within a day.
        whole_ns = int(phase_ns)
        self._base_ns += whole_ns
        self._phase_ns = phase_ns - whole_ns


_BACKWARD = 1.5
"""Periods by which a stamp may be before the last one: one of them was late."""
FUTURE_NS = 100_000_000
"""Grace time: how far a stamp may be ahead of the arrival of its field before it is doubted."""
_OLDEST_NS = 10_000_000_000
"""Age of a stream's first stamp beyond which it is from another clock."""
_LONGEST_GAP_S = 10.0
"""Longest gap for which a stamp is trusted without an arrival that confirms it."""


_AGREE = 0.5
"""Periods within which stamps that are off must be off alike before another clock is accepted: closer to the
steps counted than to any other number of them."""
_OF_DOUBTED, _OF_GOOD = 3, 8
"""Number of such consecutive stamps: of untrusted ones, and of those whose fields arrived in time. More of
the latter are needed, since stamps that are merely late may agree by chance."""


class Stamps:
    """Timestamps as the driver gives them, on the clock that the first of them was on.

    Stamps that are zero, run backward or are in the future are not trusted. If they stay off but agree with
    one another, they are from another clock: from then on they are shifted to continue the old one.

    Args:
        info: The stream as granted. The times of a recording are taken as they are.
        pace: Of the camera.
    """

    def __init__(self, info: StreamInfo, pace: Pace) -> None:
        self._live = info.live
        self._keeps_pace = info.live and not info.waits_for_reader
        self._pace = pace
        self._max_steps = _LONGEST_GAP_S * info.rate_hz if info.live else float("inf")
        self._backward = _BACKWARD if info.live else 0.0
        self._offset_ns = 0
        self._last_ns: int | None = None
        self._off_ns: list[int] = []

    def look(self, stamp_ns: int, now_ns: int | None, *, interrupted: bool) -> tuple[int, str | None]:
        """Time of a stamp on this clock, and the reason not to trust it or None."""
        time_ns = stamp_ns - self._offset_ns
        doubt = self._doubt(stamp_ns, time_ns, now_ns, interrupted)
        if doubt is None:
            # The newest, not the last: stamps that run slowly backward would all be trusted.
            self._last_ns = time_ns if self._last_ns is None else max(time_ns, self._last_ns)
        return time_ns, doubt

    def _doubt(self, stamp_ns: int, time_ns: int, now_ns: int | None, interrupted: bool) -> str | None:
        if self._live and stamp_ns <= 0:
            return "zero timestamp"
        if self._keeps_pace and now_ns is not None and time_ns > now_ns + FUTURE_NS:
            return "far-off timestamp"
        if self._last_ns is None:
            too_old = self._keeps_pace and now_ns is not None and time_ns < now_ns - _OLDEST_NS
            return "far-off timestamp" if too_old else None
        steps = (time_ns - self._last_ns) / self._pace.period_ns
        if steps < -self._backward:
            return "backward timestamp"
        confirmed = interrupted or (self._keeps_pace and now_ns is not None)
        return "far-off timestamp" if steps > self._max_steps and not confirmed else None

    def fits(self) -> None:
        """Note that a field's stamp was on time."""
        self._off_ns.clear()

    def watch(self, stamp_ns: int, predicted_ns: int, sightings: int) -> int:
        """Note a stamp that is off; so many in a row that agree are those of another clock.

        Returns:
            The time by which that one is ahead of the clock before; 0 while it is the same.
        """
        off_ns = stamp_ns - predicted_ns
        self._off_ns = [one for one in self._off_ns if abs(off_ns - one) <= _AGREE * self._pace.period_ns]
        self._off_ns.append(off_ns)
        if len(self._off_ns) < sightings:
            return 0
        before_ns, self._offset_ns = self._offset_ns, sum(self._off_ns) // len(self._off_ns)
        self._last_ns = predicted_ns
        self._off_ns.clear()
        set_by_ns = self._offset_ns - before_ns
        return set_by_ns if abs(set_by_ns) > _AGREE * self._pace.period_ns else 0

    def explains(self, stamp_ns: int, predicted_ns: int) -> bool:
        """True if a stamp is from the clock that is now followed, but was not when the stamp came."""
        return abs(stamp_ns - self._offset_ns - predicted_ns) <= _AGREE * self._pace.period_ns


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
        self._early = self._doubted = 0
        self._late = self._ahead = 0.0
        self.rebases: list[tuple[Rebase, str]] = []

    def steps_to(self, time_ns: int | None) -> float | None:
        """Periods from the last settled field to a time; None if either is unknown."""
        return self._clock.steps_to(time_ns) if time_ns is not None and self._clock.locked else None

    def follow_pace(self, too_high_by: int) -> None:
        """Continue from the previous field by the camera's present pace, and report it."""
        self._clock.follow(self._pace.period_ns, self._pace.before_ns)
        self._early = 0
        self._stamps.fits()
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

    def begin(self, pending: Pending, late_ns: int = 0) -> tuple[int, str | None]:
        """Begin with the first field, given the delay of its stamp; its time, and why that is predicted."""
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
        if not self._live or abs(late) <= _LATE:
            self._stamps.fits()
            self._early = 0
            return self._clock.advance(step.fields, pending.time_ns), None
        if abs(self._arrived_late_by(pending, step)) < _IN_TIME:
            return self._come_in_time(pending, step, late, n)
        return self._come_off(pending, step, late, n)

    def _come_off(self, pending: Pending, step: Step, late: float, n: int) -> tuple[int, str | None]:
        """Advance to a field that is as late or early as its stamp, judged by its arrival."""
        assert pending.time_ns is not None, "a stamp that is not believed is off in no way"
        self._stamps.fits()
        if late > 0:
            return self._clock.advance(step.fields), "late timestamp"
        if self._arrivals.way.is_known and self._arrived_late_by(pending, step) > _IN_TIME:
            # It has waited, so its arrival is no evidence: a later one in time will reveal the clock.
            return self._clock.advance(step.fields), "early timestamp"
        if pending.stamped_on_arrival and (n < _NEW_FOR or not self._arrivals.way.is_known):
            return self._begin_again(pending, step)
        return self._come_early(pending.time_ns, step, late), None

    def _come_in_time(self, pending: Pending, step: Step, late: float, n: int) -> tuple[int, str | None]:
        """Advance to a field that arrived in time, although its stamp is off."""
        if late < 0 and n < _NEW_FOR and not self._arrivals.way.is_known:
            return self._begin_again(pending, step)
        predicted_ns = self._clock.advance(step.fields)
        self._watch(pending.stamp_ns, predicted_ns, _OF_GOOD)
        return predicted_ns, "late timestamp" if late > 0 else "early timestamp"

    def _begin_again(self, pending: Pending, step: Step) -> tuple[int, str | None]:
        """Advance to a field of a new stream that is early; after some of them the first stamps were late."""
        time_ns = pending.time_ns or pending.stamp_ns
        if self._is_before_request(time_ns, step):
            predicted_ns = self._clock.advance(step.fields)
            self._watch(pending.stamp_ns, predicted_ns, _OF_GOOD)
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
        """True if first stamps that late would mean that the stream began before it was requested."""
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
        """Note that the numbers have run ahead of the camera, and continue from a time."""
        self._ahead = periods
        self._clock.lock(time_ns)

    def _go_without(self, pending: Pending, predicted_ns: int) -> None:
        """Note a stamp that is not trusted."""
        self._watch(pending.stamp_ns, predicted_ns, _OF_DOUBTED)
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

    def _watch(self, stamp_ns: int, predicted_ns: int, sightings: int) -> None:
        if set_by_ns := self._stamps.watch(stamp_ns, predicted_ns, sightings):
            reason = f"the clock of the timestamps was set by {set_by_ns / 1e9:+.3f} s"
            self.rebases.append((Rebase.CLOCK, reason))

    def _arrived_late_by(self, pending: Pending, step: Step) -> float:
        """Periods by which a field arrived later than it was due; NaN if that is unknown."""
        steps = self.steps_to(self._arrivals.exposed_ns(pending.arrival))
        return math.nan if steps is None else steps - step.fields

    def _predicted_ns(self, pending: Pending, step: Step) -> int:
        if self._clock.locked:
            return self._clock.advance(step.fields)
        if pending.arrival.time_ns is None:
            return pending.stamp_ns
        self._clock.lock(pending.arrival.time_ns)
        return pending.arrival.time_ns
