"""Patience: how long somebody still waits for what is being read.

Reading may take any time, by the size of what is asked for or by what a file contains. Whoever waits for it
says for how long, and gives up as soon as nobody wants it any more; whoever reads asks between its steps, and
stops. The two need not know each other: the patience in force travels with the context of the call.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar


class Patience:
    """The time until which something is waited for; may end earlier, from any thread.

    Args:
        until_s: The end, by `now_s`; None: only `give_up` ends it.
        now_s: Source of time.
    """

    __slots__ = ("_given_up", "_now_s", "until_s")

    def __init__(self, until_s: float | None, now_s: Callable[[], float] = time.monotonic) -> None:
        self.until_s = until_s
        self._now_s = now_s
        self._given_up = False

    def give_up(self) -> None:
        """Ends it now; safe twice and from any thread."""
        self._given_up = True

    @property
    def is_over(self) -> bool:
        """True if nobody waits any longer: it was given up, or its time has passed."""
        return self._given_up or (self.until_s is not None and self._now_s() >= self.until_s)


CURRENT: ContextVar[Patience | None] = ContextVar("patience", default=None)
"""The patience in force; None where somebody waits however long it takes, such as a command or a job."""


@contextmanager
def within(patience: Patience) -> Iterator[Patience]:
    """Puts a patience in force for the block, and restores the one before.

    A generator is resumed in the context of whoever asks for its next item: it is each resumption that has to
    be within the patience.
    """
    before = CURRENT.set(patience)
    try:
        yield patience
    finally:
        CURRENT.reset(before)
