"""Channels of a capture: their columns, as CSV and Parquet half a second at a time, and at a steady rate.

At a steady rate there are so many samples to each field, each the mean of the readings in its step. Nothing
is filled in: a step without a reading is NaN.
"""

import json
from collections.abc import Generator, Iterator, Sequence
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.digests import Damage
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.reading_groups import RecordedChannel, RecordedReadings
from grabberd.archive.export.points_columns import moments
from grabberd.archive.export.read_back import csv_check, parquet_check
from grabberd.archive.export.table_files import COMMAS, CsvDialect, csv_text, write_csv, write_parquet
from grabberd.core.chain.columns import ROWS_AT_ONCE, Column, Rows, regrouped
from grabberd.files.checked_file import checked_file

CHANNEL_COLUMNS = (
    Column("channel", "", "U", "name of the channel"),
    Column("quantity", "", "U", "what it measures: pulsation, liner, mouthpiece, milk_line, light, flow"),
    Column("time_utc", "", "M8[ms]", "when the reading was taken"),
    Column("time_s", "s", "f8", "the same, in seconds since the capture's first field", csv_format=".6f"),
    Column(
        "sigma_time_s", "s", "f8", "σ of time_s, excluding what is common to all readings", csv_format=".3g"
    ),
    Column(
        "vacuum_kpa",
        "kPa",
        "f8",
        "vacuum below atmosphere: gain · value + offset of the calibration; none for a light",
    ),
    Column("sigma_vacuum_kpa", "kPa", "f8", "σ of the calibration, common to all readings; none for a light"),
    # All digits, so that CSV reads back bit for bit.
    Column("value", "", "f8", "as measured, in the column `unit`", csv_format=""),
    Column("unit", "", "U", "unit of `value`"),
    Column("dating", "", "U", "source of the times: arrival, own_clock or monotonic"),
    Column("logger", "", "U", "name of the logger"),
)
_NAMES = [column.name for column in CHANNEL_COLUMNS]
Array = NDArray[np.float64]
MOST_PER_FIELD = 40
"""Samples to each field: 2000 a second."""


def channel_rows(reader: CaptureReader) -> Iterator[Rows]:
    """The readings of all channels, one channel after the other, half a second at a time."""
    begin_ns = reader.first_time_ns or 0
    for channel in reader.channels.all:
        for readings in reader.channels.groups(channel):
            yield _rows(channel, readings, reader, begin_ns)


def _rows(channel: RecordedChannel, readings: RecordedReadings, reader: CaptureReader, begin_ns: int) -> Rows:
    count, calibration = len(readings.time_ns), channel.calibration
    is_vacuum = channel.quantity.is_vacuum

    def same(value: object) -> np.ndarray:
        return np.full(count, value, object)

    return {
        "channel": same(channel.name),
        "quantity": same(str(channel.quantity)),
        "time_utc": moments(readings.time_ns, reader.meta),
        "time_s": (readings.time_ns - begin_ns) / 1e9,
        "sigma_time_s": np.full(count, readings.time_sigma_ns / 1e9),
        "vacuum_kpa": calibration.kpa(readings.value) if is_vacuum else np.full(count, np.nan),
        "sigma_vacuum_kpa": np.full(count, calibration.sigma_kpa if is_vacuum else np.nan),
        "value": readings.value,
        "unit": same(calibration.unit),
        "dating": same(str(readings.dating)),
        "logger": same(channel.logger),
    }


def channels_csv(path: Path, dialect: CsvDialect = COMMAS) -> Generator[str, None, None]:
    """Text of a CSV file; only a header for a capture without channels.

    Raises:
        CaptureFileError: No such file, or its channels are damaged; raised before the first text.
    """
    with CaptureReader(path) as reader:
        for channel in reader.channels.all:
            for _ in reader.channels.groups(channel):
                pass  # whoever sends them could not take back what was sent before the damage
    return _csv(path, dialect)


def _csv(path: Path, dialect: CsvDialect) -> Generator[str, None, None]:
    with CaptureReader(path) as reader:
        yield from csv_text(CHANNEL_COLUMNS, channel_rows(reader), dialect)


def export_channels(
    path: Path,
    directory: Path,
    suffix: str,
    left_out: list[Damage] | None = None,
    dialect: CsvDialect = COMMAS,
) -> int:
    """Writes `channels.csv` or `channels.parquet` into a folder, if the capture has channels.

    Args:
        path: The capture.
        directory: An existing folder.
        suffix: "csv" or "parquet".
        left_out: Takes up damaged readings, which are left out; None: they are an error.
        dialect: Signs of a CSV file.

    Returns:
        Number of readings.

    Raises:
        CaptureFileError: They are damaged, and are not to be left out.
        StorageError: The file cannot be written.
        ExtraMissing: pyarrow is not installed.
    """
    with CaptureReader(path, left_out) as reader:
        if not reader.channels.all:
            return 0
        rows = 0
        is_csv = suffix == "csv"
        check = (csv_check if is_csv else parquet_check)(_NAMES, lambda: rows, *[dialect.separator] * is_csv)
        with checked_file(directory / f"channels.{suffix}", check) as file:
            if is_csv:
                rows = write_csv(file, csv_text(CHANNEL_COLUMNS, channel_rows(reader), dialect))
            else:
                rows = _write_parquet(reader, file)
        return rows


def _write_parquet(reader: CaptureReader, file: IO[bytes]) -> int:
    calibrations = {one.name: one.calibration._asdict() for one in reader.channels.all}
    about = {"capture": reader.meta.id, "calibrations": calibrations}
    metadata = {"grabberd": json.dumps(about, ensure_ascii=False)}
    parts = regrouped(CHANNEL_COLUMNS, channel_rows(reader), ROWS_AT_ONCE)
    return write_parquet(file, CHANNEL_COLUMNS, parts, metadata)


class ChannelSamples(NamedTuple):
    """C channels over F fields.

    Attributes:
        channels: The channels.
        per_field: Samples S to each field.
        values: (F · S, C) kPa below atmosphere, or the level of a light; NaN where there is no reading.
    """

    channels: Sequence[RecordedChannel]
    per_field: int
    values: NDArray[np.float32]


def channel_samples(reader: CaptureReader, first_n: int, fields: int) -> ChannelSamples | None:
    """The channels of a capture; None if it has none.

    Args:
        reader: The capture.
        first_n: Number of the first field.
        fields: Number of fields, lost ones included.

    Raises:
        CaptureFileError: A channel is damaged.
    """
    channels = reader.channels.all
    if not channels or not fields:
        return None
    curves = [reader.channels.readings(channel) for channel in channels]
    per_field = _per_field([one.time_ns for one in curves], reader.meta.rate_hz)
    edges_ns = _edges_ns(reader, first_n, fields, per_field)
    values = [_means(one.time_ns, one.kpa, edges_ns) for one in curves]
    return ChannelSamples(channels, per_field, np.column_stack(values).astype(np.float32))


def _per_field(times_ns: Sequence[NDArray[np.int64]], rate_hz: float) -> int:
    """The whole number of samples that is nearest to what the fastest channel has."""
    steps_ns = [float(np.median(np.diff(time_ns))) for time_ns in times_ns if len(time_ns) > 1]
    fastest_hz = max((1e9 / step_ns for step_ns in steps_ns if step_ns > 0), default=rate_hz)
    return int(np.clip(round(fastest_hz / rate_hz), 1, MOST_PER_FIELD))


def _edges_ns(reader: CaptureReader, first_n: int, fields: int, per_field: int) -> Array:
    """(F · S + 1,) times between the samples, the first of which in each field is at the field's own time.

    Those of a lost field lie evenly between its neighbours'.
    """
    n, time_ns = reader.field_times()
    period_ns = 1e9 / reader.meta.rate_hz
    place = np.append(n - first_n, fields).astype(np.float64)
    last_ns = time_ns[-1] + (place[-1] - place[-2]) * period_ns
    between = (np.arange(fields * per_field + 1) - 0.5) / per_field
    edges = np.interp(between, place, np.append(time_ns, last_ns).astype(np.float64))
    edges[0] = time_ns[0] - period_ns / per_field / 2
    return edges


def _means(time_ns: NDArray[np.int64], value: Array, edges_ns: Array) -> Array:
    samples = len(edges_ns) - 1
    place = np.searchsorted(edges_ns, time_ns, side="right") - 1
    within = (place >= 0) & (place < samples) & np.isfinite(value)
    count = np.bincount(place[within], minlength=samples)
    total = np.bincount(place[within], value[within], minlength=samples)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
