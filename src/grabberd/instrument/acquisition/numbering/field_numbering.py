"""Field numbering: the number of each grabbed field among the camera's fields, and what was lost."""

import math
from collections import deque
from typing import NamedTuple

from grabberd.core.field import FieldOrder
from grabberd.core.ledger import (
    NO_SIGNAL,
    LedgerEntry,
    LedgerEvent,
    Outcome,
    Rebase,
    numbers_off,
    numbers_unsure,
)
from grabberd.instrument.acquisition.device import GrabbedField, Signal, StreamInfo
from grabberd.instrument.acquisition.numbering.arrivals import Arrival, Arrivals, SequenceSteps
from grabberd.instrument.acquisition.numbering.causes import Causes, doubtful
from grabberd.instrument.acquisition.numbering.pace import SUSPECTED, Came, Pace
from grabberd.instrument.acquisition.numbering.paths import Paths, Step
from grabberd.instrument.acquisition.numbering.pending import (
    Pending,
    StreamStart,
    contradiction,
    outcome_of,
)
from grabberd.instrument.acquisition.numbering.settling import Doubt, Doubts, Evidence, Settling
from grabberd.instrument.acquisition.numbering.stamps import Stamps
from grabberd.instrument.acquisition.numbering.standstill import COMPUTER_BUSY, RecentStandstills, Standstill
from grabberd.instrument.acquisition.numbering.timing import Timing
from grabberd.instrument.acquisition.numbering.turns import Turns


class Numbered(NamedTuple):
    """A grabbed field's number, time and outcome.

    Attributes:
        n: Nominal steps since numbering began, lost fields included; the first field is 0.
        time_ns: Middle of the exposure, smoothed if the stream is live.
        outcome: Received, damaged or no_signal.
        reason: Reason for the outcome; for a received field None, or why its time had to be predicted.
        lost_before: Fields missing between the previous field and this one: lost, or without a signal, since
            some drivers deliver nothing then.
        rebases: Changes of the base of numbers and times, from this field on.
    """

    n: int
    time_ns: int
    outcome: Outcome
    reason: str | None
    lost_before: tuple[LedgerEntry, ...]
    rebases: tuple[LedgerEvent, ...] = ()


_MOST_PENDING = 16
"""Fields that wait for more evidence before the likeliest path is taken, or as many as the driver's buffers
hold if that is more, and `_CONFIRMING` after them."""
_CONFIRMING = 10
_TURNED = "the camera has gone on in the other phase"
_OTHER_PHASE = "if they are not, the camera has gone on in the other phase"
_KEEPS_ON = 8
"""Fields in a row that a driver counts too many for, after which it keeps doing so."""


class FieldNumbering:
    """Numbers fields by all evidence together: time, parity, the driver's count and the arrival.

    A field whose number is in doubt is held until later ones have settled it, for a limited time. If that
    fails, it is damaged, "number uncertain by up to N". The time of a field whose stamp is not trusted is
    predicted, and the reason says so.

    Args:
        info: The stream as granted. The times of a recording are taken as they are.
        since_ns: When the stream was requested, on the clock of the arrivals; None if unknown.

    Attributes:
        returned_ns: When the buffer before the next field was returned; None: just before that came.
        of_driver: Standstill right before the next field, if the driver may have stood still as well; to be
            set before that field is numbered. Those that were filled before it come first.
    """

    def __init__(self, info: StreamInfo, since_ns: int | None = None) -> None:
        self._live = info.live
        self._has_parity = info.field_order.has_parity
        self._pace = Pace(info)
        self._stamps = Stamps(info, self._pace)
        self._arrivals = Arrivals(info, self._pace)
        self._sequence = (
            SequenceSteps(info.field_order is FieldOrder.ALTERNATE) if info.counts_losses else None
        )
        self._settling = Settling(self._arrivals, info.field_order, has_own_pace=self._pace.is_followed)
        self._timing = Timing(info, self._pace, self._stamps, self._arrivals, since_ns)
        self._doubts = Doubts(self._arrivals, self._timing)
        self._turns = Turns(self._pace, self._arrivals.in_turn)
        self._causes = Causes(self._arrivals, self._pace, info.buffered_ns)
        self._n = -1
        self._parity = 0
        self._miscounted = False
        self._phase = self._too_high_by = 0
        self._overcounted = 0
        self._paths: Paths | None = None
        self._pending: deque[Pending] = deque()
        self._buffered, self._most_waiting = info.buffers, 2 * info.buffers + 1
        self._most_pending = max(_MOST_PENDING, self._buffered + _CONFIRMING)
        self._start = StreamStart(info, self._arrivals, since_ns, self._most_pending, self._pace)
        self._interruption: str | None = None
        self._since_ns: int | None = None
        self._standstill = COMPUTER_BUSY
        self.returned_ns: int | None = None
        self.of_driver: Standstill | None = None
        self._stood = RecentStandstills(self._most_waiting, self._arrivals.in_turn)
        self._waited = self._uncertain_by = 0

    @property
    def rate_hz(self) -> float:
        """Fields per second of the camera, on which numbers and times are based."""
        return self._pace.rate_hz

    @property
    def steady_hz(self) -> float | None:
        """Latest steady rate of a progressive camera; None if there was none."""
        return self._pace.steady_hz

    def interrupt(self, reason: str) -> list[Numbered]:
        """Note that the stream stopped: fields missing before the next one were lost for this reason.

        Returns:
            The fields that were still in doubt.
        """
        settled = self.settle()
        self._interruption = reason
        self._arrivals.empty()
        if self._sequence is not None:
            self._sequence.forget()
        return settled

    def resume(self, since_ns: int | None) -> None:
        """Note that the stream was requested again: no field to come was exposed before `since_ns`."""
        self._since_ns = since_ns

    def stood_still(self, time_ns: int, reason: str = COMPUTER_BUSY) -> None:
        """Note that no fields were taken for some time, which fills the driver's buffers.

        Args:
            time_ns: Time since the buffers were empty.
            reason: Reason for fields lost meanwhile.
        """
        if time_ns > (self._buffered - 1 - self._arrivals.in_turn) * self._pace.period_ns:
            # Fields are lost after those that were in the buffers, of which some may be missing. So is what
            # has begun while all were full.
            self._standstill, self._waited = reason, self._most_waiting

    def number(
        self,
        grabbed: GrabbedField,
        signal: Signal = Signal.UNKNOWN,
        damage: str | None = None,
        now_ns: int | None = None,
        no_picture: str | None = None,
        *,
        in_time: bool = True,
    ) -> list[Numbered]:
        """Number the next field.

        Args:
            grabbed: Its time, parity, sequence and damage are used, not its grey values.
            signal: The driver's last report.
            damage: Damage found in its content, in addition to the driver's report.
            now_ns: Arrival, on the clock that a live stream's times should use: no field is in the future.
            no_picture: Picture that the grabber substituted, as found in its content.
            in_time: False if it may have waited in the driver's buffers, as far as the program knows.

        Returns:
            The fields that are settled now, the oldest first; none while this one is in doubt.
        """
        absent = NO_SIGNAL if signal is Signal.ABSENT else no_picture
        outcome = outcome_of(absent, grabbed.damage or damage)
        pending = self._look(grabbed, now_ns, *outcome, no_signal=signal is Signal.ABSENT, in_time=in_time)
        settled = self._follow_pace() if self._has_another_pace(pending) else []
        self._waited, self.of_driver = max(self._waited - 1, 0), None
        self._interruption = None
        if self._paths is not None:
            return settled + self._go_on(self._paths, pending)
        self._start.add(pending)
        return self._begin() if self._start.is_over else []

    def skip(self, parity: int, now_ns: int) -> None:
        """Note a field that the driver has handed over before: it has no number, but it had a buffer."""
        self._arrivals.look(parity, now_ns, self.returned_ns)

    def settle(self) -> list[Numbered]:
        """Number the fields in doubt by the present evidence."""
        settled = self._begin() if self._paths is None and self._start.fields else []
        while self._pending and self._paths is not None:
            self._settling.is_settled(self._pending, self._paths)  # this also notes the doubt
            settled.append(self._settle_oldest(self._paths))
        return settled

    def _has_another_pace(self, pending: Pending) -> bool:
        time_ns, arrived_ns = pending.time_ns, pending.arrival.time_ns
        way_ns = None if time_ns is None or arrived_ns is None else arrived_ns - time_ns
        # Stamps that are not times of arrivals do not show a wait.
        may_have_waited = not self._arrivals.tells_of_stamps and (
            pending.arrival.burst or not pending.in_time
        )
        has_waited = may_have_waited or pending.interruption is not None
        return self._pace.see(Came(time_ns, pending.count, way_ns, has_waited))

    def _follow_pace(self) -> list[Numbered]:
        """Continue by the camera's present pace; fields in doubt are numbered by the driver's count."""
        settled = []
        if self._paths is None:
            first, *waiting = self._start.fields
            settled = [self._begin_with(first, 0, 0)]
        else:
            waiting, self._pending = list(self._pending), deque()
        settled += [self._count(one, len(waiting) - at) for at, one in enumerate(waiting)]
        self._arrivals.learn_anew(self._pace.ways_ns)
        self._timing.follow_pace(self._doubts.end_by_count(self._n, self._pace.before_ns))
        self._paths = Paths(None, self._arrivals.way)
        return settled

    def _count(self, pending: Pending, back: int) -> Numbered:
        """Number a field by the driver's count, since its time is no evidence between two paces; `back`
        fields followed it.
        """
        step = Step(pending.count or 1, None, None)
        self._n += step.fields
        time_ns = pending.stamp_ns if pending.time_ns is None else pending.time_ns
        lost = self._causes.lost_before(pending, step, self._n, time_ns)
        if lost_uncounted := self._pace.unexplained(back):
            pending = pending.uncertain(lost_uncounted)
        return self._numbered(pending, time_ns, lost, None)

    def _begin(self) -> list[Numbered]:
        """Number the first fields, now that it is known how late the first one was."""
        first, *others = self._start.fields
        late_by = 0 if self._start.is_known else self._start.may_be_late_by
        settled = [self._begin_with(first, self._start.late_ns, late_by)]
        assert self._paths is not None, "it has just begun"
        return settled + [one for pending in others for one in self._go_on(self._paths, pending)]

    def _begin_with(self, first: Pending, late_ns: int, late_by: int) -> Numbered:
        """Number the first field, given the delay of its stamp and the fields by which it may be late."""
        time_ns, doubt = self._timing.begin(first, late_ns, may_be_late=late_by > 0)
        self._doubts.begin(time_ns, late_by)
        self._n, self._parity = 0, first.parity
        self._phase = first.parity
        self._paths = Paths(first.phase, self._arrivals.way, exact=not self._live)
        return self._numbered(first.uncertain(late_by) if late_by else first, time_ns, (), doubt)

    def _go_on(self, paths: Paths, pending: Pending) -> list[Numbered]:
        self._pending.append(pending)
        self._bridge(pending)
        stamp = self._timing.steps_to(pending.time_ns)
        arrival = self._timing.steps_to(pending.arrival.time_ns)
        paths.see(pending.seen(stamp, arrival))
        settled = []
        while self._pending and self._goes_on(paths):
            settled.append(self._settle_oldest(paths))
        return settled

    def _bridge(self, pending: Pending) -> None:
        """Learn the camera's rate from a gap for which it is not known well enough: by the count, if there is
        one, else so that the fields keep their phase.
        """
        tells = self._arrivals.tells_of_stamps
        time_ns = pending.time_ns if tells else self._arrivals.exposed_ns(pending.arrival)
        steps = self._timing.steps_to(time_ns)
        if len(self._pending) > 1 or steps is None or not pending.in_time or pending.interruption:
            return
        fields = pending.count
        if fields is None:
            turned = self._has_parity and round(steps) % 2 != (pending.parity - self._parity) % 2
            fields = round(steps) + (turned if steps > round(steps) else -turned)
        self._timing.bridge(fields, steps, is_counted=pending.count is not None)

    def _goes_on(self, paths: Paths) -> bool:
        """True if the oldest field has its number, or has waited for it as long as allowed."""
        if self._pace.may_change and len(self._pending) < SUSPECTED:
            return False
        if len(self._pending) > self._most_pending:
            return True
        oldest, *after = self._pending
        is_awaited = self._turns.is_awaited(oldest, paths.best.steps[0], after)
        return not is_awaited and self._settling.is_settled(self._pending, paths)

    def _longest_wait(self, arrival: Arrival) -> int:
        """Number of fields for which the first one after an interruption may have waited, by its arrival."""
        exposed_ns = self._arrivals.exposed_ns(arrival)
        if not self._interruption or exposed_ns is None or self._arrivals.tells_of_stamps:
            return 0
        since_last = self._timing.steps_to(exposed_ns)
        longest = math.inf if since_last is None else since_last - 1
        if self._since_ns is not None:
            longest = min(longest, (exposed_ns - self._since_ns) / self._pace.period_ns)
        return max(math.ceil(longest), 0) if math.isfinite(longest) else self._buffered

    def _look(
        self,
        grabbed: GrabbedField,
        now_ns: int | None,
        outcome: Outcome,
        reason: str | None,
        *,
        no_signal: bool,
        in_time: bool,
    ) -> Pending:
        parity = grabbed.field.parity
        time_ns, doubt = self._stamps.look(grabbed.time_ns, now_ns, interrupted=bool(self._interruption))
        arrival = self._arrivals.look(parity, now_ns, self.returned_ns)
        return Pending(
            parity,
            parity if self._has_parity else None,
            grabbed.time_ns,
            None if doubt else time_ns,
            doubt,
            arrival,
            doubt is None and self._arrivals.compare(arrival, grabbed.time_ns),
            grabbed.sequence,
            # For every field, even if time decides: it learns from each, and remembers the last count.
            self._sequence.step(grabbed.sequence, parity) if self._sequence else None,
            self._sequence is not None and self._sequence.restarted,
            outcome,
            reason,
            no_signal,
            in_time,
            may_have_waited=0 if in_time else self._longest_wait(arrival),
            interruption=self._interruption,
            standstill=self._standstill if self._waited > 0 else None,
            of_driver=self._stood.before_next(self.of_driver, in_time=in_time),
            may_be_held=self.of_driver is not None,
        )

    def _settle_oldest(self, paths: Paths) -> Numbered:
        pending = self._pending.popleft()
        doubt_of_number = self._settling.settle_next(pending, paths)
        step = paths.settle()
        self._n += step.fields
        unsure_by = self._unsure_by(pending, step)
        time_ns, doubt = self._timing.come_to(pending, step, self._n)
        lost = self._causes.lost_before(pending, step, self._n, time_ns)
        if late := self._timing.take_late():
            self._arrivals.way = self._arrivals.way.longer_by(late)
            paths.lengthen_way(late)
            self._doubts.shift(round(late * self._pace.period_ns))
        if step.wrong_parity:
            pending = pending.damaged("parity contradicts time")
        was_open, before = self._doubts.open, self._uncertain_by
        out_by = self._turns.out_by(pending, self._pending)
        out_of_place_by = max(out_by, self._causes.held_by)
        evidence = self._evidence(pending, step, doubt_of_number, paths, out_of_place_by)
        evidence = evidence._replace(stamped=doubt is None)
        uncertain_by = self._doubts.of(self._n, time_ns, step, pending.arrival, evidence)
        rebases = self._rebases(pending, step, is_certain=not uncertain_by, ends_doubt=was_open)
        if unsure_by:
            rebases = (*rebases, numbers_unsure(self._n, unsure_by))
        if uncertain_by:
            is_met = pending.arrival.time_ns is None or evidence.way_is_known
            if was_open or not is_met or doubt_of_number.of_loss or evidence.ahead_by or out_by:
                lost = doubtful(lost, uncertain_by)
        else:
            self._learn(pending, time_ns, paths)
            # After an uncertain number they may as well be missing before it, unless they are counted.
            by = max(unsure_by, 0 if pending.count == step.fields else before)
            lost = doubtful(lost, by) if by else lost
        self._uncertain_by = uncertain_by
        if by := max(uncertain_by, unsure_by):
            pending = pending.uncertain(by)
        return self._numbered(pending, time_ns, lost, doubt, rebases)

    def _unsure_by(self, pending: Pending, step: Step) -> int:
        """Fields by which nobody can tell how many are missing: the camera's rate is known only so well."""
        if step.fields in {1, pending.count} or pending.interruption or not self._live:
            return 0
        if step.late is None and step.arrived is None:
            return 0
        keeps_phase = self._has_turned(pending, step) is False and self._doubts.keeps_phase
        apart = 2 if keeps_phase else 1
        return int(self._timing.spread(step.fields) // apart) * apart

    def _evidence(self, pending: Pending, step: Step, doubt: Doubt, paths: Paths, out_by: int) -> Evidence:
        """Evidence about a field's number in addition to its step and fields by which it is out of turn."""
        ahead = self._timing.take_ahead()
        if ahead < 0:
            paths.lengthen_way(ahead)  # each way was learned while all numbers were too low
        elif ahead > 0:
            paths.take_way(self._arrivals.way)  # since the last certain one, while they were too high
        # One more: the early fields before it have moved the clock by part of a period.
        too_many = math.ceil(ahead) + 1 if ahead else 0
        # It has waited as long as allowed, and the cause of its delay is still unknown.
        unexplained = self._pace.unexplained(len(self._pending)) if self._pace.may_change else 0
        of_itself = max(
            step.doubt,
            too_many,
            contradiction(pending, step),
            pending.may_have_waited,
            unexplained,
        )
        return Evidence(
            max(doubt.fields, of_itself, out_by),
            way_is_known=paths.best.way.is_known,
            in_time=step.arrived_in_time and pending.in_time,
            ahead_by=round(ahead),
            of_loss=doubt.of_loss or pending.may_have_waited > 0,
            stamps_follow=any(kind is Rebase.CLOCK for kind, _ in self._timing.rebases),
            of_place=(doubt.of_place or out_by > 0) and not of_itself,
            counted=pending.count,
            turned=self._has_turned(pending, step),
            is_older=self._turns.is_older,
        )

    def _has_turned(self, pending: Pending, step: Step) -> bool | None:
        """True if the camera goes on in the other phase with a field; None if its fields have no phase."""
        if not self._has_parity:
            return None
        return not step.wrong_parity and pending.parity != (self._parity + step.fields) % 2

    def _learn(self, pending: Pending, time_ns: int, paths: Paths) -> None:
        """Learn the shortest way from a field whose number is certain."""
        self._arrivals.learn(pending.arrival, time_ns, waited=not pending.in_time)
        if paths.best.way.is_known and not self._arrivals.way.is_known:
            self._arrivals.way = paths.best.way
        paths.confirm_way(self._arrivals.way)

    def _rebases(
        self, pending: Pending, step: Step, *, is_certain: bool, ends_doubt: bool
    ) -> tuple[LedgerEvent, ...]:
        """Changes of the base of numbers and times, from this field on.

        Whether the count has skipped, and the camera goes on in the other phase, is only known with a certain
        number, unless a driver keeps counting too many. After a doubt that the times of arrivals have ended,
        the other phase may as well mean that the numbers are off by one.
        """
        found, self._timing.rebases = self._timing.rebases, []
        self._overcounted = self._overcounted + 1 if pending.overcounts(step.fields) else 0
        skipped = self._overcounted >= (1 if is_certain else _KEEPS_ON)
        knew, self._miscounted = self._miscounted, pending.recounted or skipped
        if self._miscounted and not knew:  # only once, even if a driver always counts wrongly
            happened = "restarted" if pending.recounted else "skipped"
            found.append((Rebase.COUNT, f"the driver's count has {happened}, to {pending.sequence}"))
        too_high_by = self._doubts.too_high_by
        self._too_high_by += too_high_by
        if self._has_parity and is_certain and not step.wrong_parity:
            # Numbers that are off by an odd number are explained by that alone.
            before, self._phase = self._phase, (pending.parity - self._n + self._too_high_by) % 2
            if self._phase != before:
                tells = self._arrivals.tells_of_stamps and not self._arrivals.ticks_over(1.0)
                is_unsure = ends_doubt and not tells
                unsure = numbers_unsure(self._n, 1, _OTHER_PHASE)
                found.append((unsure.kind, unsure.reason) if is_unsure else (Rebase.PHASE, _TURNED))
        self._parity = (self._parity + step.fields) % 2 if step.wrong_parity else pending.parity
        events = tuple(LedgerEvent(self._n, *one) for one in found)
        return (*events, numbers_off(self._n, too_high_by)) if too_high_by else events

    def _numbered(
        self,
        pending: Pending,
        time_ns: int,
        lost: tuple[LedgerEntry, ...],
        doubt: str | None,
        rebases: tuple[LedgerEvent, ...] = (),
    ) -> Numbered:
        reason = pending.reason
        if pending.outcome is Outcome.RECEIVED and doubt:
            reason = f"time predicted ({doubt})"
        return Numbered(self._n, time_ns, pending.outcome, reason, lost, rebases)
