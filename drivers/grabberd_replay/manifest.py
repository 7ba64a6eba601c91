"""A folder that grabberd exported, as a recording: number, time and kind of each picture in `fields.csv`."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.bounded_documents import LARGEST_TABLE, read_text
from grabberd.core.field import LARGEST_SIDE_PX, NTSC_HZ, PAL_HZ, PROGRESSIVE, Field, FieldOrder
from grabberd.core.ledger import Outcome
from grabberd.errors import DeviceRefused
from grabberd.instrument.acquisition import GrabbedField
from grabberd.tables import keyed_cells
from grabberd_replay.picture_file import read_picture
from grabberd_replay.recording import Batch, Format, Pictures, Recording
from grabberd_replay.samples import Levels

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
