"""Rows of fields and points, read in batches and checked against their digests."""

import sqlite3
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from grabberd.archive.capture.digests import MISSING, Damage, Row, check_row, has_digests, read_row_digests
from grabberd.archive.capture.schema import DAMAGE, reading_errors
from grabberd.errors import CaptureFileError
from grabberd.files.patience import check_patience

T = TypeVar("T")
FIELDS_AT_ONCE = 50
"""Fields read under one lock: the writer commits twice a second, and cannot while a reader's statement is
open."""
BYTES_AT_ONCE = 32 << 20
"""Size of the pictures at which a batch ends, and with it the lock."""
END = 2**62
"""A number greater than that of any field."""


class Kind(NamedTuple):
    """A kind of rows.

    Attributes:
        what: Name of the kind for messages.
        fetch: Fetches a batch of rows in the order of their keys, with `first` ≤ key < `end`.
        stored: Returns the form of a row that its digest covers.
        key: Number of a row's field, or of its first.
        lost: Numbers of the fields that are lost with the row whose key is `first`; None: only that field.
        whole: True if the query selects every row.
    """

    what: str
    fetch: Callable[[sqlite3.Connection, Mapping[str, int]], Sequence[Any]]
    stored: Callable[[Any], Row] = lambda row: row
    key: Callable[[Any], int] = lambda row: row[0]
    lost: Callable[[sqlite3.Connection, Mapping[str, int]], list[int]] | None = None
    whole: bool = True


def query_rows(query: str) -> Callable[[sqlite3.Connection, Mapping[str, int]], list[Row]]:
    """Fetches the rows of a query, at most `:some`."""
    return lambda connection, values: some_rows(connection.execute(query, {**values, "some": FIELDS_AT_ONCE}))


class CheckedRows:
    """Reads rows of a capture file.

    Args:
        path: The file.
        connection: A connection to it in autocommit mode.
        left_out: Collects damaged rows, which are skipped; None: a damaged row is an error.

    Attributes:
        left_out: See above.
        has_digests: False for files of earlier versions.
    """

    def __init__(
        self, path: Path, connection: sqlite3.Connection, left_out: list[Damage] | None = None
    ) -> None:
        self.left_out = left_out
        self._path = path
        self._connection = connection
        with reading_errors(path):
            self.has_digests = has_digests(connection)

    def each(
        self,
        kind: Kind,
        prefix: str,
        decode: Callable[[Any], T],
        first_n: int = 0,
        end_n: int = END,
        wanted_from: int = 0,
        **values: int,
    ) -> Iterator[T]:
        """Decoded rows with first_n ≤ key < end_n, in order.

        Args:
            kind: Kind of the rows.
            prefix: Prefix of the keys of their digests.
            decode: Decodes a row; raises one of `DAMAGE` if it is damaged.
            first_n: Number of the first field.
            end_n: Number after the last.
            wanted_from: Number of the first requested field; damage before it is ignored.
            values: Further parameters of the query.

        Raises:
            CaptureFileError: A row is damaged or missing, and damaged rows are not skipped.
            StorageError: The file cannot be read now.
            ReadingGivenUp: The reading was cancelled.
        """
        while True:
            check_patience(self._path.name)
            limits = {**values, "first": first_n, "end": end_n}
            rows, digests = self._some(kind, prefix, limits)
            keys = [kind.key(row) for row in rows]
            damages = _Damages(kind, limits, wanted_from, sorted({*keys, *digests}))
            yield from self._sound(damages, dict(zip(keys, rows, strict=True)), digests, decode)
            if not rows:
                return
            if keys[-1] < first_n:  # a damaged tree, which would be read for ever
                raise self._error(Damage(kind.what, keys[-1], f"it stands behind field {first_n}"))
            first_n = keys[-1] + 1

    def _sound(
        self,
        damages: "_Damages",
        rows: Mapping[int, Any],
        digests: Mapping[int, str],
        decode: Callable[[Any], T],
    ) -> Iterator[T]:
        """Decodes rows, by their keys, and skips those that are damaged or missing."""
        for key, row in rows.items():
            try:
                decoded = self._decoded(damages.kind, row, digests.get(key), decode)
            except DAMAGE as error:
                self._leave_out(damages, key, f"{error}", error)
            else:
                yield decoded
        if damages.kind.whole:
            for key in sorted(set(digests) - set(rows)):
                self._leave_out(damages, key, MISSING)

    def _some(
        self, kind: Kind, prefix: str, values: Mapping[str, int]
    ) -> tuple[Sequence[Any], Mapping[int, str]]:
        """A batch of rows, and the digests up to the last of them, or to the end if the batch is empty."""
        first_n, end_n = values["first"], values["end"]
        with reading_errors(self._path), self._connection:
            # One snapshot for both: rows committed in between would appear to be missing.
            self._connection.execute("BEGIN")
            rows = kind.fetch(self._connection, values)
            if not self.has_digests:
                return rows, {}
            last_n = kind.key(rows[-1]) if rows else end_n - 1
            return rows, read_row_digests(self._connection, prefix, first_n, last_n)

    def _decoded(self, kind: Kind, row: Any, digest: str | None, decode: Callable[[Any], T]) -> T:
        if self.has_digests:
            check_row(kind.stored(row), digest)
        return decode(row)

    def _leave_out(self, damages: "_Damages", key: int, reason: str, error: Exception | None = None) -> None:
        with reading_errors(self._path):
            found = damages.of(self._connection, key, reason)
        if found and self.left_out is None:
            raise self._error(found[0]) from error
        if self.left_out is not None:
            self.left_out += found

    def _error(self, damage: Damage) -> CaptureFileError:
        hint = "all others can be read; grabberd storage verify shows what else is damaged"
        return CaptureFileError(f"{self._path}: {damage.in_words}", hint)


class _Damages(NamedTuple):
    """Fields that are lost with damaged rows."""

    kind: Kind
    limits: Mapping[str, int]
    wanted_from: int
    keys: Sequence[int]

    def of(self, connection: sqlite3.Connection, key: int, reason: str) -> list[Damage]:
        """The requested fields that are lost with one row."""
        lost = [key]
        if self.kind.lost is not None:
            following = bisect_right(self.keys, key)
            end = self.keys[following] if following < len(self.keys) else self.limits["end"]
            lost = self.kind.lost(connection, {**self.limits, "first": key, "end": end}) or lost
        return [Damage(self.kind.what, n, reason) for n in lost if self.wanted_from <= n < self.limits["end"]]


def some_rows(cursor: sqlite3.Cursor) -> list[tuple[Any, ...]]:
    """The first rows of a query, until they exceed `BYTES_AT_ONCE`."""
    taken: list[tuple[Any, ...]] = []
    size = 0
    with closing(cursor):  # releases its lock
        for row in cursor:
            taken.append(row)
            size += sum(len(cell) for cell in row if isinstance(cell, bytes))
            if size > BYTES_AT_ONCE:
                break
    return taken
