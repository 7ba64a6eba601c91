"""The account of a capture's channels, as its metadata keep it under the key `channels`."""

import sqlite3
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from grabberd.archive.capture.channels.reading_groups import LONGEST_NAME, MOST_CHANNELS
from grabberd.archive.capture.ledger_table import NOT_WRITTEN
from grabberd.archive.capture.meta import LARGEST_TIME_NS, write_meta
from grabberd.core.channels.account import (
    LONGEST_TEXT,
    MOST_LISTED,
    SILENT,
    Account,
    AnomalyCount,
    ChannelAccount,
    Gap,
)
from grabberd.files.json_value import read_json

KEY = "channels"
_WRITTEN = """SELECT coalesce(sum(r.readings), 0), max(r.last_ns) FROM channels AS c
    LEFT JOIN readings AS r ON r.channel = c.channel WHERE c.name = ?"""
_FIELDS = """SELECT (SELECT time_ns FROM fields ORDER BY n LIMIT 1),
    (SELECT time_ns FROM fields ORDER BY n DESC LIMIT 1)"""
_TimeNs = Annotated[int, Field(ge=0, lt=LARGEST_TIME_NS)]
_Count = Annotated[int, Field(ge=0, lt=1 << 62)]
_Name = Annotated[str, Field(min_length=1, max_length=LONGEST_NAME)]
_Text = Annotated[str, Field(max_length=LONGEST_TEXT)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="ignore", strict=True)


class _Gap(_Part):
    first_ns: _TimeNs
    last_ns: _TimeNs
    reason: _Text


class _Channel(_Part):
    name: _Name
    logger: _Name
    readings: _Count
    first_ns: _TimeNs | None
    last_ns: _TimeNs | None
    step_ns: _Count
    gaps: Annotated[list[_Gap], Field(max_length=MOST_LISTED + 2)]
    gap_count: _Count
    gap_ns: _Count
    late: _Text = SILENT
    silence: _Text = SILENT


class _Anomaly(_Part):
    logger: _Name
    reason: _Text
    times: _Count
    lost: _Count
    time_ns: _TimeNs
    example: _Text


class _Account(_Part):
    channels: Annotated[list[_Channel], Field(max_length=MOST_CHANNELS)]
    anomalies: Annotated[list[_Anomaly], Field(max_length=MOST_LISTED + MOST_CHANNELS)] = []


def write_account(connection: sqlite3.Connection, account: Account) -> None:
    """Writes the account within the caller's transaction."""
    channels = [{**one._asdict(), "gaps": [gap._asdict() for gap in one.gaps]} for one in account.channels]
    anomalies = [one._asdict() for one in account.anomalies]
    write_meta(connection, {KEY: {"channels": channels, "anomalies": anomalies}})


def read_account(connection: sqlite3.Connection) -> Account | None:
    """The account of a file; None if the capture has no channels.

    Raises:
        ValueError: It is damaged.
    """
    row = connection.execute("SELECT value FROM meta WHERE key = ?", (KEY,)).fetchone()
    if row is None:
        return None
    stored = _Account.model_validate(read_json(row[0]))
    return Account(
        tuple(_channel_account(one) for one in stored.channels),
        tuple(AnomalyCount(**one.model_dump()) for one in stored.anomalies),
    )


def _channel_account(stored: _Channel) -> ChannelAccount:
    known: dict[str, Any] = stored.model_dump()
    return ChannelAccount(**{**known, "gaps": tuple(Gap(**gap) for gap in known["gaps"])})


def close_account(connection: sqlite3.Connection, account: Account) -> Account:
    """The account from the first field in the file to the last, of the readings that are in it."""
    written = tuple(_as_far_as_written(connection, one) for one in account.channels)
    begin_ns, end_ns = connection.execute(_FIELDS).fetchone()
    if begin_ns is None:
        return account._replace(channels=written)
    return account._replace(channels=tuple(one.closed(begin_ns, end_ns) for one in written))


def _as_far_as_written(connection: sqlite3.Connection, account: ChannelAccount) -> ChannelAccount:
    """The account, less readings that a disk without room has not taken."""
    readings, last_ns = connection.execute(_WRITTEN, (account.name,)).fetchone()
    if readings == account.readings:
        return account
    first_ns = account.first_ns if readings else None
    return account._replace(readings=readings, first_ns=first_ns, last_ns=last_ns, silence=NOT_WRITTEN)
