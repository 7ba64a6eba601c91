"""The library: an in-memory catalogue of all captures, searched, counted and sorted by one query.

The data of a capture are spread over its file, the state database and folders of analyses. The catalogue
joins them in an SQLite database in memory, so that one query suffices for any number of captures. The library
updates it from files, annotations and analyses before each answer.
"""

import sqlite3
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from datetime import datetime, tzinfo
from typing import Any, NamedTuple, Protocol

from grabberd import runtime
from grabberd.archive.catalogue.capture_query import (
    LABEL,
    CaptureQuery,
    Condition,
    Order,
    Position,
    conditions_of,
    marks,
    plain_conditions,
    sort_key,
)
from grabberd.archive.state.capture_index import CaptureIndex
from grabberd.archive.state.index_entries import DAMAGED_ENTRY, IndexEntry
from grabberd.archive.state.state_database import Annotation
from grabberd.documents.captures import CaptureDocument
from grabberd.files.reading import read_json

MOST_VALUES = 50
"""Maximum number of values reported for a facet, the most frequent first."""
FACETS = ("device", "verdict", "pinned", "analysed", "calibration")
MOST_DAYS = 31
_COLUMNS = (*("id", "created_utc", *FACETS, "measured", "length", "losses", "size", "words", "kind"),)
_TABLES = """
CREATE TABLE captures (
    row INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, created_utc TEXT, device TEXT, verdict TEXT,
    pinned INTEGER, analysed INTEGER, calibration TEXT, measured INTEGER, length INTEGER, losses INTEGER,
    size INTEGER, words TEXT, kind INTEGER);
CREATE INDEX newest ON captures (created_utc, id);
CREATE TABLE kinds (
    kind INTEGER PRIMARY KEY, device TEXT, verdict TEXT, pinned INTEGER, analysed INTEGER, calibration TEXT,
    UNIQUE (device, verdict, pinned, analysed, calibration));
CREATE TABLE pairs (pair INTEGER PRIMARY KEY, name TEXT, value TEXT, key TEXT, UNIQUE (name, value));
CREATE TABLE labels (pair INTEGER, row INTEGER, PRIMARY KEY (pair, row)) WITHOUT ROWID;
CREATE INDEX of_capture ON labels (row);
CREATE TABLE found (row INTEGER PRIMARY KEY, failed INTEGER);
"""
"""A kind is a combination of values of the facets. There are few, which makes counting fast."""
_LAST = "\U0010ffff"
"""Sorts after every label."""
_LONGEST = 1 << 59
_FEW = 2500
"""Number of matches from which a scan of all labels is faster."""
_QUARTER_MIN = 15
"""In every time zone, days start at a full quarter of an hour."""
_UNKNOWN = -1


class Row(NamedTuple):
    """A capture in the catalogue; `length`, `losses` and `size` are −1 if unknown."""

    id: str
    created_utc: str
    device: str
    verdict: str
    pinned: bool
    analysed: bool
    calibration: str
    measured: bool
    length: int
    losses: int
    size: int
    note: str
    labels: Mapping[str, str]


class Count(NamedTuple):
    """Number of captures with a value."""

    value: str
    number: int


class Facets(NamedTuple):
    """Values of the matching captures with their counts, the most frequent first.

    Values of a facet that is filtered are counted without that filter.

    Attributes:
        of: Counts by facet.
        labels: Counts by label.
        days: Counts by day, the newest first.
    """

    of: dict[str, list[Count]]
    labels: dict[str, list[Count]]
    days: list[Count]


class Found(NamedTuple):
    """Result of a query.

    Attributes:
        ids: Ids of the captures on the page, in order.
        after: Position of the last of them; None on the last page.
        total: Number of matching captures.
        in_all: Number of all captures.
        facets: Values of the matching captures; None if not requested.
    """

    ids: list[str]
    after: Position | None
    total: int
    in_all: int
    facets: Facets | None


class CaptureCatalogue:
    """Captures in memory; any thread may call, one at a time is served."""

    def __init__(self) -> None:
        self._connection = runtime.connect(":memory:", check_same_thread=False, isolation_level=None)
        self._connection.executescript(_TABLES)
        self._one = runtime.lock()

    def close(self) -> None:
        """Frees the memory."""
        with self._one:
            self._connection.close()

    def replace(self, rows: Iterable[Row]) -> None:
        """Replaces all captures."""
        with self._one, self._connection:
            self._connection.execute("BEGIN")
            for table in ("captures", "kinds", "labels", "pairs"):
                self._connection.execute(f"DELETE FROM {table}")  # noqa: S608 - constants
            self._put(rows)

    def change(self, gone: Iterable[str], rows: Iterable[Row]) -> None:
        """Removes captures by id, and adds or replaces others."""
        with self._one, self._connection:
            self._connection.execute("BEGIN")
            self._remove(gone)
            self._put(rows)

    def ask(self, query: CaptureQuery, current: Sequence[Row] = (), days_in: tzinfo | None = None) -> Found:
        """Runs a query.

        Args:
            query: The query.
            current: Running captures, included in this query only.
            days_in: Time zone of days, for counting values; None to count none.
        """
        with self._one:
            self._connection.execute("BEGIN")
            try:
                self._put(current)
                return self._answer(query, days_in)
            finally:
                self._connection.execute("ROLLBACK")

    def _put(self, rows: Iterable[Row]) -> None:
        insert = f"INSERT INTO captures ({', '.join(_COLUMNS)}) VALUES ({marks(_COLUMNS)})"  # noqa: S608
        for row in rows:
            self._remove([row.id])
            text = " ".join([row.note, *row.labels, *row.labels.values()]).casefold()
            made = self._execute(insert, *row[:11], text, self._kind(row)).lastrowid
            for name, value in row.labels.items():
                pair = (name, value, sort_key(value))
                self._execute("INSERT OR IGNORE INTO pairs (name, value, key) VALUES (?, ?, ?)", *pair)
                own = "INSERT INTO labels SELECT pair, ? FROM pairs WHERE name = ? AND value = ?"
                self._execute(own, made, name, value)

    def _kind(self, row: Row) -> int:
        """Number of the combination of a capture's values."""
        names, values = ", ".join(FACETS), [getattr(row, name) for name in FACETS]
        self._execute(f"INSERT OR IGNORE INTO kinds ({names}) VALUES ({marks(FACETS)})", *values)  # noqa: S608
        own = f"SELECT kind FROM kinds WHERE ({names}) = ({marks(FACETS)})"  # noqa: S608 - constants
        return int(self._execute(own, *values).fetchone()[0])

    def _remove(self, ids: Iterable[str]) -> None:
        for one in ids:
            self._execute("DELETE FROM labels WHERE row = (SELECT row FROM captures WHERE id = ?)", one)
            self._execute("DELETE FROM captures WHERE id = ?", one)

    def _answer(self, query: CaptureQuery, days_in: tzinfo | None) -> Found:
        conditions = conditions_of(query)
        self._find(plain_conditions(query), conditions)
        (in_all,) = self._execute("SELECT count(*) FROM captures").fetchone()
        (total,) = self._execute("SELECT count(*) FROM found WHERE failed = 0").fetchone()
        page = self._page(query)
        shown = page[: query.limit]
        after = Position(shown[-1][1], shown[-1][0]) if len(page) > query.limit else None
        facets = None if days_in is None else self._facets(conditions, total, days_in)
        return Found([one for one, _ in shown], after, total, in_all, facets)

    def _find(self, plain: Sequence[Condition], conditions: Sequence[Condition]) -> None:
        """Fills `found` with each capture that meets the plain conditions, and the facets that it fails."""
        failed = " | ".join(f"((({one.sql}) = 0) << {bit})" for bit, one in enumerate(conditions)) or "0"
        where = " AND ".join(f"({one.sql})" for one in plain) or "1"
        values = [value for one in (*conditions, *plain) for value in one.values]
        found = f"INSERT INTO found SELECT row, {failed} FROM captures WHERE {where}"  # noqa: S608 - conditions
        self._execute(found, *values)

    def _page(self, query: CaptureQuery) -> list[tuple[str, str | int]]:
        """Ids and keys of the captures of a page, and of one more."""
        key, labels, values = _key(query.order)
        direction, beyond = ("DESC", "<") if query.order.descending else ("ASC", ">")
        after = "" if query.after is None else f"AND ({key}, id) {beyond} (?, ?)"
        # CROSS JOIN: scans in the order of the index, if there is one, and only as far as the page goes.
        page = f"""SELECT id, {key} FROM captures {labels} CROSS JOIN found USING (row)
            WHERE failed = 0 {after} ORDER BY {key} {direction}, id {direction} LIMIT ?"""  # noqa: S608
        return self._execute(page, *values, *(query.after or ()), query.limit + 1).fetchall()

    def _facets(self, conditions: Sequence[Condition], total: int, days_in: tzinfo) -> Facets:
        bits = {one.facet: 1 << bit for bit, one in enumerate(conditions)}
        all_of_them = self._kinds(0)
        of = {
            name: _counts(self._kinds(bits[name]) if name in bits else all_of_them, place)
            for place, name in enumerate(FACETS)
        }
        return Facets(of, self._labels(bits, total), self._days(bits.get("day", 0), days_in))

    def _kinds(self, bit: int) -> list[tuple[Any, ...]]:
        """Combinations of values, each with the number of matches, ignoring the facet of this bit."""
        counted = f"""SELECT {", ".join(FACETS)}, n FROM (SELECT kind, count(*) AS n FROM found
            JOIN captures USING (row) WHERE failed & ~? = 0 GROUP BY kind) JOIN kinds USING (kind)"""  # noqa: S608
        return self._execute(counted, bit).fetchall()

    def _days(self, bit: int, zone: tzinfo) -> list[Count]:
        """The newest days with matches, ignoring the facet of this bit."""
        found = self._execute(
            """SELECT created_utc FROM captures CROSS JOIN found USING (row)
            WHERE failed & ~? = 0 AND created_utc <> '' ORDER BY created_utc DESC""",
            bit,
        )
        days: dict[str, int] = {}
        known: dict[str, str] = {}
        for (created_utc,) in found:
            quarter = f"{created_utc[:14]}{int(created_utc[14:16]) // _QUARTER_MIN * _QUARTER_MIN:02}"
            day = known.get(quarter) or _day(quarter, zone)
            known[quarter] = day
            if day not in days and len(days) == MOST_DAYS:
                break
            days[day] = days.get(day, 0) + 1
        return [Count(day, count) for day, count in days.items()]

    def _labels(self, bits: Mapping[str, int], total: int) -> dict[str, list[Count]]:
        """Values of labels by their names."""
        own = {name.removeprefix(LABEL): bit for name, bit in bits.items() if name.startswith(LABEL)}
        counts = [one for one in self._pairs(total) if one[0] not in own]
        counts += [one for name, bit in own.items() for one in self._pairs_of(name, bit)]
        found: dict[str, list[Count]] = {}
        for name, value, count in sorted(counts, key=lambda one: (one[0], -one[2], one[1])):
            values = found.setdefault(name, [])
            if len(values) < MOST_VALUES:
                values.append(Count(value, count))
        return found

    def _pairs(self, total: int) -> list[tuple[str, str, int]]:
        """Labels of the matches, found from the matches if they are few, otherwise by scanning all labels."""
        few = total < _FEW
        source = "found CROSS JOIN labels USING (row)" if few else "labels CROSS JOIN found USING (row)"
        counted = f"""SELECT name, value, n FROM (SELECT pair, count(*) AS n FROM {source}
            WHERE failed = 0 GROUP BY pair) JOIN pairs USING (pair)"""  # noqa: S608 - constants
        return self._execute(counted).fetchall()

    def _pairs_of(self, name: str, bit: int) -> list[tuple[str, str, int]]:
        """Values of one label of the matches, ignoring the facet of this bit."""
        counted = """SELECT name, value, count(*) FROM pairs CROSS JOIN labels USING (pair)
            CROSS JOIN found USING (row) WHERE name = ? AND failed & ~? = 0 GROUP BY pair"""
        return self._execute(counted, name, bit).fetchall()

    def _execute(self, statement: str, *values: object) -> sqlite3.Cursor:
        return self._connection.execute(statement, values)


def _counts(kinds: Iterable[tuple[Any, ...]], place: int) -> list[Count]:
    """Values of a facet, given by its column, with their counts."""
    counts: Counter[str] = Counter()
    for kind in kinds:
        counts[str(kind[place])] += kind[-1]
    del counts[""]
    return [Count(*one) for one in sorted(counts.items(), key=lambda one: (-one[1], one[0]))[:MOST_VALUES]]


def _day(quarter: str, zone: tzinfo) -> str:
    return datetime.fromisoformat(f"{quarter}:00+00:00").astimezone(zone).date().isoformat()


def _key(order: Order) -> tuple[str, str, tuple[str, ...]]:
    """SQL for the sort key, its join and parameters; captures without a key come last in either direction."""
    if order.by == "label":
        own = """LEFT JOIN (SELECT row, key AS own FROM labels JOIN pairs USING (pair) WHERE name = ?)
            USING (row)"""
        return f"coalesce(own, '{'' if order.descending else _LAST}')", own, (order.label,)
    if order.by == "time":
        return "created_utc", "", ()
    return (order.by if order.descending else f"iif({order.by} < 0, {_LONGEST}, {order.by})"), "", ()


class Results(Protocol):
    """Results of captures, such as analyses."""

    def fields(self, capture_id: str) -> Mapping[str, object]:
        """Fields to add to a capture's document."""
        ...

    def analysed(self, captures: Collection[str] | None) -> Collection[str]:
        """The captures with results, among these or, with None, among all."""
        ...


class Library:
    """Answers queries about captures from memory, after reading what has changed.

    Args:
        index: The captures on disk.
        annotation: Returns the annotation of a capture by its id.
        annotations: Returns all annotations by capture id.
        results: Results of captures, such as analyses.
    """

    def __init__(
        self,
        index: CaptureIndex,
        annotation: Callable[[str], Annotation],
        annotations: Callable[[], Mapping[str, Annotation]],
        results: Results | None = None,
    ) -> None:
        self._analysed = results.analysed if results else lambda _: set[str]()
        self._index = index
        self._annotation = annotation
        self._annotations = annotations
        self._catalogue = CaptureCatalogue()
        self._stale: set[str] | None = None
        self._noting = runtime.lock()
        self._reading = runtime.lock()

    def note(self, capture_id: str | None = None) -> None:
        """Marks a capture, or all, as changed; reads nothing."""
        with self._noting:
            if capture_id is None or self._stale is None:
                self._stale = None
            else:
                self._stale.add(capture_id)

    def ask(
        self, query: CaptureQuery, current: Iterable[CaptureDocument] = (), days_in: tzinfo | None = None
    ) -> Found:
        """Runs a query.

        Args:
            query: The query.
            current: Captures that are armed, being recorded or sealed.
            days_in: Time zone of days, for counting values; None to count none.

        Raises:
            StorageError: The index or the annotations cannot be read.
        """
        with self._reading:
            self._read_what_changed()
        analysed = self._analysed({one.id for one in current})
        return self._catalogue.ask(query, [_current_row(one, one.id in analysed) for one in current], days_in)

    def _read_what_changed(self) -> None:
        known: Mapping[str, Annotation]
        with self._noting:
            stale, self._stale = self._stale, set()
        try:
            if stale is None:
                self._catalogue.replace(
                    self._rows(self._index.list(), self._annotations(), self._analysed(None))
                )
            elif stale:
                entries = self._index.some(sorted(stale))
                known, analysed = {one.id: self._annotation(one.id) for one in entries}, self._analysed(stale)
                self._catalogue.change(stale, self._rows(entries, known, analysed))
        except BaseException:
            self._put_back(stale)
            raise

    def _put_back(self, stale: set[str] | None) -> None:
        with self._noting:
            self._stale = None if stale is None or self._stale is None else self._stale | stale

    def _rows(
        self, entries: Sequence[IndexEntry], annotations: Mapping[str, Annotation], analysed: Collection[str]
    ) -> list[Row]:
        nothing = Annotation()
        return [_row(one, annotations.get(one.id, nothing), one.id in analysed) for one in entries]


def _row(entry: IndexEntry, annotation: Annotation, analysed: bool) -> Row:
    return Row(
        entry.id,
        entry.created_utc,
        entry.device,
        "damaged" if entry.state == DAMAGED_ENTRY else entry.verdict,
        annotation.pinned,
        analysed,
        entry.calibration,
        entry.runs > 0,
        entry.length,
        entry.losses,
        entry.size_bytes,
        entry.note if annotation.note is None else annotation.note,
        read_json(entry.labels) if annotation.labels is None else annotation.labels,
    )


def _current_row(document: CaptureDocument, analysed: bool) -> Row:
    """A running capture, whose verdict and losses are still unknown."""
    return Row(
        document.id,
        document.created_utc,
        document.device,
        "",
        document.pinned,
        analysed,
        "",
        bool(document.runs),
        sum(document.ledger.counts.values()) if document.state != "armed" else _UNKNOWN,
        _UNKNOWN,
        document.size_bytes,
        document.note,
        document.labels,
    )
