"""Fields of the last minute, and how many of them did not come whole."""

import threading
from collections import deque
from typing import NamedTuple

from grabberd.core.ledger import Outcome

KEPT_S = 60
LATELY_S = 10
"""Shorter window: what is lost in it is being lost now."""
NOT_WHOLE = frozenset({Outcome.LOST, Outcome.DAMAGED, Outcome.OVERRUN})
_S = 1_000_000_000


class RecentCount(NamedTuple):
    """Number of fields in a window of time: all that were due, and those that did not come whole."""

    due: int = 0
    lost: int = 0

    @property
    def share(self) -> float:
        """Share of those that did not come whole; 0 if none was due."""
        return self.lost / self.due if self.due else 0.0


class RecentFields:
    """Counts by the second; written by the capture thread, read by everybody."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._seconds: deque[tuple[int, int, int]] = deque(maxlen=KEPT_S + 1)

    def count(self, now_ns: int, outcome: Outcome, count: int) -> None:
        """Counts fields that were due."""
        second, lost = now_ns // _S, count if outcome in NOT_WHOLE else 0
        with self._lock:
            due = count
            if self._seconds and self._seconds[-1][0] == second:
                _, known_due, known_lost = self._seconds.pop()
                due, lost = known_due + due, known_lost + lost
            self._seconds.append((second, due, lost))

    def within(self, now_ns: int, seconds: int = KEPT_S) -> RecentCount:
        """Counts of the last seconds, of `KEPT_S` at most."""
        first = now_ns // _S - seconds
        with self._lock:
            recent = [one for one in self._seconds if one[0] > first]
        return RecentCount(sum(due for _, due, _ in recent), sum(lost for _, _, lost in recent))
