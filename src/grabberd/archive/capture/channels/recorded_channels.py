"""The channels of a capture file as they are read."""

import sqlite3
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.channels.reading_groups import (
    MOST_CHANNELS,
    ReadingGroup,
    RecordedChannel,
    RecordedReadings,
    decode_readings,
)
from grabberd.archive.capture.channels.stored_account import read_account
from grabberd.archive.capture.checked_rows import CheckedRows, Kind, some_rows
from grabberd.archive.capture.digests import READINGS, Damage, readings_prefix
from grabberd.archive.capture.schema import WITH_CHANNELS, format_of, reading_errors
from grabberd.core.channels import Dating
from grabberd.core.channels.account import Account
from grabberd.errors import NotFound

_LARGEST_FRAME = 1 << 20
"""Bytes of a frame of readings: more than as many as a group may have, kept whole."""
_AT_ONCE = 200
"""Groups read under one lock: a few hundred kilobytes."""
_CHANNELS = (
    "SELECT channel, name, quantity, logger, calibration, source FROM channels ORDER BY channel LIMIT ?"
)
_GROUPS = f"""SELECT channel, number, readings, first_ns, last_ns, dating, time_sigma_ns,
    CASE WHEN length(time_ns) <= {_LARGEST_FRAME} THEN time_ns END,
    CASE WHEN length(value) <= {_LARGEST_FRAME} THEN value END
    FROM readings WHERE channel = :channel AND number >= :first AND number < :end
    ORDER BY number LIMIT :some"""  # noqa: S608 - constants


class ChannelReadings(NamedTuple):
    """The readings of one channel in one capture.

    Attributes:
        channel: The channel with its calibration.
        time_ns: (K,) int64, when each was taken, on the clock of the fields.
        time_s: (K,) the same from the capture's first field on.
        value: (K,) as measured, in the channel's own unit.
        time_sigma_ns: (K,) σ of each time.
        datings: What the times go by; several if the logger was opened anew.
    """

    channel: RecordedChannel
    time_ns: NDArray[np.int64]
    time_s: NDArray[np.float64]
    value: NDArray[np.float64]
    time_sigma_ns: NDArray[np.int64]
    datings: tuple[Dating, ...]

    @property
    def kpa(self) -> NDArray[np.float64]:
        """(K,) kPa below atmosphere."""
        return self.channel.calibration.kpa(self.value)

    @property
    def sigma_kpa(self) -> NDArray[np.float64]:
        """(K,) σ of what the calibration gives, common to all readings."""
        return np.full(len(self.value), self.channel.calibration.sigma_kpa)


def _fetch(connection: sqlite3.Connection, values: Mapping[str, int]) -> list[ReadingGroup]:
    rows = some_rows(connection.execute(_GROUPS, {**values, "some": _AT_ONCE}))
    return [ReadingGroup._make(row) for row in rows]


class RecordedChannels:
    """Reads the channels of a capture file, some groups at a time.

    Args:
        path: The file.
        connection: A connection to it in autocommit mode.
        left_out: Takes up damaged groups, which are left out; None: the first one is an error.
    """

    def __init__(self, path: Path, connection: sqlite3.Connection, left_out: list[Damage] | None) -> None:
        self._path = path
        self._connection = connection
        self._left_out = left_out

    @property
    def all(self) -> list[RecordedChannel]:
        """The channels; none in captures that were recorded without."""
        with reading_errors(self._path):
            if format_of(self._connection) != WITH_CHANNELS:
                return []
            rows = self._connection.execute(_CHANNELS, (MOST_CHANNELS + 1,)).fetchall()
            found = [RecordedChannel.of(row) for row in rows]
            if len({one.name for one in found}) < len(found):
                raise ValueError("two of its channels have one name")
            return found

    @property
    def account(self) -> Account | None:
        """Account of what is there and what is missing; None in captures that were recorded without."""
        with reading_errors(self._path):
            return read_account(self._connection)

    def channel(self, name: str) -> RecordedChannel:
        """A channel by its name.

        Raises:
            NotFound: The capture has none of that name.
        """
        found = self.all
        for one in found:
            if one.name == name:
                return one
        known = ", ".join(one.name for one in found) or "none"
        raise NotFound(f"{self._path.name} has no channel {name}", f"its channels are: {known}")

    def count(self, channel: RecordedChannel) -> int:
        """Number of readings of a channel, without decoding them."""
        query = "SELECT coalesce(sum(readings), 0) FROM readings WHERE channel = ?"
        with reading_errors(self._path):
            return int(self._connection.execute(query, (channel.channel,)).fetchone()[0])

    def groups(self, channel: RecordedChannel) -> Iterator[RecordedReadings]:
        """The readings of a channel in order, half a second at a time."""
        kind = Kind(
            READINGS + channel.name,
            _fetch,
            stored=lambda group: group.digested,
            key=lambda group: group.number,
        )
        rows = CheckedRows(self._path, self._connection, self._left_out)
        prefix = readings_prefix(channel.channel)
        return rows.each(kind, prefix, decode_readings, channel=channel.channel)

    def read(self, name: str) -> ChannelReadings:
        """All readings of a channel.

        Raises:
            NotFound: The capture has none of that name.
        """
        channel = self.channel(name)
        groups = list(self.groups(channel))
        time_ns = np.concatenate([np.empty(0, np.int64), *(one.time_ns for one in groups)])
        with reading_errors(self._path):
            if (np.diff(time_ns) <= 0).any():
                raise ValueError(f"the times of channel {name} do not ascend from group to group")
        sigma_ns = [np.full(len(one.time_ns), one.time_sigma_ns, np.int64) for one in groups]
        return ChannelReadings(
            channel=channel,
            time_ns=time_ns,
            time_s=(time_ns - self._begin_ns) / 1e9,
            value=np.concatenate([np.empty(0), *(one.value for one in groups)]),
            time_sigma_ns=np.concatenate([np.empty(0, np.int64), *sigma_ns]),
            datings=tuple(dict.fromkeys(one.dating for one in groups)),
        )

    @property
    def _begin_ns(self) -> int:
        with reading_errors(self._path):
            row = self._connection.execute("SELECT time_ns FROM fields ORDER BY n LIMIT 1").fetchone()
            return 0 if row is None else int(row[0])
