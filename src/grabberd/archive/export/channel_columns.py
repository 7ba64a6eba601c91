"""The columns of exported channels, and how the readings of a capture fill them."""

from collections.abc import Iterator

import numpy as np

from grabberd.archive.capture.channels.reading_groups import RecordedChannel, RecordedReadings
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.export.points_columns import moments
from grabberd.core.chain.columns import Column, Rows

CHANNEL_COLUMNS = (
    Column("channel", "", "U", "name of the channel"),
    Column("quantity", "", "U", "what it measures: pulsation, liner, mouthpiece, milk_line, light"),
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
