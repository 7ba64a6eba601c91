"""Doubts about numbers, from a field whose number is uncertain until one whose number is certain again."""

import math

from grabberd.acquisition.numbering.arrivals import Arrival, Arrivals
from grabberd.acquisition.numbering.paths import Step

_REGULAR = 12
"""Fields in a row without a loss that arrive in time, after which their numbers are certain: fields that were
late come in a burst, or ever earlier."""


class Doubts:
    """Range of the numbers that are possible, while one is in doubt.

    Every field is at least one further than the one before, and none has been exposed later than its arrival
    by the shortest way allows. So between the last certain number and the next one, the true number of each
    field lies between two bounds.

    Args:
        arrivals: Those of the stream.
        period_ns: Nominal time from field to field.

    Attributes:
        open: True from a field whose number is uncertain up to one whose number is certain again.
    """

    def __init__(self, arrivals: Arrivals, period_ns: float) -> None:
        self._arrivals = arrivals
        self._period_ns = period_ns
        self._certain: tuple[int, int] | None = None
        self.open = self._clock_is_new = False
        self._fields = self._in_a_row = 0

    def begin(self, time_ns: int, late_by: int) -> None:
        """Note the time of the first field, and by how many fields it may be late."""
        self._certain, self._fields = (-late_by, time_ns - round(late_by * self._period_ns)), 0
        self.open = late_by > 0

    def of(
        self,
        n: int,
        time_ns: int,
        step: Step,
        arrival: Arrival,
        uncertain_by: int,
        *,
        way_is_known: bool,
        clock_is_new: bool = False,
    ) -> int:
        """Number of fields by which a field's number may be off.

        Args:
            n: Its number.
            time_ns: Its time.
            step: How it was numbered.
            arrival: Its arrival.
            uncertain_by: Doubt about this field alone.
            way_is_known: False if none has come by the shortest way yet: then nothing arrives in time.
            clock_is_new: True if the camera's clock begins again with its stamp: then stamps that fit tell
                nothing more, until an arrival does.
        """
        self._fields += 1
        regular = way_is_known and step.arrived_in_time and step.fields == 1
        self._in_a_row = self._in_a_row + 1 if regular else 0
        self._clock_is_new = clock_is_new or (self._clock_is_new and self.open)
        self.open = uncertain_by > 0 or (self.open and not self._ends(step))
        if self.open:
            return max(uncertain_by, self._range(n, time_ns, arrival), 1)
        self._certain, self._fields = (n, time_ns), 0
        return 0

    def _ends(self, step: Step) -> bool:
        told = self._arrivals.tells_of_stamps and step.late is not None and abs(step.late) < 0.5
        told = told and (step.arrived_in_time or not self._clock_is_new)
        return told or self._in_a_row >= _REGULAR or step.arrived is None

    def _latest(self, arrival: Arrival) -> float | None:
        """Greatest number that an arrival allows, by the last certain field."""
        exposed_ns = self._arrivals.exposed_ns(arrival) if self._arrivals.way.is_known else arrival.time_ns
        if exposed_ns is None or self._certain is None:
            return None
        certain_n, certain_ns = self._certain
        return certain_n + (exposed_ns - certain_ns) / self._period_ns

    def _range(self, n: int, time_ns: int, arrival: Arrival) -> int:
        """Number of fields by which number and time of a field may be off."""
        latest = self._latest(arrival)
        if latest is None or self._certain is None:
            return 0
        certain_n, certain_ns = self._certain
        late = (time_ns - certain_ns) / self._period_ns - self._fields
        return max(n - (certain_n + self._fields), round(latest) - n, math.ceil(late))
