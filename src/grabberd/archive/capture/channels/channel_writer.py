"""Writing the channels of a capture, within the transactions of its writer."""

import itertools
import sqlite3
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from grabberd.archive.capture.channels.reading_codec import MOST_READINGS
from grabberd.archive.capture.channels.reading_groups import (
    INSERT_CHANNEL,
    INSERT_READINGS,
    ReadingGroup,
    RecordedChannel,
    RecordedReadings,
    reading_group,
)
from grabberd.archive.capture.channels.stored_account import close_account, write_account
from grabberd.core.channels.account import Account, ChannelAccount

Written = tuple[ReadingGroup, RecordedReadings]


class ChannelWriter:
    """Readings that wait until they are written as groups, and the account of all.

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
        """Enters the channels in a new file, which has tables for them only if there are some."""
        if self._channels:
            connection.executemany(INSERT_CHANNEL, [one.row for one in self._channels])
            nothing = tuple(ChannelAccount(one.name, one.logger) for one in self._channels)
            write_account(connection, Account(nothing))  # a kill may come before there is more to say

    def describe(self, connection: sqlite3.Connection, channel: RecordedChannel) -> None:
        """Replaces the description of a channel, of which more has become known."""
        connection.execute(INSERT_CHANNEL, channel.row)

    def add(self, channel: int, readings: RecordedReadings) -> None:
        """Adds readings of a channel, which are not older than those before."""
        if len(readings.time_ns):
            self._waiting[channel].append(readings)

    def keep(self, account: Account) -> None:
        """Notes the account of the channels as it is now."""
        self._is_stored &= account == self._account
        self._account = account

    def forget(self) -> None:
        """Drops what was added and is not written."""
        self._waiting = {channel: [] for channel in self._waiting}
        self._is_stored = False

    def write(self, connection: sqlite3.Connection) -> list[Written]:
        """Writes what waits, and the account; returns the groups with what they were made from."""
        written = [one for channel in self._waiting for one in self._groups(channel)]
        if written:
            connection.executemany(INSERT_READINGS, [group for group, _ in written])
        if self._account is not None and not self._is_stored:
            write_account(connection, self._account)
        self._is_stored = True
        return written

    def seal(self, connection: sqlite3.Connection) -> None:
        """Closes the account of what is in the file."""
        if self._account is not None:
            write_account(connection, close_account(connection, self._account))

    def _groups(self, channel: int) -> Iterator[Written]:
        """Groups of what waits of a channel, each of readings that are dated alike."""
        waiting, self._waiting[channel] = self._waiting[channel], []
        for _, alike in itertools.groupby(waiting, key=lambda one: one.dating):
            for part in _parts(alike):
                yield reading_group(channel, next(self._numbers[channel]), part), part


def _parts(alike: Iterable[RecordedReadings]) -> Iterator[RecordedReadings]:
    """Readings that are dated alike, no more together than a group may have."""
    some = list(alike)
    sigma_ns = max(one.time_sigma_ns for one in some)
    time_ns = np.concatenate([one.time_ns for one in some])
    value = np.concatenate([one.value for one in some])
    for first in range(0, len(time_ns), MOST_READINGS):
        part = slice(first, first + MOST_READINGS)
        yield RecordedReadings(time_ns[part], value[part], some[0].dating, sigma_ns)
