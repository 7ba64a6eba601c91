"""Turns: of several threads that compute, one at a time does.

In one process only one thread runs Python at a time, and whoever has waited for a client, a device or the
disk has to queue for the interpreter again. Behind eight threads that compute, an answer of a millisecond
would take a second, and a capture would lose fields.
"""

import threading
import time
from collections import deque

HELD_S = 0.25
"""Time after which a turn passes to the next, handed on or not: a thread may wait for a disk."""


class Turns:
    """Hands the turn from one thread to the next, in the order in which they came."""

    def __init__(self, held_s: float = HELD_S) -> None:
        self._held_s = held_s
        self._changed = threading.Condition()
        self._waiting: deque[int] = deque()
        self._owner: int | None = None
        self._since_s = 0.0

    def take(self) -> None:
        """Waits for the turn."""
        me = threading.get_ident()
        with self._changed:
            self._waiting.append(me)
            while self._waiting[0] != me or not self._is_free():
                self._changed.wait(self._held_s)
            self._waiting.popleft()
            self._owner, self._since_s = me, time.monotonic()
            self._changed.notify_all()

    def give(self) -> None:
        """Ends the turn, if it has not passed to another yet."""
        with self._changed:
            if self._owner == threading.get_ident():
                self._owner = None
                self._changed.notify_all()

    def pass_on(self) -> None:
        """Lets whoever waits have the turn, and waits for the next; called between two steps of a work."""
        if self._waiting:
            self.give()
            self.take()

    def _is_free(self) -> bool:
        return self._owner is None or time.monotonic() >= self._since_s + self._held_s
