"""The channels of one capture while it is recorded: from the loggers' feeds into its file."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from grabberd.archive.capture.reading_groups import ChannelCalibration, RecordedChannel, RecordedReadings
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.clock import UtcClock
from grabberd.config import LoggerConfig
from grabberd.core.channels import Anomaly, LoggerInfo
from grabberd.core.channels.account import Account, AnomalyLedger, ChannelAccount, ChannelLedger
from grabberd.core.channels.vacuum import Channel
from grabberd.instrument.channels.feed import Follower, Part
from grabberd.instrument.channels.logger_board import LoggerBoard

UNKNOWN_UNIT = "not stated yet"
LEVEL = "level"
"""Unit of a light if its logger states none."""
DELAY_SIGMA_MS = 5.0
"""σ of the delay of a logger if it was not measured: that of an adapter on USB."""


def calibration_of(channel: Channel, config: LoggerConfig, info: LoggerInfo | None) -> ChannelCalibration:
    """The calibration of a channel: two readings define a straight line.

    Args:
        channel: The channel as configured.
        config: Its logger's part of the configuration.
        info: The logger as found, which may state the unit; None before it was opened.
    """
    unit = channel.unit or (None if info is None else channel.stated_unit(info))
    if unit is None and info is not None and not channel.quantity.is_vacuum:
        unit = LEVEL
    known = (channel.sigma_kpa, channel.calibrated, config.delay_ms, _delay_sigma_ms(config, info))
    if unit is None:
        return ChannelCalibration(UNKNOWN_UNIT, 1.0, 0.0, *known)
    at_0, at_1 = channel.kpa(np.array([0.0, 1.0]), unit).tolist()
    return ChannelCalibration(unit, at_1 - at_0, at_0, *known)


def _delay_sigma_ms(config: LoggerConfig, info: LoggerInfo | None) -> float:
    """The σ of the delay as configured, or as known to the driver."""
    if config.delay_sigma_ms is not None:
        return config.delay_sigma_ms
    known_ns = None if info is None else info.delay_sigma_ns
    return DELAY_SIGMA_MS if known_ns is None else known_ns / 1e6


MARGIN_NS = 250_000_000
"""Time by which readings extend past the first and last field, whose vacuum is interpolated."""
LAST_NS = 1_000_000_000
"""Longest wait for the last readings; after that the capture is sealed without them."""
OTHER_UNIT = "its unit has changed"
OTHER_CLOCK = "the fields do not go by this computer's clock"


@dataclass
class LoggerRecording:
    """Channels of one logger.

    Attributes:
        board: Status of the logger.
        channels: Its channels that are recorded, by their place among all of the logger's.
        follower: Its readings; None if they cannot be recorded.
        ledgers: Accounts of the channels, in the same order.
        newest_ns: Time of the newest recorded reading.
    """

    board: LoggerBoard
    channels: dict[int, RecordedChannel]
    follower: Follower | None
    ledgers: list[ChannelLedger] = field(init=False)
    newest_ns: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        names = [(channel.name, channel.logger) for channel in self.channels.values()]
        self.ledgers = [ChannelLedger(ChannelAccount(*one)) for one in names]
        status = self.board.now
        if self.follower is None:
            self.interrupted(OTHER_CLOCK)
        elif not status.is_reading:
            self.interrupted(status.cause or "not opened yet")

    def interrupted(self, reason: str) -> None:
        """Notes why no more readings come."""
        for ledger in self.ledgers:
            ledger.interrupted(reason)

    @property
    def is_reading(self) -> bool:
        """True if readings may still come."""
        return self.follower is not None and self.board.now.is_reading


class ChannelRecording:
    """Readings of a capture; used by its writer's thread.

    Args:
        loggers: The channels, by their loggers.
        clock: Source of time.
    """

    def __init__(self, loggers: Sequence[LoggerRecording], clock: UtcClock) -> None:
        self._loggers = loggers
        self._clock = clock
        self._anomalies = AnomalyLedger()
        self._end_ns: int | None = None
        self._due_ns = 0

    @property
    def channels(self) -> list[RecordedChannel]:
        """The channels, numbered from 0."""
        return [channel for logger in self._loggers for channel in logger.channels.values()]

    @property
    def account(self) -> Account:
        """Account of the channels so far."""
        ledgers = [ledger.account for logger in self._loggers for ledger in logger.ledgers]
        return Account(tuple(ledgers), self._anomalies.counts)

    def write(self, writer: CaptureWriter, first_ns: int, newest_ns: int) -> None:
        """Writes the readings that belong to the written fields.

        Args:
            writer: The capture's file.
            first_ns: Time of the first field.
            newest_ns: Time of the newest.

        Raises:
            StorageError: It cannot be written.
        """
        begin_ns, until_ns = first_ns - MARGIN_NS, newest_ns + MARGIN_NS
        for logger in self._loggers:
            if logger.follower is not None:
                for part in logger.follower.take(until_ns):
                    self._enter(writer, logger, part, begin_ns)
        writer.keep_account(self.account)

    def has_all(self, newest_ns: int) -> bool:
        """True if no more readings up to the last field are expected, or the wait for them is over.

        Args:
            newest_ns: Time of the last field.
        """
        now_ns = self._clock.now_ns()
        if self._end_ns is None:
            self._end_ns, self._due_ns = newest_ns + MARGIN_NS, now_ns + LAST_NS
        waits = [one for one in self._loggers if one.is_reading and one.newest_ns < self._end_ns]
        return not waits or now_ns >= self._due_ns

    def close(self) -> None:
        """Stops taking readings."""
        for logger in self._loggers:
            if logger.follower is not None:
                logger.follower.close()

    def _enter(self, writer: CaptureWriter, logger: LoggerRecording, part: Part, begin_ns: int) -> None:
        logger.newest_ns = max(logger.newest_ns, part.newest_ns)
        anomalies = [one for one in part.anomalies if one.time_ns >= begin_ns]
        self._anomalies.enter(logger.board.name, anomalies)
        new = part.time_ns >= begin_ns
        if len(new) and not new.any():
            for ledger in logger.ledgers:
                ledger.resumed()
        if new.any():
            for place, ledger in zip(tuple(logger.channels), logger.ledgers, strict=True):
                known = new & np.isfinite(part.kpa[:, place])
                if self._is_of(writer, logger, place, part):
                    ledger.enter(part.time_ns[known])
                    about = (part.dating, part.time_sigma_ns)
                    readings = RecordedReadings(part.time_ns[known], part.values[known, place], *about)
                    writer.append_readings(logger.channels[place].channel, readings)
                else:
                    words = f"{logger.channels[place].name}: {part.calibrations[place].unit}"
                    lost = Anomaly(part.newest_ns, OTHER_UNIT, words, int(known.sum()))
                    self._anomalies.enter(logger.board.name, [lost])
        if part.interruption is not None:
            logger.interrupted(part.interruption)

    @staticmethod
    def _is_of(writer: CaptureWriter, logger: LoggerRecording, place: int, part: Part) -> bool:
        """True if values of a part have the same unit as those before; the first ones determine it."""
        channel, calibration = logger.channels[place], part.calibrations[place]
        if channel.calibration.unit == UNKNOWN_UNIT:
            channel = logger.channels[place] = channel._replace(calibration=calibration)
            writer.describe_channel(channel)
        return channel.calibration == calibration
