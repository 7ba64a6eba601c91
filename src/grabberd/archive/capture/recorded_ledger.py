"""The ledger of a capture file, read in parts: a capture of a week needs no more memory than a short one.

The file has a row for each field that came, and the table `ledger` has entries for the others; of a sealed
capture also for those that came damaged. Received fields are counted by SQLite, and only where their number
is not what the entries leave room for is each of them looked at. Rebases, the ledger's events, are stored in
the metadata, as the key `rebases` of `extra`.
"""

import sqlite3
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from heapq import merge
from itertools import accumulate, islice
from pathlib import Path
from textwrap import shorten
from typing import Any

from grabberd.archive.capture.meta import LARGEST_EXTRA, LARGEST_N, LONGEST_REASON, LONGEST_SAID, MOST_EVENTS
from grabberd.archive.capture.rows import text_of
from grabberd.archive.capture.schema import DAMAGE, reading_errors
from grabberd.core.ledger import Ledger, LedgerEntry, LedgerEvent, Outcome, Rebase
from grabberd.errors import CaptureFileError
from grabberd.files.reading import check_patience

KEY = "rebases"
MOST_ENTRIES = 1 << 24
"""Largest number of entries: a week at 50 Hz in which every other field is damaged has 15 million."""
MOST_WORDS = 128 << 20
"""Characters of all different reasons together, which are kept once each."""
MOST_LOOSE = 20_000
"""Entries of a sealed capture that are looked at one by one if they do not add up by themselves."""
_EVENT_SIZE = 100
"""Characters of an event as JSON, but for its reason."""
_AT_ONCE = 5000
"""Rows read under one lock."""
_REASON = f"CASE WHEN length(reason) <= {LONGEST_REASON} THEN reason ELSE x'' END"
_ENTRIES = f"""SELECT first_n, count, outcome, {_REASON} FROM ledger
    WHERE first_n >= ? ORDER BY first_n LIMIT ?"""  # noqa: S608 - constants
_UNSOUND = f"""SELECT n, 1, outcome, coalesce({_REASON}, outcome) FROM fields
    WHERE n >= ? AND outcome <> 'received' ORDER BY n LIMIT ?"""  # noqa: S608 - constants
_COUNTED = """SELECT count(*), coalesce(sum(n >= :first), 0) FROM fields
    WHERE n >= :begin AND n < :end AND outcome = 'received'"""
_RECEIVED = "SELECT n FROM fields WHERE n >= ? AND n < ? AND outcome = 'received' ORDER BY n"
_ENDS = """SELECT (SELECT min(n) FROM fields WHERE n >= ?), (SELECT min(n) FROM fields),
    (SELECT min(first_n) FROM ledger), (SELECT max(n) FROM fields)"""

_BY_KIND = "SELECT outcome = 'received', count(*) FROM fields GROUP BY outcome = 'received'"
_BY_OUTCOME = "SELECT outcome, sum(count) FROM ledger GROUP BY outcome"
_ENTRY_ENDS = """SELECT count(*), min(min(first_n), (SELECT min(n) FROM fields)),
    max(max(first_n + count), (SELECT max(n) + 1 FROM fields)), min(count),
    (SELECT count(*) FROM (SELECT first_n, lag(first_n + count) OVER (ORDER BY first_n) AS end_n FROM ledger)
        WHERE first_n < end_n)
    FROM ledger"""
_COVERED = """SELECT count(*), coalesce(sum(fields.outcome = 'received'), 0) FROM ledger CROSS JOIN fields
    ON n >= first_n AND n < first_n + count"""

Line = LedgerEntry | LedgerEvent


class _Words:
    """Reasons, each different one once in memory."""

    def __init__(self) -> None:
        self._known: dict[str, str] = {}
        self._size = 0

    def kept(self, reason: str) -> str:
        """The same reason.

        Raises:
            ValueError: There are too many.
        """
        if reason not in self._known:
            self._size += len(reason)
            if self._size > MOST_WORDS:
                raise ValueError(f"its reasons have more than {MOST_WORDS} characters")
        return self._known.setdefault(reason, reason)


class RecordedLedger:
    """Reads the ledger of a capture file.

    Args:
        path: The file.
        connection: A connection to it in autocommit mode.
    """

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self._path = path
        self._connection = connection

    def read(self, events: Sequence[LedgerEvent] = (), first_n: int | None = None) -> Ledger:
        """The ledger.

        Args:
            events: Its events.
            first_n: Its first field, if earlier than any that is in the file.

        Raises:
            CaptureFileError: It contradicts itself, or has more than any capture can have.
        """
        return self._entered_whole(Ledger(first_n, events=list(events)), _Words())

    def short(self, events: Sequence[LedgerEvent], most: int, *, sealed: bool) -> Ledger:
        """The ledger with so many of its entries; of a long one nothing else is read.

        Args:
            events: Its events.
            most: See `Ledger`.
            sealed: True if the file is sealed, and its entries complete.

        Raises:
            CaptureFileError: It contradicts itself.
        """
        if (counted := self._counted(events, most)) is not None:
            return counted
        ((entries,),) = self._all("SELECT count(*) FROM ledger")
        if sealed and entries > MOST_LOOSE:
            message = f"{self._path}: its ledger has {entries} entries, which do not add up with its fields"
            raise CaptureFileError(message, "no program sealed it like that: use another copy of the file")
        return self._entered_whole(Ledger(events=list(events), most=most))

    def _entered_whole(self, ledger: Ledger, words: _Words | None = None) -> Ledger:
        deque(self._entered(ledger, 0, words), maxlen=0)
        return ledger

    def _counted(self, events: Sequence[LedgerEvent], most: int) -> Ledger | None:
        """The ledger as SQLite counts it, with its first entries; None if it does not add up by itself.

        They do if the file is sealed: its entries and the fields received follow each other without gaps.
        """
        fields = dict(self._all(_BY_KIND))
        entries, *ends = self._all(_ENTRY_ENDS)[0]
        by_outcome = self._all(_BY_OUTCOME)
        counts = [count for _, count in by_outcome]
        if ends[0] is None or not all(isinstance(one, int) for one in (*ends, *counts)):
            return None
        first_n, end_n, least, overlaps = ends
        whole = sum(counts) + fields.get(1, 0) == end_n - first_n and least > 0 and not overlaps
        if not whole or first_n < 0 or end_n >= LARGEST_N or self._all(_COVERED) != [(fields.get(0, 0), 0)]:
            return None
        listed = list(islice(self._some(_ENTRIES, 0), most))
        with reading_errors(self._path):
            by = {Outcome(outcome): count for outcome, count in by_outcome}
        return Ledger.counted(first_n, end_n, fields.get(1, 0), by, listed, entries - len(listed), events)

    def lines(self, events: Sequence[LedgerEvent], first_n: int, passed: int, most: int) -> list[Line]:
        """Entries and events from a field on, by their fields, events after the entry of the same field.

        Args:
            events: The events of the ledger.
            first_n: Number of the field.
            passed: Number of lines of this very field that are not wanted.
            most: Number of lines that are wanted.
        """
        later = sorted((one for one in events if one.n >= first_n), key=lambda one: one.n)
        lines: Iterator[Line] = merge(self._entries(first_n), later, key=_n_of)
        return list(islice(lines, passed, passed + most))

    def _entries(self, first_n: int) -> Iterator[LedgerEntry]:
        """The entries from a field on, where one may begin; each is finished when the next one begins."""
        ledger = Ledger(first_n or None)
        for _ in self._entered(ledger, first_n, None):
            while len(ledger.entries) > 1:
                yield ledger.entries.pop(0)
        yield from ledger.entries

    def _entered(self, ledger: Ledger, first_n: int, words: _Words | None) -> Iterator[None]:
        """Enters everything into a ledger, part by part."""
        try:
            first, *ends = self._all(_ENDS, first_n)[0]
            for number in filter(lambda end: end is not None, ends):
                _n(number)
            last = -1 if ends[-1] is None else ends[-1]
            for count, entry in enumerate(self._not_received(first_n)):
                if count >= MOST_ENTRIES:
                    raise ValueError(f"it has more than {MOST_ENTRIES} entries")
                if ledger.end_n is None or ledger.end_n <= last:
                    self._enter_received(ledger, first, entry.first_n, entry.end_n)
                ledger.add(entry if words is None else entry._replace(reason=words.kept(entry.reason)))
                yield
            if last >= 0:
                self._enter_received(ledger, first, last + 1, last + 1)
        except DAMAGE as error:
            message = f"{self._path}: its ledger contradicts itself: {error}"
            raise CaptureFileError(message, "set the file aside") from error

    def _enter_received(self, ledger: Ledger, first: int | None, before: int, end: int) -> None:
        """Enters the fields received up to `before`; none may be received from there to `end`."""
        begin = ledger.end_n if ledger.end_n is not None else min(before, before if first is None else first)
        ((count, inside),) = self._all(_COUNTED, {"begin": min(begin, before), "first": before, "end": end})
        if inside:
            raise ValueError(f"a field from {before} to {end - 1} is received, and is not")
        if count and count == before - begin:
            ledger.receive(begin, count)
        elif count:
            with reading_errors(self._path):
                for (n,) in self._connection.execute(_RECEIVED, (begin, before)):
                    ledger.receive(n)

    def _not_received(self, first_n: int) -> Iterator[LedgerEntry]:
        """The entries, and those fields that did not come undamaged and have none."""
        entries = self._some(_ENTRIES, first_n)
        entry, covered = next(entries, None), first_n
        for field in self._some(_UNSOUND, first_n):
            while entry is not None and entry.first_n <= field.first_n:
                yield entry
                covered, entry = entry.end_n, next(entries, None)
            if field.first_n >= covered:
                yield field
        if entry is not None:
            yield entry
            yield from entries

    def _some(self, query: str, first_n: int) -> Iterator[LedgerEntry]:
        rows: list[tuple[Any, ...]] = [()]
        while rows:
            check_patience(self._path.name)
            rows = self._all(query, first_n, _AT_ONCE)
            for row in rows:
                entry = _entry(*row)
                yield entry
                first_n = entry.first_n + 1

    def _all(self, query: str, *values: Any) -> list[tuple[Any, ...]]:
        given = values[0] if values and isinstance(values[0], dict) else values
        with reading_errors(self._path):
            return self._connection.execute(query, given).fetchall()


def _n_of(line: Line) -> int:
    return line[0]


def _entry(first_n: Any, count: Any, outcome: Any, reason: Any) -> LedgerEntry:
    end_n = _n(_n(first_n) + _n(count))
    return LedgerEntry(first_n, end_n - first_n, Outcome(outcome), text_of(reason) or "")


def _n(value: Any) -> int:
    if isinstance(value, int) and 0 <= value < LARGEST_N:
        return value
    raise ValueError(f"a number of a field, or of fields, is {value!r}")


def with_rebases(extra: Mapping[str, Any], events: Sequence[LedgerEvent]) -> Mapping[str, Any]:
    """The metadata with these events added; of too many the last one listed says how many are not."""
    listed = [event._asdict() for event in _that_fit(events)]
    return {**extra, KEY: listed} if events else extra


def _that_fit(events: Sequence[LedgerEvent]) -> Iterator[LedgerEvent]:
    sizes = accumulate(_EVENT_SIZE + len(event.reason) for event in events)
    fit = sum(1 for size in islice(sizes, MOST_EVENTS) if size <= LARGEST_EXTRA * 3 // 4)
    if fit == len(events):
        yield from events
        return
    kept = max(fit - 1, 0)
    yield from events[:kept]
    said = shorten(events[kept].reason, LONGEST_SAID, placeholder=" …")
    rest = f"{len(events) - kept} changes from here on, which are not listed; the first: {said}"
    yield events[kept]._replace(reason=rest)


def rebases_in(extra: Mapping[str, Any]) -> list[LedgerEvent]:
    """The events in a capture's metadata; empty in files of earlier versions.

    Raises:
        ValueError: The events are damaged.
    """
    return [_event(one) for one in extra.get(KEY, ())]


def _event(stored: Any) -> LedgerEvent:
    match stored:
        case {"n": int(n), "kind": str(kind), "reason": str(reason)}:
            return LedgerEvent(n, Rebase(kind), reason)
    raise ValueError(f"a rebase is {stored!r}"[:LONGEST_SAID])
