"""Patience: how long somebody still waits for what is being read.

Reading may take any time, by the size of what is asked for or by what a file contains. Whoever waits for it
says for how long, and gives up as soon as nobody wants it any more; whoever reads asks between its steps, and
stops. The two need not know each other: the patience in force travels with the context of the call.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from grabberd import runtime
from grabberd.errors import ReadingGivenUp


class Patience:
    """The time until which something is waited for; may end earlier, from any thread.

    Args:
        until_s: The end, by `now_s`; None: only `give_up` ends it.
        now_s: Source of time.
        outer: Patience that this one is a part of: over with it at the latest.
        between: Called between the steps of a reading, to let others go on.
    """

    __slots__ = ("_between", "_given_up", "_now_s", "_outer", "until_s")

    def __init__(
        self,
        until_s: float | None,
        now_s: Callable[[], float] = runtime.monotonic,
        outer: "Patience | None" = None,
        between: Callable[[], None] | None = None,
    ) -> None:
        self._between = between
        self.until_s = until_s
        self._now_s = now_s
        self._outer = outer
        self._given_up = False

    def give_up(self) -> None:
        """Ends it now; safe twice and from any thread."""
        self._given_up = True

    def between(self) -> None:
        """Lets others go on between two steps."""
        if self._between is not None:
            self._between()
        if self._outer is not None:
            self._outer.between()

    @property
    def is_over(self) -> bool:
        """True if nobody waits any longer: it was given up, or its time has passed."""
        if self._given_up or (self.until_s is not None and self._now_s() >= self.until_s):
            return True
        return self._outer is not None and self._outer.is_over


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


def is_over() -> bool:
    """True if there is a patience in force, and it is over."""
    patience = CURRENT.get()
    return patience is not None and patience.is_over


def check_patience(what: str = "it") -> None:
    """Ends a reading that nobody waits for any longer; called between its steps.

    Args:
        what: What is being read.

    Raises:
        ReadingGivenUp: The patience in force is over.
    """
    patience = CURRENT.get()
    if patience is None:
        return
    patience.between()
    if patience.is_over:
        raise given_up(what)


def given_up(what: str) -> ReadingGivenUp:
    """The error of a reading that was given up."""
    return ReadingGivenUp(
        f"reading {what} took too long and was given up",
        "ask for less at once, or again when the computer has less to do",
    )
