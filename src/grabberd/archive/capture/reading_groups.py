"""Rows of the tables `channels` and `readings` as objects, and the encoding of readings.

Values are stored as the logger gave them, bit for bit, together with their calibration to kPa; times are on
the fields' clock. A group covers half a second. Invalid rows are errors, never guessed at.
"""

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.digests import Row
from grabberd.archive.capture.encodings import differences, frame_of, planes_of, read_planes, sums
from grabberd.archive.capture.meta import LARGEST_TIME_NS
from grabberd.core.channels import Dating, Quantity
from grabberd.files.reading import read_json

MOST_CHANNELS = 64
"""Maximum number of channels of a capture."""
LONGEST_NAME = 200
LARGEST_SIGMA_NS = 10**12
"""Upper bound of the σ of a time, about a quarter of an hour."""
INSERT_CHANNEL = "INSERT OR REPLACE INTO channels VALUES (?, ?, ?, ?, ?, ?)"
INSERT_READINGS = "INSERT INTO readings VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)"
_GROUPS_EVER = 1 << 31
MOST_READINGS = 1 << 14
"""Maximum number of readings of a group; half a second at 32 000 a second."""


class ChannelCalibration(NamedTuple):
    """Calibration of a channel: kPa = gain · value + offset_kpa.

    Attributes:
        unit: Unit of the values as measured.
        gain: kPa per unit.
        offset_kpa: kPa at a value of 0.
        sigma_kpa: σ of the calibration, common to all readings.
        calibrated: Date of the calibration; None if the channel was never calibrated.
        delay_ms: Delay of the readings, for which their times are corrected.
        delay_sigma_ms: σ of the delay, common to all readings.
    """

    unit: str
    gain: float
    offset_kpa: float
    sigma_kpa: float
    calibrated: str | None = None
    delay_ms: float = 0.0
    delay_sigma_ms: float = 0.0

    def kpa(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values in kPa below atmosphere; NaN for one that is too large for it."""
        with np.errstate(over="ignore"):
            kpa = self.gain * value + self.offset_kpa
        return np.where(np.isfinite(kpa), kpa, np.nan)


class RecordedChannel(NamedTuple):
    """A row of the table `channels`.

    Attributes:
        channel: Number of the channel in this file.
        name: Name of the channel.
        quantity: What it measures.
        logger: Name of its logger.
        calibration: See `ChannelCalibration`.
        source: Driver, options, column and further properties of the logger.
    """

    channel: int
    name: str
    quantity: Quantity
    logger: str
    calibration: ChannelCalibration
    source: Mapping[str, Any]

    @property
    def row(self) -> Row:
        """The row itself."""
        documents = (self.calibration._asdict(), dict(self.source))
        return (
            *self[:2],
            str(self.quantity),
            self.logger,
            *(json.dumps(one, ensure_ascii=False) for one in documents),
        )

    @classmethod
    def of(cls, row: Row) -> "RecordedChannel":
        """The channel of a row.

        Raises:
            ValueError: It is damaged.
        """
        channel, name, quantity, logger, calibration, source = row
        if not isinstance(channel, int) or channel not in range(MOST_CHANNELS):
            raise ValueError(f"a channel has the number {channel!r}")
        for text in (name, logger):
            if not isinstance(text, str) or not 0 < len(text) <= LONGEST_NAME or not text.isprintable():
                raise ValueError(f"a channel or a logger has the name {text!r}"[:LONGEST_NAME])
        described = read_json(source)
        if not isinstance(described, dict):
            raise ValueError(f"the source of channel {name} is {described!r}"[:LONGEST_NAME])
        return cls(channel, name, Quantity(quantity), logger, _calibration(read_json(calibration)), described)


def _calibration(stored: Any) -> ChannelCalibration:
    match stored:
        case {
            "unit": str(unit),
            "gain": int() | float() as gain,
            "offset_kpa": int() | float() as offset_kpa,
            "sigma_kpa": int() | float() as sigma_kpa,
            "calibrated": (str() | None) as calibrated,
            "delay_ms": int() | float() as delay_ms,
            "delay_sigma_ms": int() | float() as delay_sigma_ms,
        } if gain != 0 and sigma_kpa >= 0 and delay_sigma_ms >= 0:
            return ChannelCalibration(unit, gain, offset_kpa, sigma_kpa, calibrated, delay_ms, delay_sigma_ms)
    raise ValueError(f"a channel's calibration is {stored!r}"[:LONGEST_NAME])


class ReadingGroup(NamedTuple):
    """A row of the table `readings`.

    Attributes:
        channel: Number of the channel.
        number: Number of the group within the channel.
        readings: Number of readings.
        first_ns: Time of the first reading.
        last_ns: Time of the last.
        dating: Source of their times; see `Dating`.
        time_sigma_ns: Largest σ of their times.
        time_ns: A frame of times; see `encode_times`.
        value: A frame of values; see `encode_values`.
    """

    channel: int
    number: int
    readings: int
    first_ns: int
    last_ns: int
    dating: str
    time_sigma_ns: int
    time_ns: bytes
    value: bytes

    @property
    def digested(self) -> Row:
        """The form that the digest covers: all cells, the lengths of the frames, then their bytes."""
        return (*self[:7], [len(self.time_ns), len(self.value)], self.time_ns + self.value)


class RecordedReadings(NamedTuple):
    """Readings of one group.

    Attributes:
        time_ns: (K,) int64, ascending.
        value: (K,) in the logger's own unit.
        dating: Source of their times.
        time_sigma_ns: σ of each time.
    """

    time_ns: NDArray[np.int64]
    value: NDArray[np.float64]
    dating: Dating
    time_sigma_ns: int


def reading_group(channel: int, number: int, readings: RecordedReadings) -> ReadingGroup:
    """Encodes readings as a group."""
    time_ns, value, dating, sigma_ns = readings
    ends = (int(time_ns[0]), int(time_ns[-1]))
    columns = (encode_times(time_ns), encode_values(value))
    return ReadingGroup(channel, number, len(time_ns), *ends, str(dating), int(sigma_ns), *columns)


def decode_readings(group: ReadingGroup) -> RecordedReadings:
    """The readings of a group.

    Raises:
        ValueError: The group is damaged.
    """
    for number, end in ((group.number, _GROUPS_EVER), (group.time_sigma_ns, LARGEST_SIGMA_NS)):
        _check_whole(number, end)
    time_ns = decode_times(group.time_ns, group.readings)
    if (int(time_ns[0]), int(time_ns[-1])) != (group.first_ns, group.last_ns):
        raise ValueError(f"a group of readings from {group.first_ns!r} to {group.last_ns!r} has others")
    value = decode_values(group.value, group.readings)
    return RecordedReadings(time_ns, value, Dating(group.dating), group.time_sigma_ns)


def _check_whole(number: object, end: int) -> None:
    # Only integers: `range` tests membership of a float by iterating.
    if not isinstance(number, int) or number not in range(end):
        raise ValueError(f"the number of a group, or the σ of its times in ns, is {number!r}")


def encode_times(time_ns: NDArray[np.int64]) -> bytes:
    """Encodes times as differences, which are nearly equal at a steady rate."""
    return frame_of(planes_of(differences(time_ns.astype(np.uint64)[:, None])))


def decode_times(data: bytes, count: int) -> NDArray[np.int64]:
    """Decodes times.

    Raises:
        ValueError: The count is out of range, the bytes are damaged, or the times do not ascend.
    """
    _check_count(count)
    folded = read_planes(data, "<u8", count).reshape(1, count).astype(np.uint64, copy=False)
    times = sums(folded).reshape(count).view(np.int64)
    if (np.diff(times) <= 0).any() or times[0] < 0 or times[-1] >= LARGEST_TIME_NS:
        raise ValueError("times of readings do not ascend, or no clock can have shown them")
    return times


def encode_values(value: NDArray[np.float64]) -> bytes:
    """Encodes values losslessly, in planes of bytes."""
    return frame_of(planes_of(np.ascontiguousarray(value, np.float64).view(np.uint64)))


def decode_values(data: bytes, count: int) -> NDArray[np.float64]:
    """Decodes values.

    Raises:
        ValueError: The count is out of range, the bytes are damaged, or a value is not finite.
    """
    _check_count(count)
    value = read_planes(data, "<u8", count).view("<f8").astype(np.float64, copy=False)
    if not np.isfinite(value).all():
        raise ValueError("a reading is not a number")
    return value


def _check_count(count: object) -> None:
    if not isinstance(count, int) or count not in range(1, MOST_READINGS + 1):
        raise ValueError(f"a group of {count!r} readings; there can be {MOST_READINGS}")
