"""Channels and readings made up for the tests."""

import numpy as np

from archive.captures import MADE_WITH, META, PERIOD_NS, START_NS, batches, ledger_of, meta, points
from grabberd.archive.capture.reading_groups import (
    ChannelCalibration,
    RecordedChannel,
    RecordedReadings,
)
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.core.channels import Dating, Quantity
from grabberd.core.channels.account import Account, ChannelAccount, ChannelLedger

STEP_NS = 5_000_000
SIGMA_NS = 300_000
CALIBRATION = ChannelCalibration("mbar", -0.1, 101.3, 0.2, "2026-02-03")
CHANNELS = (
    RecordedChannel(
        0, "pulsation", Quantity.PULSATION, "tank", CALIBRATION, {"driver": "fake", "column": "p1"}
    ),
    RecordedChannel(
        1, "liner", Quantity.LINER, "tank", ChannelCalibration("kPa", 1.0, 0.0, 0.1), {"driver": "fake"}
    ),
)


def readings(first, count, dating=Dating.OWN_CLOCK, channel=0):
    """Readings `first` … of a channel, of which 0 was taken with the first field."""
    k = np.arange(first, first + count)
    value = np.round(600 + 400 * np.sin(k / 30 + channel), 2)
    return RecordedReadings(START_NS + k * STEP_NS, value, dating, SIGMA_NS)


def write_with_channels(
    directory,
    taken,
    *,
    name="liner",
    sealed=True,
    measured=(),
    fields_a_commit=25,
    dating=Dating.OWN_CLOCK,
    anomalies=(),
):
    """A capture with two channels, of which each commit has as many readings as its fields take time."""
    writer = CaptureWriter.create(directory / f"{name}.grab.part", meta(), channels=CHANNELS)
    if measured:
        writer.begin_run(1, "live", META.created_utc, "0.1.0", MADE_WITH)
    ledgers = [ChannelLedger(ChannelAccount(one.name, one.logger)) for one in CHANNELS]
    per_field = PERIOD_NS // STEP_NS
    for some in batches(taken, fields_a_commit):
        writer.append(some)
        for one in some:
            if one.n in measured:
                writer.append_points(1, one.n, points(one.n))
        for channel, ledger in zip(CHANNELS, ledgers, strict=True):
            count = len(some) * per_field
            part = readings(some[0].n * per_field, count, dating, channel=channel.channel)
            writer.append_readings(channel.channel, part)
            ledger.enter(part.time_ns)
        writer.keep_account(Account(tuple(one.account for one in ledgers), anomalies))
        writer.commit()
    if not sealed:
        writer.close()
        return writer.path
    ledger = ledger_of(taken)
    return writer.seal(ledger, complete=ledger.complete, ended_because="length reached")
