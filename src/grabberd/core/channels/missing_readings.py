"""Readings that a logger took and that never came, by the steps of its own time."""

from collections import deque
from statistics import median

import numpy as np
from numpy.typing import NDArray

from grabberd.core.channels.logger import Anomaly

MISSING = "readings are missing"
_USUAL, _LEAST = 64, 8
"""Steps that tell the usual one, and the least number of them."""
_GAP = 1.6
"""Usual steps from which on a reading is missing; a logger's own timer jitters by less."""


class MissingReadings:
    """Counts missing readings of a logger that reads at a steady rate, which is learnt."""

    def __init__(self) -> None:
        self._steps_ns: deque[int] = deque(maxlen=_USUAL)
        self._before_ns: int | None = None

    @property
    def rate_hz(self) -> float | None:
        """Readings per second of the logger's own time; None until a few have come."""
        usual_ns = self._usual_ns()
        return 1e9 / usual_ns if usual_ns else None

    def look(self, own_ns: NDArray[np.int64], arrival_ns: int) -> tuple[Anomaly, ...]:
        """Take in readings that arrived together; their gap, if any readings are missing among them."""
        missing = sum(self._missing(int(time_ns)) for time_ns in own_ns)
        if not missing:
            return ()
        return (Anomaly(arrival_ns, MISSING, f"{missing} before {own_ns[-1] / 1e9:.3f} s", missing),)

    def begin_anew(self) -> None:
        """Note that the logger's clock was set: the next step tells nothing."""
        self._before_ns = None

    def _missing(self, time_ns: int) -> int:
        before_ns, self._before_ns = self._before_ns, time_ns
        step_ns = 0 if before_ns is None else time_ns - before_ns
        if step_ns <= 0:
            return 0
        usual_ns = self._usual_ns()
        self._steps_ns.append(step_ns)
        return round(step_ns / usual_ns) - 1 if usual_ns and step_ns > _GAP * usual_ns else 0

    def _usual_ns(self) -> float | None:
        return float(median(self._steps_ns)) if len(self._steps_ns) >= _LEAST else None
