"""Ring of packed fields between the capture thread and its readers (paper 3.4: 32 slots).

Behind it, the backlog of a capture: what its reader has taken and its writer has not written yet.
"""

import weakref
from collections import deque
from collections.abc import Iterable, Iterator
from enum import StrEnum
from itertools import chain, islice
from typing import Generic, NamedTuple, Self, TypeVar

from grabberd import runtime
from grabberd.core.ledger import LedgerEntry, LedgerEvent, Outcome, Slot
from grabberd.errors import RingOverrun

OVERRUN_REASON = "ring overrun"
_REMEMBERED = 256
"""Slots whose losses and rebases the ring remembers after overwriting them: a loose cable causes a few a
second, and a reader that has missed more has waited for a minute."""


class _Report(NamedTuple):
    """Losses and rebases of a slot, and its position among all slots ever put."""

    position: int
    losses: tuple[LedgerEntry, ...]
    rebases: tuple[LedgerEvent, ...]


class Policy(StrEnum):
    """Reaction of a reader that the ring has overtaken."""

    COUNT = "count"
    STOP = "stop"


class Ring:
    """The newest slots, for one writer and any number of readers, each with its own position.

    `put` never waits for a reader: either side holds the lock for a few assignments only. Slots are passed by
    reference; nobody changes a slot's arrays after it was put.

    Attributes:
        slots: Number of slots kept.
        bits: Configured bits per pixel.
        lines: "doubled" or "field".
        deepest: Greatest number of slots that ever waited for a reader.
    """

    def __init__(self, slots: int = 32, bits: int = 1, lines: str = "doubled") -> None:
        if slots < 1:
            raise ValueError(f"a ring needs at least one slot, not {slots}")
        self.slots = slots
        self.bits = bits
        self.lines = lines
        self.deepest = 0
        # Weak: a reader dropped by its owner without closing it must not count as waiting forever.
        self._readers: weakref.WeakSet[RingReader] = weakref.WeakSet()
        self._kept: deque[Slot] = deque(maxlen=slots)
        # Kept longer than the slots: a late reader must still learn that the camera was unplugged.
        self._reports: deque[_Report] = deque(maxlen=_REMEMBERED)
        self._head = 0
        self._first_n: int | None = None
        self._closed = False
        self._changed = runtime.condition(runtime.lock())

    def put(self, slot: Slot) -> None:
        """Append a slot, overwriting the oldest if the ring is full, and wake the readers."""
        with self._changed:
            if self._first_n is None:
                self._first_n = slot.first_n
            self._kept.append(slot)
            if slot.lost_before or slot.rebases:
                self._reports.append(_Report(self._head, slot.lost_before, slot.rebases))
            self._head += 1
            self._changed.notify_all()

    def close(self) -> None:
        """Announce the end; readers get the remaining slots, then None."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    @property
    def newest(self) -> Slot | None:
        """The slot put last, or None."""
        with self._changed:
            return self._kept[-1] if self._kept else None

    @property
    def waiting(self) -> int:
        """Number of slots waiting for the slowest reader."""
        with self._changed:
            return max((reader._fill for reader in self._readers if not reader._closed), default=0)

    def reader(self, policy: Policy | str = Policy.COUNT, back: int = 0) -> "RingReader":
        """Make a reader that starts at the next slot to come, or at the oldest of the `back` newest ones.

        Pre-trigger slots are set aside for it at once, so none of them can be overrun.
        """
        with self._changed:
            before = list(self._kept)[-back:] if back > 0 else []
            next_n = self._kept[-1].n + 1 if self._kept else None
            reader = RingReader(self, Policy(policy), before, self._head, next_n)
            self._readers.add(reader)
            return reader


class RingReader:
    """One reader's position in a ring; used by one thread.

    Attributes:
        policy: Reaction to being overtaken: `count` reports it in the next slot's `lost_before`, beside what
            the overwritten slots reported, `stop` raises `RingOverrun`, at once and on every later call.
        deepest: Greatest number of the ring's slots that ever waited for this reader.
        oldest: The first pre-trigger slot, or None.
    """

    def __init__(self, ring: Ring, policy: Policy, before: list[Slot], head: int, next_n: int | None) -> None:
        self.policy = policy
        self.deepest = 0
        self._ring = ring
        self.oldest = before[0] if before else None
        self._before = deque(before)
        self._next = head
        self._next_n = next_n
        self._closed = False
        self._overrun: RingOverrun | None = None

    @property
    def ended(self) -> bool:
        """True if nothing more can be taken: closed, or the ring is closed and everything was taken."""
        with self._ring._changed:
            return self._closed or (self._ring._closed and not self._waiting)

    def take(self, timeout_s: float) -> Slot | None:
        """Take the next slot; None if none came in time, or none will come (`ended`).

        Raises:
            RingOverrun: The ring has overtaken a reader whose policy is `stop`.
        """
        if self._overrun:
            raise self._overrun
        with self._ring._changed:
            self._ring._changed.wait_for(self._ready, timeout_s)
            if self._closed or not self._waiting:
                return None
            return self._advance()

    def close(self) -> None:
        """Detach from the ring; a `take` in another thread returns None. Safe to call twice."""
        with self._ring._changed:
            self._closed = True
            self._before.clear()
            self._ring._changed.notify_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def waiting(self) -> int:
        """Number of slots not yet taken; exceeds the ring's size once overtaken."""
        with self._ring._changed:
            return self._waiting

    @property
    def _waiting(self) -> int:
        return len(self._before) + self._ring._head - self._next

    @property
    def _fill(self) -> int:
        """Number of the ring's own slots not yet taken."""
        return min(self._ring._head - self._next, self._ring.slots)

    def _ready(self) -> bool:
        return self._closed or self._ring._closed or self._waiting > 0

    def _advance(self) -> Slot:
        if self._before:
            return self._before.popleft()
        ring = self._ring
        fill = ring._head - self._next
        self.deepest = max(self.deepest, self._fill)
        ring.deepest = max(ring.deepest, self._fill)
        slot = self._skip(fill - ring.slots) if fill > ring.slots else ring._kept[-fill]
        self._next += 1
        self._next_n = slot.n + 1
        return slot

    def _skip(self, overwritten: int) -> Slot:
        """Skip overwritten slots; take the next one with their losses and rebases.

        Their fields are overrun; fields that were lost among them keep their reason, as far as the ring
        remembers it.
        """
        slot = self._ring._kept[0]
        first_n = self._next_n if self._next_n is not None else self._ring._first_n
        assert first_n is not None  # something has been put
        begin, self._next = self._next, self._next + overwritten
        if self.policy is Policy.STOP:
            self._overrun = RingOverrun(first_n, slot.first_n - first_n)
            raise self._overrun
        reports = [one for one in self._ring._reports if begin <= one.position < self._next]
        missed = _overrun_between(first_n, chain(*(one.losses for one in reports)), slot.first_n)
        rebases = chain(*(one.rebases for one in reports), slot.rebases)
        return slot._replace(lost_before=(*missed, *slot.lost_before), rebases=tuple(rebases))


def _overrun_between(first_n: int, losses: Iterable[LedgerEntry], end_n: int) -> Iterator[LedgerEntry]:
    """The losses, and an overrun for the fields before, between and after them."""
    for loss in (*losses, LedgerEntry(end_n, 0, Outcome.OVERRUN, OVERRUN_REASON)):
        if loss.first_n > first_n:
            yield LedgerEntry(first_n, loss.first_n - first_n, Outcome.OVERRUN, OVERRUN_REASON)
        if loss.count:
            yield loss
        first_n = loss.end_n


T = TypeVar("T")


class Backlog(Generic[T]):
    """An append-only list that forgets its head once it is on disk; indices count from the first item ever.

    If the writer falls behind by more than `capacity` items, `append` refuses. The measuring worker may fall
    behind without limit: it reads forgotten items from the file.

    Attributes:
        capacity: Number of items that the writer may fall behind.
        deepest: The most items that ever waited for the writer.
    """

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self.deepest = 0
        self._items: deque[T] = deque()
        self._first = 0
        self._written = 0
        self._closed = False
        self._changed = runtime.condition()

    @property
    def end(self) -> int:
        """Index after the last item."""
        with self._changed:
            return self._end()

    @property
    def closed(self) -> bool:
        """True if nothing will be appended any more."""
        return self._closed

    def append(self, item: T) -> bool:
        """Appends an item; returns False, and appends nothing, if the writer is `capacity` items behind."""
        with self._changed:
            waiting = self._end() - self._written
            if waiting >= self.capacity:
                return False
            self._items.append(item)
            self.deepest = max(self.deepest, waiting + 1)
            self._changed.notify_all()
            return True

    def close(self) -> None:
        """Ends the list: nothing will be appended any more; waiting threads are woken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    @property
    def room(self) -> int:
        """Number of items that the writer may still fall behind."""
        with self._changed:
            return self.capacity - (self._end() - self._written)

    def from_index(self, index: int, timeout_s: float) -> list[T]:
        """All items from an unforgotten index on; waits up to `timeout_s` for the first of them."""
        with self._changed:
            self._changed.wait_for(lambda: index < self._end() or self._closed, timeout_s)
            return list(islice(self._items, index - self._first, None))

    def written(self, count: int) -> None:
        """Marks the next `count` items as on disk; all but the latest `capacity` of them are forgotten."""
        with self._changed:
            self._written += count
            # The latest stay in memory for the worker, which reads only forgotten ones from the file.
            while self._first < self._written and len(self._items) > self.capacity:
                self._items.popleft()
                self._first += 1
            self._changed.notify_all()

    def drop(self) -> None:
        """Forgets all items: they are on disk, and nobody will ask for one any more."""
        with self._changed:
            self._first = self._end()
            self._items.clear()

    def at(self, index: int, timeout_s: float) -> T | None:
        """The item at an index; None if it does not come in time, or never will.

        Raises:
            LookupError: It has been forgotten; it is on disk.
        """
        with self._changed:
            self._changed.wait_for(lambda: index < self._end() or self._closed, timeout_s)
            if index < self._first:
                raise LookupError(f"item {index} is forgotten, the oldest is {self._first}")
            return self._items[index - self._first] if index < self._end() else None

    def oldest(self) -> tuple[int, T]:
        """Index of the oldest item that is not forgotten, and the item.

        Raises:
            LookupError: Nothing was ever appended.
        """
        with self._changed:
            if not self._items:
                raise LookupError("nothing was ever appended")
            return self._first, self._items[0]

    def _end(self) -> int:
        return self._first + len(self._items)
