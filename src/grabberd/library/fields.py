"""The fields of a capture as pictures, read on demand."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import overload

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.rows import RecordedField
from grabberd.core.field import PackedField, unpack
from grabberd.core.ledger import Outcome


@dataclass(frozen=True)
class CapturedField:
    """A field of a capture.

    Attributes:
        n: Its number.
        time_s: Middle of its exposure, in seconds after that of the capture's first field.
        outcome: "received", "damaged" or "no_signal"; `reason` says why it was not received.
        packed: The field as it was recorded, with its bits, parity and rows.
    """

    n: int
    time_s: float
    outcome: Outcome
    reason: str | None
    packed: PackedField

    @cached_property
    def picture(self) -> NDArray[np.uint8]:
        """(rows, columns) grey values; 0 and 255 at 1 bit, else the middle of each level."""
        return unpack(self.packed).luma

    @property
    def lines(self) -> NDArray[np.int64]:
        """(rows,) y of each row of the picture in frame pixels."""
        return self.packed.y0 + self.packed.y_step * np.arange(self.packed.rows)


class Fields:
    """The fields of a capture, by number; pictures are decoded on access.

    `fields[40]` is field 40, `fields[40:80]` those from 40 to 79 that are in the file, and a loop gives all
    of them in order. Lost fields are not in the file: `capture.ledger` has them.
    """

    def __init__(self, reader: CaptureReader, first_n: int = 0, end_n: int | None = None) -> None:
        self._reader, self._first_n, self._end_n = reader, first_n, end_n

    def __len__(self) -> int:
        n, _ = self._reader.field_times()
        end_n = n[-1] + 1 if self._end_n is None and len(n) else self._end_n or 0
        return int(np.count_nonzero((n >= self._first_n) & (n < end_n)))

    def __iter__(self) -> Iterator[CapturedField]:
        first_ns = self._reader.first_time_ns or 0
        for recorded in self._reader.fields(self._first_n, self._end_n):
            yield _field(recorded, first_ns)

    @overload
    def __getitem__(self, n: int) -> CapturedField: ...
    @overload
    def __getitem__(self, n: slice) -> "Fields": ...
    def __getitem__(self, n: int | slice) -> "CapturedField | Fields":
        """A field by its number, or those of a range of numbers.

        Raises:
            NotFound: The field is not in the file.
            ValueError: A range has a step, or counts from the end.
        """
        if not isinstance(n, slice):
            return _field(self._reader.field(n), self._reader.first_time_ns or 0)
        if n.step not in {None, 1} or (n.start or 0) < 0 or (n.stop or 0) < 0:
            raise ValueError("fields are sliced by their numbers, from 0 on and without a step")
        first_n = max(self._first_n, n.start or 0)
        ends = [end for end in (self._end_n, n.stop) if end is not None]
        return Fields(self._reader, first_n, min(ends, default=None))

    def __repr__(self) -> str:
        return f"<{len(self)} fields of capture {self._reader.meta.id}>"


def _field(recorded: RecordedField, first_ns: int) -> CapturedField:
    numbered = recorded.numbered
    time_s = (numbered.time_ns - first_ns) / 1e9
    return CapturedField(numbered.n, time_s, recorded.outcome, recorded.reason, numbered.packed)
