"""Times of readings that carry none: they were taken since the last ones came, evenly."""

import math

import numpy as np
from numpy.typing import NDArray

from grabberd.core.channels.clock_relation import Dated

_FIRST_NS = 50_000_000
"""Time in which the readings that come first were taken: nothing is known of them."""


class ArrivalDating:
    """Dates readings by their arrival alone.

    Readings that come together, as a USB adapter delivers them, are spread over the time since those before.
    """

    def __init__(self) -> None:
        self._before_ns: int | None = None

    def date(self, count: int, arrival_ns: int) -> Dated:
        """Date so many readings that arrived together, `count` ≥ 1."""
        before_ns = arrival_ns - _FIRST_NS if self._before_ns is None else self._before_ns
        arrival_ns = max(arrival_ns, before_ns + count)
        span_ns = arrival_ns - before_ns
        self._before_ns = arrival_ns
        time_ns: NDArray[np.int64] = before_ns + span_ns * np.arange(1, count + 1, dtype=np.int64) // count
        return Dated(time_ns, round(span_ns / math.sqrt(12)))
