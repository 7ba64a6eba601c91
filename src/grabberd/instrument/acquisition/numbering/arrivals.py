"""Arrivals of a stream's fields: when each came, with which others, after which delay, and by which count."""

import math
from collections import deque
from collections.abc import Iterable, Sequence
from itertools import islice
from typing import NamedTuple

from grabberd.core.field import FieldOrder
from grabberd.instrument.acquisition.device import StreamInfo
from grabberd.instrument.acquisition.numbering.pace import Pace

_BURST = 0.3
"""Periods between arrivals, below which fields have waited in the driver's buffers."""
_VARIATIONS = 4
"""Changes of the time from stamp to arrival after which it is not constant: setting a clock causes one."""
_REGULAR, _ALIKE = 8, 0.25
"""Number of fields by which those that come by the shortest way, within so many periods, outnumber the later
ones once it is known. While a computer is overloaded every field waits, each for another time."""
_GROWS = 0.001
"""Growth of the shortest way from field to field, in periods: it follows a computer that becomes slower."""


_COMES = 1.0
"""Periods from the begin to the end of a field on its way."""
_BARELY = 0.4
"""Periods after a buffer is returned within which a field may have begun just before."""
_READ_OUT = 1.0
"""Periods from the middle of an exposure until a field can have come: it has to be read out."""
_LONG, _KEPT_BACK = 4, 3
"""Fields lost in a row that are hardly lost on the bus, if the next one came in the buffer that was returned
first; and number of buffers that a driver may have kept back then, or have returned without a field."""
_OF_GRID = 32
"""Stamps whose common grid is looked for."""
_ON_GRID = 0.03
"""Periods by which a stamp may be off its grid."""


def _grid_ns(steps_ns: Iterable[int], period_ns: float, on_grid: float = _ON_GRID) -> float:
    """Greatest time of which all steps from stamp to stamp are multiples, to so many periods; nearly 0 for
    stamps on no grid.

    Arrivals stamped by a clock that ticks differ from the arrivals themselves by up to a tick.
    """
    grid_ns = 0.0
    for step_ns in steps_ns:
        rest_ns = abs(float(step_ns))
        while rest_ns > on_grid * period_ns:
            grid_ns, rest_ns = rest_ns, abs(grid_ns - round(grid_ns / rest_ns) * rest_ns)
    return grid_ns


_EXACTLY, _COMPARABLE, _OWN = 2e-4, 0.7, 2e-4
"""Periods by which stamps of a clock that ticks are off its ticks; least length of a tick that they skip; and
difference up to which it is that of the fields themselves."""
_BEATS = 0.1
"""Periods by which such a tick differs from the fields if it falls behind them slowly."""
_COARSEST = 0.9
"""Periods of a grid beyond which it is that of the fields themselves."""


class Way(NamedTuple):
    """Shortest way from a field's exposure to its arrival.

    Attributes:
        periods: Its length; infinite before the first field.
        regular: Number of fields that have come by it, less those that have come later.
    """

    periods: float = math.inf
    regular: int = 0

    @property
    def is_known(self) -> bool:
        """True once fields have come regularly, so that none can come by a much shorter way."""
        return self.regular >= _REGULAR

    def longer_by(self, periods: float) -> "Way":
        """The same, where all exposures turn out to have been so much earlier."""
        return self._replace(periods=self.periods + periods)

    def is_far_longer_than(self, periods: float) -> bool:
        """True if a way of so many periods is much shorter."""
        return periods < self.periods - _ALIKE

    def after(self, periods: float, *, joined: bool = False, waited: bool = False) -> "Way":
        """The same after one more field, which has come by such a way.

        Fields joined in one buffer are as much evidence as a single one, and one that may have waited for the
        program is none of a computer that becomes slower.
        """
        shortest = min(periods, self.periods + _GROWS * (not waited))
        if self.is_far_longer_than(periods):
            return Way(shortest, 1)
        if self.is_known or joined:  # a known one is not affected by late fields
            return Way(shortest, self.regular)
        in_time = periods < self.periods + _ALIKE
        return Way(shortest, self.regular + 1 if in_time else max(self.regular - 1, 0))


class Arrival(NamedTuple):
    """Arrival of one field.

    Attributes:
        time_ns: Earliest possible time of its arrival; None if that is no evidence.
        burst: True if it came right after the one before.
        joined: True if it came in one buffer with the one before.
        freed_ns: When the buffer that it came in was free again, if all were filled before; also the next
            ones, as a driver may keep some back.
    """

    time_ns: int | None
    burst: bool
    joined: bool
    freed_ns: tuple[int, ...] = ()


class Arrivals:
    """Arrivals, and the shortest way from a field's exposure to its arrival.

    Args:
        info: The stream as granted. Fields of a recording, and of a source that waits for its reader, arrive
            whenever they are taken.
        pace: Of the camera.

    Attributes:
        in_turn: Number of fields of a buffer.
        way: Shortest way of a field so far.
    """

    def __init__(self, info: StreamInfo, pace: Pace) -> None:
        self._keeps_pace = info.live and not info.waits_for_reader
        self._pace = pace
        self._waiting_parity = {FieldOrder.TOP_FIRST: 0, FieldOrder.BOTTOM_FIRST: 1}.get(info.field_order)
        self._before_ns: int | None = None
        self._dequeued_ns: int | None = None
        self.in_turn = 1 if self._waiting_parity is None else 2
        self._returned_ns: deque[int] = deque(maxlen=max(info.buffers // self.in_turn, 1))
        self._holds_one = False
        self.way = Way()
        self._stamped: tuple[int, int, int] | None = None
        self._variations = 0
        self._steps_ns: deque[int] = deque(maxlen=_OF_GRID)
        self._buffer_steps_ns: deque[int] = deque(maxlen=_OF_GRID)
        self._buffer_ns = 0

    @property
    def tells_of_stamps(self) -> bool:
        """True once stamps are known to be independent of the arrivals: they vary against them."""
        return self._variations >= _VARIATIONS

    @property
    def grid(self) -> float:
        """Periods by which stamps differ from arrivals because their clock ticks; 0 for stamps on no grid."""
        return self.tick if self.tick < _COARSEST else 0.0

    @property
    def tick(self) -> float:
        """Periods of the grid that stamps are on, which may be that of the fields themselves."""
        return _grid_ns(self._steps_ns, self._pace.period_ns) / self._pace.period_ns

    def ticks_over(self, periods: float) -> bool:
        """True if stamps differ by so much because their clock ticks about as often as fields come.

        They fall back behind the fields, or run ahead of them, for hundreds of fields, and then skip a tick.
        """
        tick = self._other_tick
        return tick > _COMPARABLE and abs(periods) <= min(tick, 1.0) + _ON_GRID

    @property
    def beats(self) -> bool:
        """True if stamps go to and fro by a tick, which takes hundreds of fields."""
        tick = self._other_tick
        return tick > _COMPARABLE and abs(tick - round(tick)) < _BEATS

    @property
    def _other_tick(self) -> float:
        """Periods of the grid that the stamps of buffers are on; 0 if it is that of the fields themselves."""
        tick = _grid_ns(self._buffer_steps_ns, self._pace.period_ns, _EXACTLY) / self._pace.period_ns
        return 0.0 if abs(tick - round(tick)) < _OWN else tick

    def compare(self, arrival: Arrival, stamp_ns: int) -> bool:
        """Compare an arrival with its field's stamp, if that is trusted.

        Returns:
            True if the stamp may be the time of the arrival, as those before it may.
        """
        if arrival.time_ns is None:
            return False
        varied = False
        if self._stamped is not None:
            newest_ns, before_ns, way_ns = self._stamped
            self._steps_ns.append(stamp_ns - before_ns)
            if not arrival.joined:
                self._buffer_steps_ns.append(stamp_ns - self._buffer_ns)
            varied = self._varies(abs(arrival.time_ns - stamp_ns - way_ns))
            # Stamps that stand still or run backward also vary, but are no evidence; nor is the next one.
            ahead = min(stamp_ns, before_ns) >= newest_ns - _BURST * self._pace.period_ns
            self._variations += varied and ahead and stamp_ns - before_ns > _BURST * self._pace.period_ns
            newest_ns = max(newest_ns, stamp_ns)
        else:
            newest_ns = stamp_ns
        self._stamped = newest_ns, stamp_ns, arrival.time_ns - stamp_ns
        self._buffer_ns = self._buffer_ns if arrival.joined else stamp_ns
        return not (varied or self.tells_of_stamps)

    def _varies(self, apart_ns: int) -> bool:
        """True if two ways from stamp to arrival differ by more than the grid of the stamps explains."""
        period_ns = self._pace.period_ns
        return apart_ns > _BURST * period_ns and (
            apart_ns > _grid_ns(self._steps_ns, period_ns) + _ON_GRID * period_ns
        )

    def look(self, parity: int, now_ns: int | None, returned_ns: int | None = None) -> Arrival:
        """Add the next field's arrival; `returned_ns`: when the buffer before it was returned, just now if
        that is unknown.
        """
        if now_ns is None or not self._keeps_pace:
            return Arrival(None, burst=False, joined=False)
        # The older field of a frame waits for the newer one.
        arrival_ns = now_ns - (round(self._pace.period_ns) if parity == self._waiting_parity else 0)
        before_ns, self._before_ns = self._before_ns, arrival_ns
        burst = before_ns is not None and arrival_ns - before_ns < _BURST * self._pace.period_ns
        woven = self._waiting_parity is not None and parity != self._waiting_parity
        joined = woven and now_ns == self._dequeued_ns
        self._dequeued_ns = now_ns
        if joined:
            return Arrival(arrival_ns, burst, joined)
        if self._holds_one:
            self._returned_ns.append(now_ns if returned_ns is None else returned_ns)
        self._holds_one = True
        all_had_turn = len(self._returned_ns) == self._returned_ns.maxlen
        freed_ns = tuple(islice(self._returned_ns, _KEPT_BACK)) if all_had_turn else ()
        return Arrival(arrival_ns, burst, joined, freed_ns)

    def empty(self) -> None:
        """Note that the driver's buffers are empty: the stream begins again."""
        self._returned_ns.clear()
        self._holds_one = False

    def lost_to_full_buffers(self, arrival: Arrival, time_ns: int, lost: int) -> tuple[int, bool]:
        """Number of the fields lost before one, the first of them, that found all buffers filled; and whether
        that is certain: while the way is unknown, some of them may have been lost on it.

        A driver fills its buffers in turn, and drops what begins while none is free. So before a buffer they
        were all filled until the program returned it, after as many others: what began later than that was
        lost on its way.
        """
        if arrival.time_ns is None:
            return lost, True
        if self.way.is_known:
            return self._lost_to_full_buffers(arrival, time_ns, lost, self.way.periods), True
        if not self.tells_of_stamps:
            # Its own time is that of an arrival, as late as may be.
            return lost if arrival.freed_ns else 0, True
        way = min(self.way.periods, _READ_OUT)
        most = self._lost_to_full_buffers(arrival, time_ns, lost, way)
        return most, most == self._lost_to_full_buffers(arrival, time_ns, lost, way + _READ_OUT)

    def _lost_to_full_buffers(self, arrival: Arrival, time_ns: int, lost: int, way: float) -> int:
        began_ns = time_ns + (way - _COMES) * self._pace.period_ns
        is_long, of_own = lost >= _LONG, 0
        for kept_back, freed_ns in enumerate(arrival.freed_ns if is_long else arrival.freed_ns[:1]):
            later = (began_ns - freed_ns) / self._pace.period_ns
            on_its_way = max(math.ceil((later - _BARELY) / self.in_turn) - 1, 0) * self.in_turn
            found = lost - on_its_way
            if is_long and found >= lost - self.in_turn and later + _BARELY >= 0:
                return lost
            of_own = of_own if kept_back else max(found, 0)
        return of_own // self.in_turn * self.in_turn

    def would_have_come(self, time_ns: int, lost: int, since_ns: int | None) -> tuple[float, float]:
        """Periods after a moment at which the first and the last of the fields lost before one would have
        come; both 0 while the way is unknown.
        """
        if since_ns is None or not self.way.is_known:
            return 0.0, 0.0
        after = (time_ns - since_ns) / self._pace.period_ns + self.way.periods
        return after - lost + self.in_turn - 1, after - 1

    def exposed_ns(self, arrival: Arrival) -> int | None:
        """Exposure of a field that came by the shortest way; None while that is unknown."""
        if arrival.time_ns is None or math.isinf(self.way.periods):
            return None
        return arrival.time_ns - round(self.way.periods * self._pace.period_ns)

    def learn_anew(self, ways_ns: Sequence[int]) -> None:
        """Learn the way from these fields only, since a longer exposure has a longer one."""
        self.way = Way()
        for way_ns in [min(ways_ns), *ways_ns] if ways_ns else ():
            self.way = self.way.after(way_ns / self._pace.period_ns)

    def learn(self, arrival: Arrival, time_ns: int, *, waited: bool = False) -> None:
        """Learn the way from a field whose time is known; `waited`: if it may have waited for the program."""
        if arrival.time_ns is not None:
            periods = (arrival.time_ns - time_ns) / self._pace.period_ns
            self.way = self.way.after(periods, joined=arrival.joined, waited=waited)


_SURE = 3
"""Fields of the other parity, each counted one further, after which a driver counts fields. Where both fields
of a frame share a number, every second difference is 0, unless fields are lost."""
_SURER = 12
"""Such fields after which a repeated number was an error: as the number of a frame, it would mean that every
other field was lost."""
_WRAP = 2**32  # V4L2 counts in 32 bits
_SHORT_WRAPS, _NEAR = (2**16, 2**17), 2**10
"""Where a device's own counter of 16 bits begins again, also one of frames, and steps across it that are no
restart."""


class SequenceSteps:
    """Converts a driver's `sequence` into steps of fields.

    If each buffer holds one field, some drivers give both fields of a frame the same number, others number
    each field. This is learned from the stream: until then, and after the counter restarts, the result is
    None.

    Args:
        alternate: True if each buffer holds one field, so that either numbering may occur; otherwise the
            counter counts fields.

    Attributes:
        restarted: True if the last field's number ran backward.
    """

    def __init__(self, alternate: bool) -> None:
        self._alternate = alternate
        self._newer: int | None = None
        self._single_steps = 0
        self._counts_fields = False
        self._last: tuple[int, int] | None = None
        self.restarted = False

    def forget(self) -> None:
        """Expect the counter to restart; its way of counting is remembered."""
        self._last = None

    def step(self, sequence: int | None, parity: int) -> int | None:
        """Number of fields since the last one by the driver's counter, or None if unknown."""
        last, self._last = self._last, None if sequence is None else (sequence, parity)
        self.restarted = False
        if sequence is None or last is None:
            return None
        wrap = _wrap(last[0], sequence)
        self._learn((sequence - last[0]) % wrap, parity, turned=parity != last[1])
        modulus = wrap if self._newer is None else 2 * wrap
        step = (self._index(sequence, parity) - self._index(*last)) % modulus
        # Half a wrap ahead or more means that the counter ran backward: it was restarted.
        self.restarted = self._known and step >= modulus // 2
        return step if self._known and 0 < step < modulus // 2 else None

    @property
    def _known(self) -> bool:
        return not self._alternate or self._newer is not None or self._counts_fields

    def _learn(self, difference: int, parity: int, *, turned: bool) -> None:
        self._single_steps = self._single_steps + 1 if difference == 1 and turned else 0
        if self._single_steps >= (_SURE if self._newer is None else _SURER):
            self._counts_fields, self._newer = True, None
        if self._alternate and difference == 0:
            self._newer = parity

    def _index(self, sequence: int, parity: int) -> int:
        return sequence if self._newer is None else 2 * sequence + (parity == self._newer)


def _wrap(before: int, after: int) -> int:
    """Number of values after which a counter begins again, as one step of it shows."""
    short = (wrap for wrap in _SHORT_WRAPS if after < before < wrap and (after - before) % wrap < _NEAR)
    return next(short, _WRAP)
