"""Recordings as the driver sees them, and whole pictures split into the fields that they deliver."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from grabberd.bounded_documents import LARGEST_TABLE, read_text
from grabberd.core.field import (
    BOTTOM,
    LARGEST_SIDE_PX,
    NTSC_HZ,
    PAL_HZ,
    PROGRESSIVE,
    TOP,
    Field,
    FieldOrder,
    split_frame,
    standard_rate_hz,
)
from grabberd.core.ledger import Outcome
from grabberd.errors import DeviceRefused
from grabberd.instrument.acquisition import GrabbedField
from grabberd.tables import keyed_cells
from grabberd_replay.decoder import Levels
from grabberd_replay.picture_file import read_picture

Batch = Sequence[GrabbedField]
"""The fields of one picture, the older first."""


@dataclass(frozen=True, slots=True)
class Format:
    """Properties of a recording's fields, in the terms of `StreamInfo`."""

    columns: int
    field_rows: int
    rate_hz: float
    field_order: FieldOrder
    counts_losses: bool
    details: dict[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


class Recording(Protocol):
    """An opened recording."""

    format: Format

    def batches(self) -> Iterator[Batch]:
        """Every picture's fields in order of time.

        Raises:
            PictureError, CaptureFileError: the next picture cannot be read; those before it were delivered.
        """
        ...

    def close(self) -> None:
        """Closes the recording; may be called twice. Nothing to do unless it keeps a file open."""
        return


class Pictures(StrEnum):
    """Kind of a picture: woven frame, single field, or all that a progressive camera saw at one moment."""

    AUTO = "auto"
    FRAMES = "frames"
    FIELDS = "fields"
    DOUBLED = "doubled"
    PROGRESSIVE = "progressive"

    @property
    def fields(self) -> int:
        """Number of fields in one picture."""
        return 2 if self is Pictures.FRAMES else 1


_FRAME_SIZES = {(columns, 576) for columns in (704, 720, 768)} | {(704, 480), (720, 480), (720, 486)}
_FIELD_LINES = (288, 240)
_EITHER_LINES = (480, 486, 576, 1080)
"""Lines of frames of other widths as well as of progressive pictures."""


def recognise(
    path: Path, pictures: Pictures, lines: int, columns: int, *, interlaced: bool = False
) -> Pictures:
    """Kind of pictures of this size in `path`.

    Args:
        path: where they are from.
        pictures: their kind as it was given.
        lines: their height.
        columns: their width.
        interlaced: True if they are marked as frames of two fields.

    Raises:
        DeviceRefused: the kind cannot be told from the size, or frames have an odd number of lines.
    """
    found = _by_size(lines, columns) if pictures is Pictures.AUTO else pictures
    if interlaced and pictures is Pictures.AUTO and found is not Pictures.FIELDS:
        found = Pictures.FRAMES
    hint = "give their kind by the option 'pictures': 'grabberd inspect' tells it from what they show"
    if found is None:
        raise DeviceRefused(
            f"{path}: pictures of {columns}x{lines} may be interlaced frames or progressive; "
            "expected pictures=frames or progressive",
            hint,
        )
    if found is Pictures.FRAMES and lines % 2:
        raise DeviceRefused(
            f"{path}: a frame has an even number of lines, expected 576 for PAL, not {lines}", hint
        )
    return found


def _by_size(lines: int, columns: int) -> Pictures | None:
    if (columns, lines) in _FRAME_SIZES:
        return Pictures.FRAMES
    if lines in _FIELD_LINES:
        return Pictures.FIELDS
    return None if lines in _EITHER_LINES else Pictures.PROGRESSIVE


def usual_rate_hz(path: Path, pictures: Pictures, lines: int) -> float:
    """Fields a second where nothing tells the rate: that of the video standard.

    Raises:
        DeviceRefused: progressive pictures have none.
    """
    if pictures is Pictures.PROGRESSIVE:
        raise DeviceRefused(
            f"{path}: nothing tells how many progressive pictures there are a second", "give 'rate_hz'"
        )
    frame_lines = lines if pictures in (Pictures.FRAMES, Pictures.DOUBLED) else 2 * lines
    return standard_rate_hz(frame_lines)


class Splitter(NamedTuple):
    """Splitter of pictures into fields.

    Attributes:
        pictures: kind of the pictures, not AUTO.
        order: order of the fields of a frame.
        first_parity: parity of the first field, if pictures are fields or doubled.
        rate_hz: fields per second.
    """

    pictures: Pictures
    order: FieldOrder
    first_parity: int
    rate_hz: float

    def batch(self, luma: NDArray[np.uint8], number: int, time_s: float, damage: str | None = None) -> Batch:
        """The fields of picture `number`, counted from 0 and taken at this time, the older first."""
        first = number * self.pictures.fields
        return [
            GrabbedField(field, round((time_s + (n - first) / self.rate_hz) * 1e9), n, damage)
            for n, field in enumerate(self._split(luma, self._parity(first)), start=first)
        ]

    def format(
        self, lines: int, columns: int, details: dict[str, str], remarks: tuple[str, ...] = ()
    ) -> Format:
        """Format of a recording with pictures of this size."""
        return Format(
            columns=columns,
            field_rows=lines // self.pictures.fields,
            rate_hz=self.rate_hz,
            field_order=self._order_of_fields,
            counts_losses=True,
            details={"pictures": str(self.pictures), "size": f"{columns}x{lines}", **details},
            remarks=remarks,
        )

    @property
    def _order_of_fields(self) -> FieldOrder:
        if self.pictures is Pictures.FRAMES:
            return self.order
        return FieldOrder.PROGRESSIVE if self.pictures is Pictures.PROGRESSIVE else FieldOrder.ALTERNATE

    def _split(self, luma: NDArray[np.uint8], parity: int) -> tuple[Field, ...]:
        if self.pictures is Pictures.FRAMES:
            return split_frame(luma, parity)
        if self.pictures is Pictures.PROGRESSIVE:
            return (Field.progressive(luma),)
        if self.pictures is Pictures.DOUBLED:
            return (Field(luma, parity, y0=0, y_step=1),)
        return (Field.intact(luma, parity),)

    def _parity(self, n: int) -> int:
        if self.pictures is Pictures.FRAMES:
            return older_parity(self.order)
        return self.first_parity if n % 2 == 0 else TOP + BOTTOM - self.first_parity


def parity_named(name: str) -> int:
    """`TOP` or `BOTTOM`.

    Raises:
        ValueError: it is called neither top nor bottom.
    """
    if name not in ("top", "bottom"):
        raise ValueError(f"first_parity is 'top' or 'bottom', not {name!r}")
    return TOP if name == "top" else BOTTOM


def older_parity(order: FieldOrder) -> int:
    """Parity of the field of a frame that was exposed first.

    Raises:
        ValueError: the order is not one of frames.
    """
    if order not in (FieldOrder.TOP_FIRST, FieldOrder.BOTTOM_FIRST):
        raise ValueError(f"field_order of frames is 'top_first' or 'bottom_first', not {str(order)!r}")
    return TOP if order is FieldOrder.TOP_FIRST else BOTTOM


MANIFEST = "fields.csv"
_HINT = "export the capture again"
_CLOCK_OFF = 5e-4
"""Departure of a camera's clock from its nominal rate."""
_NUMBERS = range(-(1 << 62), 1 << 62)
_RANGES = {
    "n": range(1 << 31),
    "time_ns": _NUMBERS,
    "parity": range(PROGRESSIVE + 1),
    "y0": range(LARGEST_SIDE_PX),
    "y_step": range(1, 3),
}


class Row(NamedTuple):
    """One field of the manifest."""

    n: int
    time_ns: int
    sequence: int | None
    parity: int
    y0: int
    y_step: int
    outcome: Outcome
    file: str


class ManifestRecording(Recording):
    """The fields that a manifest lists, with their own times, parities and gaps.

    Raises:
        DeviceRefused: the manifest is empty, or one of its rows is malformed.
        PictureError: the first picture cannot be read.
    """

    def __init__(self, directory: Path, rate_hz: float | None) -> None:
        self._directory = directory
        self._rows = read_manifest(directory / MANIFEST)
        self._header, first = read_picture(directory / self._rows[0].file)
        self._levels = Levels.of(first)
        self._woven = self._rows[0].y_step == 2 and self._is_woven()
        parities = {row.parity for row in self._rows}
        self.format = Format(
            columns=self._header.columns,
            field_rows=self._header.lines // (2 if self._woven else 1),
            rate_hz=rate_hz or _rate_hz(self._rows),
            field_order=_order_of(parities),
            counts_losses=_counts_like_numbers(self._rows),
            details={
                "pictures": str(self._pictures),
                "size": f"{self._header.columns}x{self._header.lines}",
                **self._header.details,
                **self._levels.details,
            },
            remarks=self._levels.remarks,
        )

    def batches(self) -> Iterator[Batch]:
        """One field at a time; both of a woven frame come from the same picture."""
        name, luma = "", np.empty((0, 0), np.uint8)
        for row in self._rows:
            if row.file != name:
                path = self._directory / row.file
                name, luma = row.file, self._levels.grey(path, read_picture(path, self._header)[1])
            damage = None if row.outcome is Outcome.RECEIVED else str(row.outcome).replace("_", " ")
            yield (GrabbedField(self._field(luma, row), row.time_ns, row.sequence, damage),)

    def _field(self, luma: NDArray[np.uint8], row: Row) -> Field:
        return Field(luma[row.parity :: 2] if self._woven else luma, row.parity, row.y0, row.y_step)

    def _is_woven(self) -> bool:
        """True if pictures are frames: listed once for each of their fields, or higher than any field."""
        return self._header.lines >= 480 or any(a.file == b.file for a, b in pairwise(self._rows))

    @property
    def _pictures(self) -> Pictures:
        if self._woven:
            return Pictures.FRAMES
        if self._rows[0].parity == PROGRESSIVE:
            return Pictures.PROGRESSIVE
        return Pictures.DOUBLED if self._rows[0].y_step == 1 else Pictures.FIELDS


def _order_of(parities: Collection[int]) -> FieldOrder:
    if PROGRESSIVE in parities:
        return FieldOrder.PROGRESSIVE
    return FieldOrder.ALTERNATE if len(parities) > 1 else FieldOrder.ONE_PARITY


def _rate_hz(rows: Sequence[Row]) -> float:
    """Nominal fields per second by the rows' numbers and times; PAL's where they do not tell."""
    steps = np.diff([row.n for row in rows])
    apart_ns = np.diff([row.time_ns for row in rows])
    known = apart_ns > 0
    if not known.any():
        return PAL_HZ
    seen_hz = float(np.median(steps[known] * 1e9 / apart_ns[known]))
    nominal_hz = min((NTSC_HZ, max(float(round(seen_hz)), 1.0)), key=lambda one: abs(one - seen_hz))
    return nominal_hz if abs(nominal_hz / seen_hz - 1) < _CLOCK_OFF else seen_hz


def _counts_like_numbers(rows: Sequence[Row]) -> bool:
    """True if the driver's count grew with the field numbers, and so showed every loss."""
    shifts = {row.n - row.sequence if row.sequence is not None else None for row in rows}
    return len(shifts) == 1 and None not in shifts


def read_manifest(path: Path) -> list[Row]:
    """The rows of a manifest.

    Raises:
        DeviceRefused: there are no rows, or one is malformed; the message names its line.
    """
    try:
        cells = keyed_cells(read_text(path, LARGEST_TABLE), Row._fields, hint=_HINT)
    except (OSError, ValueError) as error:
        raise DeviceRefused(f"{path} cannot be read: {error}", _HINT) from error
    records = (
        dict(zip(cells.columns, row, strict=True)) for row in zip(*cells.columns.values(), strict=True)
    )
    rows = [_row(path, line, values) for line, values in zip(cells.lines, records, strict=True)]
    if not rows:
        raise DeviceRefused(f"{path} lists no fields", _HINT)
    if any(later.n <= earlier.n for earlier, later in pairwise(rows)):
        raise DeviceRefused(f"{path}: the numbers n do not ascend", _HINT)
    return rows


def _row(path: Path, line: int, values: Mapping[str, str]) -> Row:
    try:
        numbers = {name: _whole(values, name) for name in _RANGES}
        return Row(
            **numbers,
            sequence=_whole(values, "sequence") if values["sequence"] else None,
            outcome=Outcome(values["outcome"]),
            file=_file(values["file"]),
        )
    except ValueError as error:
        why = f"{type(error).__name__} {error}"
        raise DeviceRefused(f"{path}, line {line} cannot be understood: {why}", _HINT) from error


def _whole(values: Mapping[str, str], name: str) -> int:
    number = int(values[name])
    if number not in _RANGES.get(name, _NUMBERS):
        raise ValueError(f"{name} is {number}")
    return number


def _file(text: str) -> str:
    name = Path(text).name  # never out of the manifest's own folder
    if not name or "\0" in name:
        raise ValueError(f"{text!r} is not a file's name")
    return name
