"""Rows of fields and points, read some at a time and held against their digests."""

import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from grabberd.errors import CaptureFileError
from grabberd.storage.capture.digests import (
    MISSING,
    Damage,
    Row,
    check_row,
    has_digests,
    read_row_digests,
)
from grabberd.storage.capture.schema import DAMAGE, reading_errors
from grabberd.storage.patience import check_patience

T = TypeVar("T")
FIELDS_AT_ONCE = 50
"""Fields read under one lock: a reader in the middle of a statement keeps the writer from committing, which
it does twice a second."""
BYTES_AT_ONCE = 32 << 20
"""Size of the pictures after which no further one is read under the same lock."""
END = 2**62
"""A number beyond every field's."""


class Kind(NamedTuple):
    """A kind of rows.

    Attributes:
        what: The kind in words.
        query: Selects rows whose first cell is n, in order, with `:first` ≤ n < `:end`, at most `:some`.
        stored: Gives a row the form that it has in its table.
        whole: True if the query leaves none out.
    """

    what: str
    query: str
    stored: Callable[[Row], Row]
    whole: bool = True


class CheckedRows:
    """Reads rows of a capture file.

    Args:
        path: The file.
        connection: A connection to it in autocommit mode.
        left_out: Takes up the damaged rows, which are left out; None: the first one of them is an error.

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
        decode: Callable[[Row], T],
        first_n: int = 0,
        end_n: int = END,
        **values: int,
    ) -> Iterator[T]:
        """Decoded rows with first_n ≤ n < end_n, in order.

        Args:
            kind: Their kind.
            prefix: Beginning of the keys of their digests.
            decode: Decodes a row; raises one of `DAMAGE` if it is damaged.
            first_n: Number of the first field.
            end_n: Number after the last.
            values: Further parameters of the query.

        Raises:
            CaptureFileError: A row is damaged, or not there, and is not to be left out.
            StorageError: The file cannot be read now.
            ReadingGivenUp: Nobody waits for them any longer.
        """
        while True:
            check_patience(self._path.name)
            rows, digests = self._some(kind, prefix, {**values, "first": first_n, "end": end_n})
            for row in rows:
                try:
                    decoded = self._decoded(kind, row, digests, decode)
                except DAMAGE as error:
                    self._leave_out(Damage(kind.what, row[0], f"{error}"), error)
                else:
                    yield decoded
            if kind.whole:
                self._leave_out_missing(kind, digests, rows)
            if not rows:
                return
            last_n = rows[-1][0]
            if last_n < first_n:  # in a damaged tree, and would be read for ever
                raise self._error(Damage(kind.what, last_n, f"it stands behind field {first_n}"))
            first_n = last_n + 1

    def _some(
        self, kind: Kind, prefix: str, values: Mapping[str, int]
    ) -> tuple[list[Row], Mapping[int, str]]:
        """Some rows, and the digests up to the last of them, or to the end if there is none."""
        first_n, end_n = values["first"], values["end"]
        with reading_errors(self._path), self._connection:
            # One moment for both: what is committed in between would seem to be missing.
            self._connection.execute("BEGIN")
            rows = some_rows(self._connection.execute(kind.query, {**values, "some": FIELDS_AT_ONCE}))
            if not self.has_digests:
                return rows, {}
            last_n = rows[-1][0] if rows else end_n - 1
            return rows, read_row_digests(self._connection, prefix, first_n, last_n)

    def _decoded(self, kind: Kind, row: Row, digests: Mapping[int, str], decode: Callable[[Row], T]) -> T:
        if self.has_digests:
            check_row(kind.stored(row), digests.get(row[0]))
        return decode(row)

    def _leave_out_missing(self, kind: Kind, digests: Iterable[int], rows: Iterable[Row]) -> None:
        for n in sorted(set(digests) - {row[0] for row in rows}):
            self._leave_out(Damage(kind.what, n, MISSING))

    def _leave_out(self, damage: Damage, error: Exception | None = None) -> None:
        if self.left_out is None:
            raise self._error(damage) from error
        self.left_out.append(damage)

    def _error(self, damage: Damage) -> CaptureFileError:
        hint = "all others can be read; grabberd storage verify tells what else is damaged"
        return CaptureFileError(f"{self._path}: {damage.in_words}", hint)


def some_rows(cursor: sqlite3.Cursor) -> list[tuple[Any, ...]]:
    """The first rows of a query, as many as hold `BYTES_AT_ONCE` together and one more at most."""
    taken: list[tuple[Any, ...]] = []
    size = 0
    with closing(cursor):  # its lock, too, ends here
        for row in cursor:
            taken.append(row)
            size += sum(len(cell) for cell in row if isinstance(cell, bytes))
            if size > BYTES_AT_ONCE:
                break
    return taken
