"""Field numbering: the place of each grabbed field in the camera's endless count, and the losses before
it.
"""

import math
from collections import deque
from dataclasses import dataclass, replace
from itertools import islice
from typing import NamedTuple

from grabberd.acquisition.device import FieldOrder, GrabbedField, Signal, StreamInfo
from grabberd.acquisition.ledger import NO_SIGNAL, LedgerEntry, Outcome, never_came
from grabberd.acquisition.numbering.arrivals import Arrival, Arrivals
from grabberd.acquisition.numbering.doubts import Doubts
from grabberd.acquisition.numbering.field_clock import FieldClock
from grabberd.acquisition.numbering.paths import Paths, Seen, Step
from grabberd.acquisition.numbering.sequence_steps import SequenceSteps
from grabberd.acquisition.numbering.stamps import Stamps

_LATE = 0.75
"""Periods by which a stamp may be late before the field's time is predicted instead."""
_IN_TIME = 0.6
"""Periods after the shortest way, within which a field has arrived in time."""
_EARLY = 3
"""Fields in a row that are early by a whole one, after which the clock is wrong and not they."""
_NEW_FOR = 100
"""Fields of a stream within which its first stamps may turn out to have been late. Later on, early stamps are
those of another clock."""
_MOST_PENDING = 16
"""Fields that wait for more evidence before the likeliest path is taken, or as many as were in the driver's
buffers, where that is more, and `_CONFIRMING` after them."""
_CONFIRMING = 10
_TELLING = 6
"""Fields that have to arrive in time after a loss that nobody counts: else the program may have been late."""

TIME_GAP = "time gap"
COMPUTER_BUSY = "computer busy"
SEQUENCE_GAP = "sequence gap"
REPEATED_PARITY = "repeated parity"


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


@dataclass(frozen=True, slots=True)
class _Pending:
    """A field whose number is not settled yet; `time_ns` is None if its stamp is not believed."""

    parity: int
    stamp_ns: int
    time_ns: int | None
    doubt: str | None
    arrival: Arrival
    count: int | None
    outcome: Outcome
    reason: str | None
    no_signal: bool
    interruption: str | None
    after_standstill: bool


class FieldNumbering:
    """Numbers fields by all evidence at once: time, parity, the driver's count and the arrival.

    A field whose number is in doubt is kept back until later ones have settled it, but not for
    ever. What cannot be settled is damaged, "number uncertain by up to N". The time of a field whose stamp is
    not believed is predicted, and the reason says so.

    Args:
        info: The stream as granted. The times of a recording are taken as they are.
    """

    def __init__(self, info: StreamInfo) -> None:
        self._live = info.live
        self._has_parity = info.field_order is not FieldOrder.ONE_PARITY
        self._clock = FieldClock(1e9 / info.rate_hz, exact=not info.live)
        self._stamps = Stamps(info)
        self._arrivals = Arrivals(info)
        self._sequence = (
            SequenceSteps(info.field_order is FieldOrder.ALTERNATE) if info.counts_losses else None
        )
        self._n = -1
        self._paths: Paths | None = None
        self._pending: deque[_Pending] = deque()
        self._interruption: str | None = None
        self._early = self._too_many = 0
        self._doubts = Doubts(self._arrivals, 1e9 / info.rate_hz)
        self._period_ns = 1e9 / info.rate_hz
        self._buffered = _fields_in(info)
        self._waited = 0
        self._most_pending = max(_MOST_PENDING, self._buffered + _CONFIRMING)
        self._run = self._run_doubt = self._anchor_doubt = 0

    def interrupt(self, reason: str) -> list[Numbered]:
        """Note that the stream stopped: fields missing before the next one were lost for this reason.

        Returns:
            The fields that were still in doubt.
        """
        settled = self.settle()
        self._interruption = reason
        if self._sequence is not None:
            self._sequence.forget()
        return settled

    def stood_still(self, time_ns: int) -> None:
        """Note that nobody asked for fields for some time, which fills the driver's buffers."""
        if time_ns > (self._buffered - 1) * self._period_ns:
            # The fields that are lost come after those that were in the buffers.
            self._waited = self._buffered + 1

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
        absent = NO_SIGNAL if signal is Signal.ABSENT else no_picture
        pending = self._look(grabbed, now_ns, *_outcome(absent, grabbed.damage or damage))
        self._pending.append(replace(pending, no_signal=signal is Signal.ABSENT))
        self._waited = max(self._waited - 1, 0)
        self._interruption = None
        if self._paths is None:
            self._paths = Paths(pending.parity if self._has_parity else None, exact=not self._live)
            return [self._first(self._pending.popleft())]
        self._paths.see(self._seen(pending))
        settled: list[Numbered] = []
        while self._pending and (self._certain(self._paths) or len(self._pending) > self._most_pending):
            settled.append(self._settle_oldest(self._paths))
        return settled

    def settle(self) -> list[Numbered]:
        """Number the fields that are in doubt by what is known now."""
        return [self._settle_oldest(self._paths) for _ in range(len(self._pending)) if self._paths]

    def _certain(self, paths: Paths) -> bool:
        """True if the oldest field's number will not change any more.

        That of a late field may, until one that is in time shows whether any are missing.
        """
        if self._run:
            return True
        if not paths.settled():
            return False
        if self._pending[0].arrival.time_ns is None:
            return True
        steps = paths.best.steps
        anchor = next((i for i, step in enumerate(steps) if self._in_time(step)), None)
        if anchor is None or not paths.settled(anchor + 1):
            return False
        in_turn = zip(islice(self._pending, anchor + 1), steps, strict=False)
        lost = sum(_uncounted(pending, step) for pending, step in in_turn)
        after = steps[anchor + 1 : anchor + 1 + _TELLING]
        if lost and not self._arrivals.tells_of_stamps:
            if len(after) < _TELLING:
                return False
            self._anchor_doubt = 0 if all(one.arrived_in_time for one in after) else lost
        self._run, self._run_doubt = anchor + 1, max(lost if anchor else 0, self._anchor_doubt)
        return True

    def _in_time(self, step: Step) -> bool:
        if step.arrived_in_time:
            return True
        return step.late is not None and abs(step.late) <= (_LATE if self._has_parity else 0.5)

    def _look(
        self, grabbed: GrabbedField, now_ns: int | None, outcome: Outcome, reason: str | None
    ) -> _Pending:
        parity = grabbed.field.parity
        time_ns, doubt = self._stamps.look(grabbed.time_ns, now_ns, interrupted=bool(self._interruption))
        arrival = self._arrivals.look(parity, now_ns)
        if doubt is None:
            self._arrivals.compare(arrival, grabbed.time_ns)
        return _Pending(
            parity,
            grabbed.time_ns,
            None if doubt else time_ns,
            doubt,
            arrival,
            # Of every field, also where time decides: it learns from each, and remembers the last count.
            self._sequence.step(grabbed.sequence, parity) if self._sequence else None,
            outcome,
            reason,
            no_signal=False,
            interruption=self._interruption,
            after_standstill=self._waited > 0,
        )

    def _seen(self, pending: _Pending) -> Seen:
        return Seen(
            stamp=self._steps_to(pending.time_ns),
            arrival=self._steps_to(self._arrivals.exposed_ns(pending.arrival)),
            burst=pending.arrival.burst,
            joined=pending.arrival.joined,
            counted=pending.count,
            parity=pending.parity if self._has_parity else None,
            excused=pending.interruption is not None,
        )

    def _steps_to(self, time_ns: int | None) -> float | None:
        return self._clock.steps_to(time_ns) if time_ns is not None and self._clock.locked else None

    def _first(self, pending: _Pending) -> Numbered:
        self._n = 0
        time_ns = pending.arrival.time_ns if pending.time_ns is None else pending.time_ns
        if time_ns is not None:
            self._clock.lock(time_ns)
            self._arrivals.learn(pending.arrival, time_ns)
        return self._numbered(pending, pending.stamp_ns if time_ns is None else time_ns, (), pending.doubt)

    def _settle_oldest(self, paths: Paths) -> Numbered:
        pending = self._pending.popleft()
        uncertain_by = 0 if self._run else self._range(paths)
        step = paths.settle()
        first_lost = self._n + 1
        self._n += step.fields
        time_ns, doubt = self._come_to(pending, step)
        lost = self._lost(first_lost, pending, step)
        if step.wrong_parity:
            pending = _damaged(pending, "parity contradicts time")
        contradiction = _contradiction(pending, step)
        uncertain_by = max(uncertain_by, step.doubt, self._too_many, self._doubt_of_run(), contradiction)
        self._too_many = 0
        uncertain_by = self._doubts.of(self._n, time_ns, step, pending.arrival, uncertain_by)
        if uncertain_by:
            pending = _damaged(pending, f"number uncertain by up to {uncertain_by}")
        else:
            self._arrivals.learn(pending.arrival, time_ns)
        return self._numbered(pending, time_ns, lost, doubt)

    def _doubt_of_run(self) -> int:
        """Number of fields by which one may be off that is late, and settled with those after it."""
        if not self._run:
            return 0
        self._run -= 1
        if self._run:
            return self._run_doubt
        doubt, self._anchor_doubt = self._anchor_doubt, 0
        return doubt

    def _range(self, paths: Paths) -> int:
        """Number of fields by which one may be off whose number is settled before it is certain."""
        step = paths.best.steps[0]
        if step.arrived is None or self._in_time(step):
            return 0 if paths.settled() else paths.spread
        return max(paths.spread, math.ceil(step.arrived))

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
            self._stamps.doubted(pending.stamp_ns, predicted_ns)
            return predicted_ns, pending.doubt
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
            return self._come_in_time(pending, step, late)
        self._stamps.fits()
        if late > 0:
            return self._clock.advance(step.fields), "late timestamp"
        return self._come_early(pending.time_ns, step, late), None

    def _come_in_time(self, pending: _Pending, step: Step, late: float) -> tuple[int, str | None]:
        """Advance to a field that arrived in time, although its stamp is off."""
        if late < 0 and self._n < _NEW_FOR:
            return self._begin_again(pending.time_ns or 0, step)
        predicted_ns = self._clock.advance(step.fields)
        self._stamps.off(pending.stamp_ns, predicted_ns)
        return predicted_ns, "late timestamp" if late > 0 else "early timestamp"

    def _begin_again(self, time_ns: int, step: Step) -> tuple[int, str | None]:
        """Advance to a field of a new stream that is early; after some of them the first stamps were late."""
        self._early += 1
        if self._early < _EARLY:
            return self._clock.advance(step.fields), "early timestamp"
        self._clock.lock(time_ns)
        self._arrivals.forget()
        return time_ns, None

    def _come_early(self, time_ns: int, step: Step, late: float) -> int:
        """Advance to a field that is early; after some of them the numbers have run ahead of the camera."""
        self._early += 1
        if self._early < _EARLY:
            return self._clock.advance(step.fields, time_ns)
        self._too_many = round(-late)
        self._clock.lock(time_ns)
        return time_ns

    def _arrived_in_time(self, pending: _Pending, step: Step) -> bool:
        steps = self._steps_to(self._arrivals.exposed_ns(pending.arrival))
        return steps is not None and abs(steps - step.fields) < _IN_TIME

    def _predicted_ns(self, pending: _Pending, step: Step) -> int:
        if self._clock.locked:
            return self._clock.advance(step.fields)
        if pending.arrival.time_ns is None:
            return pending.stamp_ns
        self._clock.lock(pending.arrival.time_ns)
        return pending.arrival.time_ns

    def _lost(self, first_n: int, pending: _Pending, step: Step) -> tuple[LedgerEntry, ...]:
        count = self._n - first_n
        if not count:
            return ()
        gap = COMPUTER_BUSY if pending.after_standstill else _gap(pending, step)
        reason = pending.interruption or (NO_SIGNAL if pending.no_signal else gap)
        return (never_came(first_n, count, reason),)


def _contradiction(pending: _Pending, step: Step) -> int:
    """Number of fields by which stamp and count differ, where no arrival tells which of them is wrong."""
    if pending.count is None or pending.interruption or step.arrived_in_time:
        return 0
    return abs(pending.count - step.fields)


def _uncounted(pending: _Pending, step: Step) -> int:
    """Number of fields that were lost before one without the driver's notice."""
    if pending.interruption:
        return 0
    return abs(step.fields - (1 if pending.count is None else pending.count))


def _gap(pending: _Pending, step: Step) -> str:
    if pending.time_ns is not None and step.late is not None and abs(step.late) <= 0.5:
        return TIME_GAP
    if pending.count == step.fields:
        return SEQUENCE_GAP
    return REPEATED_PARITY if pending.time_ns is None else TIME_GAP


def _fields_in(info: StreamInfo) -> int:
    """Number of fields that the driver's buffers hold."""
    woven = info.field_order in (FieldOrder.TOP_FIRST, FieldOrder.BOTTOM_FIRST)
    return info.buffers * (2 if woven else 1)


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
