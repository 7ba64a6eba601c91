"""The channels of a capture file (quantities measured in addition to the picture) and their account.

They are written within the transactions of the capture's writer. The account states what is missing and why;
it is stored in the metadata under the key `channels`.
"""

import itertools
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from grabberd.archive.capture.digests import READINGS, CheckedRows, Damage, Kind, readings_prefix, some_rows
from grabberd.archive.capture.meta import LARGEST_VALUE, StoredPart, TimeNs, read_value, write_meta
from grabberd.archive.capture.reading_groups import (
    INSERT_CHANNEL,
    INSERT_READINGS,
    LONGEST_NAME,
    MOST_CHANNELS,
    MOST_READINGS,
    ReadingGroup,
    RecordedChannel,
    RecordedReadings,
    decode_readings,
    reading_group,
)
from grabberd.archive.capture.rows import NOT_WRITTEN
from grabberd.archive.capture.schema import WITH_CHANNELS, format_of, reading_errors
from grabberd.core.channels import Dating
from grabberd.core.channels.account import (
    LONGEST_TEXT,
    MOST_LISTED,
    SILENT,
    Account,
    AnomalyCount,
    ChannelAccount,
    Gap,
)
from grabberd.errors import NotFound

_LARGEST_FRAME = 1 << 20
"""Largest frame of readings in bytes: more than the largest valid group takes uncompressed."""
_AT_ONCE = 200
"""Groups read under one lock: a few hundred kilobytes."""
_CHANNELS = f"""SELECT channel, name, quantity, logger,
    CASE WHEN length(calibration) <= {LARGEST_VALUE} THEN calibration END,
    CASE WHEN length(source) <= {LARGEST_VALUE} THEN source END
    FROM channels ORDER BY channel LIMIT ?"""  # noqa: S608 - constants
_GROUPS = f"""SELECT channel, number, readings, first_ns, last_ns, dating, time_sigma_ns,
    CASE WHEN length(time_ns) <= {_LARGEST_FRAME} THEN time_ns END,
    CASE WHEN length(value) <= {_LARGEST_FRAME} THEN value END
    FROM readings WHERE channel = :channel AND number >= :first AND number < :end
    ORDER BY number LIMIT :some"""  # noqa: S608 - constants


class ChannelReadings(NamedTuple):
    """The readings of one channel in one capture.

    Attributes:
        channel: The channel with its calibration.
        time_ns: (K,) int64, times of the readings, on the fields' clock.
        time_s: (K,) seconds since the capture's first field.
        value: (K,) as measured, in the channel's own unit.
        time_sigma_ns: (K,) σ of each time.
        datings: Sources of the times; several if the logger was reopened.
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
        """(K,) σ of the calibration, common to all readings."""
        return np.full(len(self.value), self.channel.calibration.sigma_kpa)


def _fetch(connection: sqlite3.Connection, values: Mapping[str, int]) -> list[ReadingGroup]:
    rows = some_rows(connection.execute(_GROUPS, {**values, "some": _AT_ONCE}))
    return [ReadingGroup._make(row) for row in rows]


def groups_of(channel: RecordedChannel) -> Kind:
    """Groups of a channel's readings."""
    name = READINGS + channel.name
    return Kind(name, _fetch, stored=lambda group: group.digested, key=lambda group: group.number)


class RecordedChannels:
    """Reads the channels of a capture file, in batches of groups.

    Args:
        path: The file.
        connection: A connection to it in autocommit mode.
        left_out: Collects damaged groups, which are skipped; None: damage is an error.
    """

    def __init__(self, path: Path, connection: sqlite3.Connection, left_out: list[Damage] | None) -> None:
        self._path = path
        self._connection = connection
        self._left_out = left_out

    @property
    def all(self) -> list[RecordedChannel]:
        """The channels; empty if the capture was recorded without."""
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
        """Account of present and missing readings; None if the capture was recorded without channels."""
        with reading_errors(self._path):
            return read_account(self._connection)

    def channel(self, name: str) -> RecordedChannel:
        """A channel by its name.

        Raises:
            NotFound: The capture has no such channel.
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
        rows = CheckedRows(self._path, self._connection, self._left_out)
        prefix = readings_prefix(channel.channel)
        return rows.each(groups_of(channel), prefix, decode_readings, channel=channel.channel)

    def read(self, name: str) -> ChannelReadings:
        """All readings of a channel.

        Raises:
            NotFound: The capture has no such channel.
        """
        readings = self.readings(self.channel(name))
        with reading_errors(self._path):
            if (np.diff(readings.time_ns) <= 0).any():
                raise ValueError(f"the times of channel {name} do not ascend from group to group")
        return readings

    def readings(self, channel: RecordedChannel) -> ChannelReadings:
        """All readings of a channel, whether or not their times ascend from group to group."""
        groups = list(self.groups(channel))
        time_ns = np.concatenate([np.empty(0, np.int64), *(one.time_ns for one in groups)])
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


Written = tuple[ReadingGroup, RecordedReadings]


class ChannelWriter:
    """Collects readings to be written as groups, and the account.

    Args:
        channels: The channels, numbered from 0.
    """

    def __init__(self, channels: Sequence[RecordedChannel]) -> None:
        self._channels = channels
        self._waiting: dict[int, list[RecordedReadings]] = {one.channel: [] for one in channels}
        self._numbers = {one.channel: itertools.count() for one in channels}
        self._account: Account | None = None
        self._is_stored = True

    def begin(self, connection: sqlite3.Connection) -> None:
        """Stores the channels in a new file, which has tables for them only if there are any."""
        if self._channels:
            connection.executemany(INSERT_CHANNEL, [one.row for one in self._channels])
            nothing = tuple(ChannelAccount(one.name, one.logger) for one in self._channels)
            write_account(connection, Account(nothing))  # in case of a kill before the first readings

    def describe(self, connection: sqlite3.Connection, channel: RecordedChannel) -> None:
        """Replaces the description of a channel with a more complete one."""
        connection.execute(INSERT_CHANNEL, channel.row)

    def add(self, channel: int, readings: RecordedReadings) -> None:
        """Adds readings of a channel, in chronological order."""
        if len(readings.time_ns):
            self._waiting[channel].append(readings)

    def keep(self, account: Account) -> None:
        """Sets the present account of the channels."""
        self._is_stored &= account == self._account
        self._account = account

    def forget(self) -> None:
        """Drops readings that are not written yet."""
        self._waiting = {channel: [] for channel in self._waiting}
        self._is_stored = False

    def write(self, connection: sqlite3.Connection) -> list[Written]:
        """Writes all collected readings and the account; returns the groups with their readings."""
        written = [one for channel in self._waiting for one in self._groups(channel)]
        if written:
            connection.executemany(INSERT_READINGS, [group for group, _ in written])
        if self._account is not None and not self._is_stored:
            write_account(connection, self._account)
        self._is_stored = True
        return written

    def seal(self, connection: sqlite3.Connection) -> None:
        """Closes the account at the last field in the file."""
        if self._account is not None:
            write_account(connection, close_account(connection, self._account))

    def _groups(self, channel: int) -> Iterator[Written]:
        """Groups of the collected readings of a channel, each with one kind of dating."""
        waiting, self._waiting[channel] = self._waiting[channel], []
        for _, alike in itertools.groupby(waiting, key=lambda one: one.dating):
            for part in _parts(alike):
                yield reading_group(channel, next(self._numbers[channel]), part), part


def _parts(alike: Iterable[RecordedReadings]) -> Iterator[RecordedReadings]:
    """Readings with the same dating, split to the maximum size of a group."""
    some = list(alike)
    sigma_ns = max(one.time_sigma_ns for one in some)
    time_ns = np.concatenate([one.time_ns for one in some])
    value = np.concatenate([one.value for one in some])
    for first in range(0, len(time_ns), MOST_READINGS):
        part = slice(first, first + MOST_READINGS)
        yield RecordedReadings(time_ns[part], value[part], some[0].dating, sigma_ns)


def verdict_on(account: Account | None, *, sealed: bool) -> dict[str, str | None]:
    """Verdict on the channels of a capture, and its text, as keys of a document."""
    if account is None:
        return {"verdict": None, "in_words": "no channels were recorded"}
    if not sealed:
        return {"verdict": None, "in_words": "being recorded"}
    return {"verdict": account.verdict, "in_words": account.in_words}


KEY = "channels"
_WRITTEN = """SELECT coalesce(sum(r.readings), 0), max(r.last_ns) FROM channels AS c
    LEFT JOIN readings AS r ON r.channel = c.channel WHERE c.name = ?"""
_FIELDS = """SELECT (SELECT time_ns FROM fields ORDER BY n LIMIT 1),
    (SELECT time_ns FROM fields ORDER BY n DESC LIMIT 1)"""

_Count = Annotated[int, Field(ge=0, lt=1 << 62)]
_Name = Annotated[str, Field(min_length=1, max_length=LONGEST_NAME)]
_Text = Annotated[str, Field(max_length=LONGEST_TEXT)]


class _Gap(StoredPart):
    first_ns: TimeNs
    last_ns: TimeNs
    reason: _Text


class _Channel(StoredPart):
    name: _Name
    logger: _Name
    readings: _Count
    first_ns: TimeNs | None
    last_ns: TimeNs | None
    step_ns: _Count
    gaps: Annotated[list[_Gap], Field(max_length=MOST_LISTED + 2)]
    gap_count: _Count
    gap_ns: _Count
    late: _Text = SILENT
    silence: _Text = SILENT


class _Anomaly(StoredPart):
    logger: _Name
    reason: _Text
    times: _Count
    lost: _Count
    time_ns: TimeNs
    example: _Text


_Anomalies = Annotated[list[_Anomaly], Field(max_length=MOST_LISTED + MOST_CHANNELS)]


class _Account(StoredPart):
    channels: Annotated[list[_Channel], Field(max_length=MOST_CHANNELS)]
    anomalies: _Anomalies = Field(default_factory=list)


def write_account(connection: sqlite3.Connection, account: Account) -> None:
    """Writes the account within the caller's transaction."""
    channels = [{**one._asdict(), "gaps": [gap._asdict() for gap in one.gaps]} for one in account.channels]
    anomalies = [one._asdict() for one in account.anomalies]
    write_meta(connection, {KEY: {"channels": channels, "anomalies": anomalies}})


def read_account(connection: sqlite3.Connection) -> Account | None:
    """The account of a file; None if the capture has no channels.

    Raises:
        ValueError: The account is damaged.
    """
    found = read_value(connection, KEY)
    if found is None:
        return None
    stored = _Account.model_validate(found)
    return Account(
        tuple(_channel_account(one) for one in stored.channels),
        tuple(AnomalyCount(**one.model_dump()) for one in stored.anomalies),
    )


def _channel_account(stored: _Channel) -> ChannelAccount:
    known: dict[str, Any] = stored.model_dump()
    return ChannelAccount(**{**known, "gaps": tuple(Gap(**gap) for gap in known["gaps"])})


def close_account(connection: sqlite3.Connection, account: Account) -> Account:
    """The account of the readings in the file, from its first field to its last."""
    written = tuple(_as_far_as_written(connection, one) for one in account.channels)
    begin_ns, end_ns = connection.execute(_FIELDS).fetchone()
    if begin_ns is None:
        return account._replace(channels=written)
    return account._replace(channels=tuple(one.closed(begin_ns, end_ns) for one in written))


def _as_far_as_written(connection: sqlite3.Connection, account: ChannelAccount) -> ChannelAccount:
    """The account without readings that could not be written to a full disk."""
    readings, last_ns = connection.execute(_WRITTEN, (account.name,)).fetchone()
    if readings == account.readings:
        return account
    first_ns = account.first_ns if readings else None
    return account._replace(readings=readings, first_ns=first_ns, last_ns=last_ns, silence=NOT_WRITTEN)
