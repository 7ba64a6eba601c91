"""Numbering of fields that keeps those in doubt back until later ones have settled them.

The capture thread numbers by `FieldNumbering` so far, which decides at once.
"""

from collections import deque
from dataclasses import dataclass, replace
from typing import NamedTuple

from grabberd.acquisition.device import FieldOrder, GrabbedField, Signal, StreamInfo
from grabberd.acquisition.field_clock import FieldClock
from grabberd.acquisition.hypotheses.paths import Paths, Seen, Step
from grabberd.acquisition.ledger import NO_SIGNAL, LedgerEntry, Outcome, never_came
from grabberd.acquisition.numbering import (
    REPEATED_PARITY,
    SEQUENCE_GAP,
    TIME_GAP,
    Numbered,
    SequenceSteps,
)

_LATE = 0.75
"""Periods by which a stamp may be late before the field's time is predicted instead."""
_BACKWARD = 1.5
"""Periods by which a stamp may lie before the last one: one of them was late."""
_FUTURE_NS = 100_000_000
"""Grace time: how far a stamp may be ahead of the arrival of its field before it is doubted."""
_LONGEST_GAP_S = 10.0
"""Longest gap that a stamp is believed where no arrival confirms it."""
_BURST = 0.3
"""Periods between arrivals, below which fields have waited in the driver's buffers."""
_IN_TIME = 0.6
"""Periods after the shortest way, within which a field has arrived in time."""


class _Agreement(NamedTuple):
    """Stamps in a row that must agree among themselves, and how well, before another clock is accepted."""

    sightings: int
    periods: float


# Half a period: closer to the steps counted than to any other number of them. Stamps that are merely late are
# as late as the one before by chance.
_OF_DOUBTED, _OF_GOOD_STAMPS = _Agreement(3, 0.5), _Agreement(5, 0.1)
_EARLY = 3
"""Fields in a row that are early by a whole one, after which the clock is wrong and not they."""
_WAY_GROWS_NS = 20_000
"""Growth of the shortest way from field to field, so that it follows a computer that becomes slower."""
MOST_PENDING = 16
"""Fields that wait for more evidence before the likeliest path is taken: half of the usual ring."""


@dataclass(frozen=True, slots=True)
class _Pending:
    """A field whose number is not settled yet."""

    parity: int
    time_ns: int | None
    stamp_ns: int
    now_ns: int | None
    burst: bool
    joined: bool
    count: int | None
    doubt: str | None
    outcome: Outcome
    reason: str | None
    no_signal: bool
    interruption: str | None


class PathNumbering:
    """Numbers fields by all evidence together: time, parity, the driver's count and the arrival.

    A field whose number is in doubt is kept back until later ones have settled it, at most `MOST_PENDING`.
    Timestamps that are zero, run backward or come out of the future are not believed: the field is kept, its
    time is predicted, and the reason says so. If they stay off but agree among themselves, another clock has
    taken over: from then on they are used again, shifted to continue the old one.

    Args:
        info: The stream as granted. The times of a recording are taken as they are.
    """

    def __init__(self, info: StreamInfo) -> None:
        self._live = info.live
        self._keeps_pace = info.live and not info.waits_for_reader
        self._has_parity = info.field_order is not FieldOrder.ONE_PARITY
        self._waits = {FieldOrder.TOP_FIRST: 0, FieldOrder.BOTTOM_FIRST: 1}.get(info.field_order)
        self._arrived_ns: int | None = None
        self._dequeued_ns: int | None = None
        self._max_steps = _LONGEST_GAP_S * info.rate_hz if info.live else float("inf")
        self._period_ns = 1e9 / info.rate_hz
        self._clock = FieldClock(self._period_ns, exact=not info.live)
        self._counts = info.counts_losses
        self._sequence = SequenceSteps(info.field_order is FieldOrder.ALTERNATE)
        self._n = -1
        self._paths: Paths | None = None
        self._pending: deque[_Pending] = deque()
        self._interruption: str | None = None
        self._offset_ns = 0
        self._way_ns: int | None = None
        self._last_ns: int | None = None
        self._doubted: list[tuple[int, int]] = []
        self._early = self._too_many = 0

    def interrupt(self, reason: str) -> list[Numbered]:
        """Note that the stream stopped: fields missing before the next one were lost for this reason.

        Returns:
            The fields that were still pending.
        """
        settled = self.settle()
        self._interruption = reason
        self._sequence.forget()
        return settled

    def number(
        self,
        grabbed: GrabbedField,
        signal: Signal = Signal.UNKNOWN,
        damage: str | None = None,
        now_ns: int | None = None,
        no_picture: str | None = None,
    ) -> list[Numbered]:
        """Number the next field.

        Args:
            grabbed: Its time, parity, sequence and damage are used, not its grey values.
            signal: The driver's last report.
            damage: Damage found in its content, in addition to the driver's report.
            now_ns: Arrival, on the clock that a live stream's times should use: no field comes from the
                future.
            no_picture: Picture that the grabber substituted, as found in its content.

        Returns:
            The fields that are settled now, the oldest first; none while this one is in doubt.
        """
        pending = self._look(grabbed, signal, damage, now_ns, no_picture)
        self._pending.append(pending)
        self._interruption = None
        if self._paths is None:
            self._paths = Paths(pending.parity if self._has_parity else None)
            return [self._first(self._pending.popleft())]
        self._paths.see(self._seen(pending))
        settled = []
        while self._pending and (self._paths.settled() or len(self._pending) > MOST_PENDING):
            settled.append(self._settle_oldest(self._paths))
        return settled

    def settle(self) -> list[Numbered]:
        """Number the pending fields by what is known now."""
        return [self._settle_oldest(self._paths) for _ in range(len(self._pending)) if self._paths]

    def _look(
        self,
        grabbed: GrabbedField,
        signal: Signal,
        damage: str | None,
        now_ns: int | None,
        no_picture: str | None,
    ) -> _Pending:
        parity, time_ns = grabbed.field.parity, grabbed.time_ns - self._offset_ns
        # Of every field, also where time decides: it learns from each, and remembers the last count.
        count = self._sequence.step(grabbed.sequence, parity) if self._counts else None
        doubt = self._doubt(grabbed.time_ns, time_ns, now_ns)
        outcome, reason = _outcome(
            NO_SIGNAL if signal is Signal.ABSENT else no_picture, grabbed.damage or damage
        )
        if doubt is None:
            self._last_ns = time_ns
        arrival_ns, burst, joined = self._arrival(parity, now_ns)
        return _Pending(
            parity,
            None if doubt else time_ns,
            time_ns,
            arrival_ns,
            burst,
            joined,
            count,
            doubt,
            outcome,
            reason,
            signal is Signal.ABSENT,
            self._interruption,
        )

    def _arrival(self, parity: int, now_ns: int | None) -> tuple[int | None, bool, bool]:
        """Earliest arrival of a field; true if it came right after the last one; true if with it."""
        if now_ns is None or not self._keeps_pace:
            return None, False, False
        # The older field of a frame waits for the newer one.
        arrival_ns = now_ns - (round(self._period_ns) if parity == self._waits else 0)
        before_ns, self._arrived_ns = self._arrived_ns, arrival_ns
        at_once = before_ns is not None and arrival_ns - before_ns < _BURST * self._period_ns
        joined = self._waits is not None and parity != self._waits and now_ns == self._dequeued_ns
        self._dequeued_ns = now_ns
        return arrival_ns, at_once, joined

    def _doubt(self, stamp_ns: int, time_ns: int, now_ns: int | None) -> str | None:
        """Reason not to believe a timestamp, or None."""
        if self._live and stamp_ns <= 0:
            return "zero timestamp"
        if self._keeps_pace and now_ns is not None and time_ns > now_ns + _FUTURE_NS:
            return "far-off timestamp"
        if self._last_ns is None:
            return None
        steps = (time_ns - self._last_ns) / self._period_ns
        if steps < (0.0 if self._exact else -_BACKWARD):
            return "backward timestamp"
        confirmed = self._interruption or (self._keeps_pace and now_ns is not None)
        return "far-off timestamp" if steps > self._max_steps and not confirmed else None

    @property
    def _exact(self) -> bool:
        return not self._live

    def _seen(self, pending: _Pending) -> Seen:
        arrival = None
        if pending.now_ns is not None and self._way_ns is not None and self._clock.locked:
            arrival = self._clock.steps_to(pending.now_ns - self._way_ns)
        stamp = None if pending.time_ns is None else self._steps_to(pending.time_ns)
        parity = pending.parity if self._has_parity else None
        excused = pending.interruption is not None
        return Seen(stamp, arrival, pending.burst, pending.joined, pending.count, parity, excused)

    def _steps_to(self, time_ns: int) -> float | None:
        return self._clock.steps_to(time_ns) if self._clock.locked else None

    def _first(self, pending: _Pending) -> Numbered:
        self._n = 0
        time_ns = pending.now_ns if pending.time_ns is None else pending.time_ns
        if time_ns is not None:
            self._clock.lock(time_ns)
        self._learn_way(pending, self._clock.time_ns)
        return self._numbered(pending, pending.stamp_ns if time_ns is None else time_ns, (), pending.doubt)

    def _settle_oldest(self, paths: Paths) -> Numbered:
        pending = self._pending.popleft()
        open_fields = 0 if paths.settled() else paths.spread
        step = paths.settle()
        first_lost = self._n + 1
        self._n += step.fields
        time_ns, doubt = self._come_to(pending, step)
        self._learn_way(pending, time_ns)
        lost = self._lost(first_lost, pending, step)
        if step.wrong_parity:
            pending = _damaged(pending, "parity contradicts time")
        open_fields = max(open_fields, step.doubt, self._too_many)
        self._too_many = 0
        if open_fields:
            pending = _damaged(pending, f"number uncertain by up to {open_fields}")
        return self._numbered(pending, time_ns, lost, doubt)

    def _numbered(
        self, pending: _Pending, time_ns: int, lost: tuple[LedgerEntry, ...], doubt: str | None
    ) -> Numbered:
        reason = pending.reason
        if pending.outcome is Outcome.RECEIVED and doubt:
            reason = f"time predicted ({doubt})"
        return Numbered(self._n, time_ns, pending.outcome, reason, lost)

    def _come_to(self, pending: _Pending, step: Step) -> tuple[int, str | None]:
        """Advance the clock to a field; its time, and why that is predicted."""
        if pending.time_ns is None:
            predicted_ns = self._predicted_ns(pending, step)
            self._watch_another_clock(pending.stamp_ns, predicted_ns, _OF_DOUBTED)
            return predicted_ns, pending.doubt
        if pending.interruption or not self._clock.locked:
            self._doubted.clear()
            self._clock.lock(pending.time_ns)
            return pending.time_ns, None
        late = self._clock.steps_to(pending.time_ns) - step.fields
        if not self._live or abs(late) <= _LATE:
            self._doubted.clear()
            self._early = 0
            return self._clock.advance(step.fields, pending.time_ns), None
        if self._arrived_in_time(pending, step):
            predicted_ns = self._clock.advance(step.fields)
            self._watch_another_clock(pending.stamp_ns, predicted_ns, _OF_GOOD_STAMPS)
            return predicted_ns, "late timestamp" if late > 0 else "early timestamp"
        self._doubted.clear()
        if late > 0:
            return self._clock.advance(step.fields), "late timestamp"
        return self._come_early(pending.time_ns, step, late), None

    def _come_early(self, time_ns: int, step: Step, late: float) -> int:
        """Advance to a field that is early; after some of them the numbers have run ahead of the camera."""
        self._early += 1
        if self._early < _EARLY:
            return self._clock.advance(step.fields, time_ns)
        self._too_many = round(-late)
        self._clock.lock(time_ns)
        return time_ns

    def _arrived_in_time(self, pending: _Pending, step: Step) -> bool:
        if pending.now_ns is None or self._way_ns is None:
            return False
        late = self._clock.steps_to(pending.now_ns - self._way_ns) - step.fields
        return abs(late) < _IN_TIME

    def _predicted_ns(self, pending: _Pending, step: Step) -> int:
        if self._clock.locked:
            return self._clock.advance(step.fields)
        if pending.now_ns is None:
            return pending.stamp_ns
        self._clock.lock(pending.now_ns)
        return pending.now_ns

    def _learn_way(self, pending: _Pending, time_ns: int) -> None:
        if pending.now_ns is None:
            return
        way_ns = pending.now_ns - time_ns
        known_ns = self._way_ns
        self._way_ns = way_ns if known_ns is None else min(way_ns, known_ns + _WAY_GROWS_NS)

    def _lost(self, first_n: int, pending: _Pending, step: Step) -> tuple[LedgerEntry, ...]:
        count = self._n - first_n
        if not count:
            return ()
        reason = pending.interruption or (NO_SIGNAL if pending.no_signal else _gap(pending, step))
        return (never_came(first_n, count, reason),)

    def _watch_another_clock(self, time_ns: int, predicted_ns: int, agreement: "_Agreement") -> None:
        if self._doubted:
            n, before_ns = self._doubted[-1]
            if abs((time_ns - before_ns) / self._period_ns - (self._n - n)) > agreement.periods:
                self._doubted.clear()
        self._doubted.append((self._n, time_ns))
        if len(self._doubted) >= agreement.sightings:
            self._offset_ns += time_ns - predicted_ns
            self._last_ns = predicted_ns
            self._doubted.clear()


def _gap(pending: _Pending, step: Step) -> str:
    if pending.time_ns is not None and step.late is not None and abs(step.late) <= 0.5:
        return TIME_GAP
    if pending.count == step.fields:
        return SEQUENCE_GAP
    return REPEATED_PARITY if pending.time_ns is None else TIME_GAP


def _damaged(pending: _Pending, reason: str) -> _Pending:
    if pending.outcome is not Outcome.RECEIVED:
        return pending
    return replace(pending, outcome=Outcome.DAMAGED, reason=reason)


def _outcome(no_signal: str | None, damage: str | None) -> tuple[Outcome, str | None]:
    if no_signal:
        return Outcome.NO_SIGNAL, no_signal
    if damage:
        return Outcome.DAMAGED, damage
    return Outcome.RECEIVED, None
