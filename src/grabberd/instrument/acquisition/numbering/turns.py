"""Turns of the buffers: two that wait may be handed over in another order than they were filled."""

from collections.abc import Iterable, Iterator
from itertools import islice

from grabberd.instrument.acquisition.numbering.pace import Pace
from grabberd.instrument.acquisition.numbering.paths import Step
from grabberd.instrument.acquisition.numbering.pending import Pending

_LATE = 0.75
"""Periods by which a stamp is late if its field may have been handed over too early."""
_MOST = 8
"""Fields by which a buffer may be older than the one before, whose turn it was; else a clock was set."""
_PASS = 3
"""Buffers that may pass one by."""


class Turns:
    """Finds buffers that are older than the one before, by their stamps or by the driver's count.

    Numbers ascend in the order of the buffers, so those of such a pair are off by their distance, or by a
    buffer more if what seems to be lost before the first of them is the second.

    Args:
        pace: Of the camera.
        in_turn: Number of fields of a buffer.
    """

    def __init__(self, pace: Pace, in_turn: int) -> None:
        self._pace = pace
        self._in_turn = in_turn
        self._older_by = self._next_older_by = 0
        self._newest: Pending | None = None

    def is_awaited(self, oldest: Pending, step: Step, after: Iterable[Pending]) -> bool:
        """True if a later buffer may show that a field was handed over too early, and waits already."""
        if oldest.in_time or oldest.interruption or oldest.arrival.time_ns is None:
            return False
        is_ahead = step.fields > 1 or (step.late or 0.0) > _LATE
        buffers = list(_next_buffers(after))
        return is_ahead and len(buffers) < _PASS and not any(one.in_time for one in buffers)

    def out_by(self, oldest: Pending, after: Iterable[Pending]) -> int:
        """Number of fields by which one may be out of its turn; to be called for each in order."""
        if not oldest.arrival.joined:
            # Several may have passed it by.
            self._older_by = self._fields_older(self._newest, oldest)
            self._next_older_by = max(
                (self._fields_older(oldest, other) for other in _next_buffers(after)), default=0
            )
            if not self._older_by:
                self._newest = oldest
        return max(self._older_by, self._next_older_by)

    @property
    def is_older(self) -> bool:
        """True if the last field is older than the newest before: it is not one more."""
        return self._older_by > 0

    def _fields_older(self, one: Pending | None, other: Pending) -> int:
        if one is None or other.in_time or other.interruption:
            return 0
        by_stamp = round((one.stamp_ns - other.stamp_ns) / self._pace.period_ns) if other.stamp_ns > 0 else 0
        by_count = 0
        if one.sequence is not None and other.sequence is not None:
            by_count = one.sequence - other.sequence
        return next((by + self._in_turn for by in (by_stamp, by_count) if 0 < by <= _MOST), 0)


def _next_buffers(after: Iterable[Pending]) -> Iterator[Pending]:
    return islice((one for one in after if not one.arrival.joined), _PASS)
