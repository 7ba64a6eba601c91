"""Field numbering: the place of each grabbed field in the camera's endless count, and the losses before
it.
"""

from typing import NamedTuple

from grabberd.acquisition.device import FieldOrder, GrabbedField, Signal, StreamInfo
from grabberd.acquisition.field_clock import FieldClock
from grabberd.acquisition.ledger import NO_SIGNAL, LedgerEntry, Outcome, never_came

_TOLERANCE_STEPS = 0.75
"""Error allowed in a step measured by time: parity, which changes with every field, settles anything below a
whole one. A stamp less than the remaining quarter after the last counts as running backward."""
_WOVEN = (FieldOrder.TOP_FIRST, FieldOrder.BOTTOM_FIRST)
_FUTURE_NS = 100_000_000
"""Grace time: how far a stamp may be ahead of the arrival of its field before it is doubted."""
_LONGEST_GAP_S = 10.0
"""Longest gap that a live timestamp is believed: a stream silent for longer has been interrupted, which the
capture thread reports by `interrupt`."""
_SIGHTINGS = 3
"""Doubted stamps that must agree among themselves before another clock is accepted."""

TIME_GAP = "time gap"
SEQUENCE_GAP = "sequence gap"
REPEATED_PARITY = "repeated parity"
_WRAP = 2**32  # V4L2 counts in 32 bits


class Numbered(NamedTuple):
    """A grabbed field's number, time and outcome.

    Attributes:
        n: Nominal steps since numbering began, lost fields included; the first field is 0.
        time_ns: Middle of the exposure, smoothed if the stream is live.
        outcome: Received, damaged or no_signal.
        reason: Reason for the outcome; for a received field None, or why its time had to be predicted.
        lost_before: Fields missing between the previous field and this one: lost, or without a signal, since
            some drivers deliver nothing then.
    """

    n: int
    time_ns: int
    outcome: Outcome
    reason: str | None
    lost_before: tuple[LedgerEntry, ...]


class _Step(NamedTuple):
    """Number of fields forward, the name of a loss on the way, and faults of the timestamp and the parity."""

    fields: int
    gap: str
    doubt: str | None = None
    damage: str | None = None


class FieldNumbering:
    """Numbers fields by time first, by parity where it can tell, by the driver's count last.

    Parity must agree with the step: an even step keeps it, an odd one changes it. So a timestamp may be late
    or early by three quarters of a period before a loss is seen where there is none; by a whole period if
    fields come in frames, whose parities say nothing about the camera; by one and a half if the driver
    counts. Timestamps that are zero, run backward or are far off are not believed: the field is kept, its
    time is predicted, and the reason says so. If they stay off but agree among themselves, another clock has
    taken over: from then on they are used again, shifted to continue the old one.

    Args:
        info: The stream as granted. The times of a recording are taken as they are.
    """

    def __init__(self, info: StreamInfo) -> None:
        self._live = info.live
        self._keeps_pace = info.live and not info.waits_for_reader
        self._has_parity = info.field_order is not FieldOrder.ONE_PARITY
        self._woven = info.field_order in _WOVEN
        self._max_steps = _LONGEST_GAP_S * info.rate_hz if info.live else float("inf")
        self._period_ns = 1e9 / info.rate_hz
        self._clock = FieldClock(self._period_ns, exact=not info.live)
        self._counts = info.counts_losses
        self._sequence = SequenceSteps(info.field_order is FieldOrder.ALTERNATE)
        self._n = -1
        self._parity_of_zero: int | None = None
        self._contradicted = False
        self._interruption: str | None = None
        self._offset_ns = self._way_ns = 0
        self._doubted: list[tuple[int, int]] = []

    def interrupt(self, reason: str) -> None:
        """Note that the stream stopped: fields missing before the next one were lost for this reason."""
        self._interruption = reason
        self._sequence.forget()

    def number(
        self,
        grabbed: GrabbedField,
        signal: Signal = Signal.UNKNOWN,
        damage: str | None = None,
        now_ns: int | None = None,
        no_picture: str | None = None,
    ) -> Numbered:
        """Number the next field.

        Args:
            grabbed: Its time, parity, sequence and damage are used, not its grey values.
            signal: The driver's last report.
            damage: Damage found in its content, in addition to the driver's report.
            now_ns: Arrival, on the clock that a live stream's times should use: no field comes from the
                future.
            no_picture: Picture that the grabber substituted, as found in its content.
        """
        parity, time_ns = grabbed.field.parity, grabbed.time_ns - self._offset_ns
        step = self._step(grabbed, time_ns, now_ns)
        first_lost = self._n + 1
        self._n += step.fields
        self._remember_parity(parity, step)
        numbered_ns = self._come_to(time_ns, step, now_ns)
        if now_ns is not None:
            self._way_ns = now_ns - numbered_ns
        lost = self._lost_from(first_lost, step.gap, signal)
        self._interruption = None
        outcome, reason = _outcome(
            NO_SIGNAL if signal is Signal.ABSENT else no_picture,
            grabbed.damage or damage or step.damage,
            step.doubt,
        )
        return Numbered(self._n, numbered_ns, outcome, reason, lost)

    def _lost_from(self, first_n: int, gap: str, signal: Signal) -> tuple[LedgerEntry, ...]:
        count = self._n - first_n
        if not count:
            return ()
        reason = self._interruption or (NO_SIGNAL if signal is Signal.ABSENT else gap)
        return (never_came(first_n, count, reason),)

    def _step(self, grabbed: GrabbedField, time_ns: int, now_ns: int | None) -> _Step:
        parity = grabbed.field.parity
        # Of every field, also where time decides: it learns from each, and remembers the last count.
        count = self._sequence.step(grabbed.sequence, parity) if self._counts else None
        doubt = self._doubt(time_ns, now_ns)
        if self._n < 0:
            return _Step(1, "", doubt)
        if doubt and self._interruption and self._keeps_pace and now_ns is not None and self._clock.locked:
            # Only its arrival tells how long the interruption was.
            return self._step_by_time(self._clock.steps_to(now_ns - self._way_ns), parity, count)._replace(
                doubt=doubt
            )
        if doubt or not self._clock.locked:
            return self._step_without_time(parity, count, doubt)
        return self._step_by_time(self._clock.steps_to(time_ns), parity, count)

    def _step_by_time(self, steps: float, parity: int, count: int | None) -> _Step:
        nearest, agreeing = max(1, round(steps)), self._agreeing(steps, parity)
        if count is not None and (count == agreeing or self._confirms(count, steps, parity)):
            return _Step(count, TIME_GAP if count == nearest else SEQUENCE_GAP)
        if self._woven or abs(agreeing - steps) <= _TOLERANCE_STEPS or self._interruption:
            return _Step(agreeing, TIME_GAP)
        # A single contradiction is a damaged field; a second in a row means the camera's phase has changed.
        return _Step(nearest, TIME_GAP, damage=None if self._contradicted else "parity contradicts time")

    def _confirms(self, count: int, steps: float, parity: int) -> bool:
        """True if a driver's count fits the parity and is not far from the time."""
        spacing = 2 if self._has_parity else 1
        return self._fits(count, parity) and abs(count - steps) <= spacing * _TOLERANCE_STEPS

    def _step_without_time(self, parity: int, count: int | None, doubt: str | None) -> _Step:
        if count is not None and count <= self._max_steps and self._fits(count, parity):
            return _Step(count, SEQUENCE_GAP, doubt)
        return _Step(self._agreeing(1.0, parity), REPEATED_PARITY, doubt)

    def _agreeing(self, steps: float, parity: int) -> int:
        """The step nearest to the measured one that leads to this parity."""
        nearest = max(1, round(steps))
        if self._fits(nearest, parity):
            return nearest
        # Never back to 0: no two fields have the same number.
        return nearest + 1 if steps >= nearest or nearest == 1 else nearest - 1

    def _fits(self, step: int, parity: int) -> bool:
        if not self._has_parity or self._parity_of_zero is None:
            return True
        return (self._n + step + self._parity_of_zero) % 2 == parity

    def _remember_parity(self, parity: int, step: _Step) -> None:
        self._contradicted = step.damage is not None
        if not self._contradicted:
            self._parity_of_zero = (parity + self._n) % 2

    def _doubt(self, time_ns: int, now_ns: int | None) -> str | None:
        """Reason not to believe a timestamp, or None."""
        stamp_ns = time_ns + self._offset_ns
        if self._live and stamp_ns <= 0:
            return "zero timestamp"
        if self._keeps_pace and now_ns is not None and time_ns > now_ns + _FUTURE_NS:
            return "far-off timestamp"
        steps = self._clock.steps_to(time_ns) if self._clock.locked else 1.0
        if steps < 1 - _TOLERANCE_STEPS:
            return "backward timestamp"
        return "far-off timestamp" if steps > self._max_steps and not self._interruption else None

    def _come_to(self, time_ns: int, step: _Step, now_ns: int | None) -> int:
        """Advance the clock to the field and return its time."""
        if step.doubt:
            return self._come_by_prediction(time_ns, step.fields, now_ns)
        self._doubted.clear()
        if self._interruption or not self._clock.locked:
            self._clock.lock(time_ns)
            return time_ns
        return self._clock.advance(step.fields, time_ns)

    def _come_by_prediction(self, time_ns: int, fields: int, now_ns: int | None) -> int:
        if self._clock.locked:
            predicted_ns = self._clock.advance(fields)
        elif now_ns is not None:
            self._clock.lock(now_ns)
            predicted_ns = now_ns
        else:
            return time_ns
        self._watch_another_clock(time_ns, predicted_ns)
        return predicted_ns

    def _watch_another_clock(self, time_ns: int, predicted_ns: int) -> None:
        if self._doubted:
            n, before_ns = self._doubted[-1]
            # Half a period: closer to the steps counted than to any other number of them.
            if abs((time_ns - before_ns) / self._period_ns - (self._n - n)) > 0.5:
                self._doubted.clear()
        self._doubted.append((self._n, time_ns))
        if len(self._doubted) == _SIGHTINGS:
            self._offset_ns += time_ns - predicted_ns
            self._doubted.clear()


def _outcome(no_signal: str | None, damage: str | None, doubt: str | None) -> tuple[Outcome, str | None]:
    if no_signal:
        return Outcome.NO_SIGNAL, no_signal
    if damage:
        return Outcome.DAMAGED, damage
    return Outcome.RECEIVED, f"time predicted ({doubt})" if doubt else None


class SequenceSteps:
    """Converts a driver's `sequence` into steps of fields.

    If each buffer holds one field, some drivers give both fields of a frame the same number and some number
    each field. Which, is learned from the stream: until then, and after the counter restarts, there is no
    answer.

    Args:
        alternate: True if each buffer holds one field, so that either numbering may occur; otherwise the
            counter counts fields.
    """

    def __init__(self, alternate: bool) -> None:
        self._alternate = alternate
        self._newer: int | None = None
        self._single_steps = 0
        self._last: tuple[int, int] | None = None

    def forget(self) -> None:
        """Expect the counter to restart; its way of counting is remembered."""
        self._last = None

    def step(self, sequence: int | None, parity: int) -> int | None:
        """Number of fields since the last one by the driver's counter, or None if it cannot tell."""
        last, self._last = self._last, None if sequence is None else (sequence, parity)
        if sequence is None or last is None:
            return None
        self._learn(sequence - last[0], parity)
        step = (self._index(sequence, parity) - self._index(*last)) % self._modulus
        # Half a wrap ahead or more means that the counter ran backward: it was restarted.
        return step if self._known and 0 < step < self._modulus // 2 else None

    @property
    def _known(self) -> bool:
        return not self._alternate or self._newer is not None or self._single_steps >= 2

    @property
    def _modulus(self) -> int:
        return _WRAP if self._newer is None else 2 * _WRAP

    def _learn(self, difference: int, parity: int) -> None:
        if self._alternate and difference == 0:
            self._newer = parity
        # Where a frame's fields share a number, every second difference is 0: two of 1 in a row exclude that.
        self._single_steps = self._single_steps + 1 if difference == 1 else 0 if self._single_steps < 2 else 2

    def _index(self, sequence: int, parity: int) -> int:
        return sequence if self._newer is None else 2 * sequence + (parity == self._newer)
