"""Readings of a logger: from its thread to its readers, as means of the last minutes, and into a capture."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd import runtime
from grabberd.archive.capture.reading_groups import ChannelCalibration, RecordedChannel, RecordedReadings
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.config import LoggerConfig
from grabberd.core.channels import Anomaly, Dating, LoggerInfo
from grabberd.core.channels.account import Account, AnomalyLedger, ChannelAccount, ChannelLedger
from grabberd.core.channels.vacuum import Channel
from grabberd.instrument.channels.logger_board import LoggerBoard
from grabberd.runtime import UtcClock

STEP_NS = 20_000_000
"""Time over which readings are averaged: short compared with a pulsation, at any rate of the camera."""
STEPS = 15_000
"""Five minutes: 120 kB, and 180 kB for each channel."""


class StepMeans:
    """A ring of time steps, placed by their time, so that gaps are kept.

    Args:
        channels: Number of channels.
    """

    def __init__(self, channels: int) -> None:
        self._step = np.full(STEPS, -1, np.int64)
        self._sum = np.zeros((STEPS, channels))
        self._count = np.zeros((STEPS, channels), np.uint32)

    def add(self, time_ns: NDArray[np.int64], values: NDArray[np.float64]) -> None:
        """Adds readings: (K,) and (K, channels), NaN where a channel has none."""
        steps = time_ns // STEP_NS
        places = steps % STEPS
        fresh = places[self._step[places] != steps]
        self._sum[fresh], self._count[fresh] = 0.0, 0
        self._step[places] = steps
        known = np.isfinite(values)
        np.add.at(self._sum, places, np.where(known, values, 0.0))
        np.add.at(self._count, places, known)

    def since(self, time_ns: int, channel: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """(K,) middle of each step since a time in which the channel has readings, and (K,) its mean."""
        found = np.flatnonzero((self._step >= time_ns // STEP_NS) & (self._count[:, channel] > 0))
        found = found[np.argsort(self._step[found])]
        means = self._sum[found, channel] / self._count[found, channel]
        return self._step[found] * STEP_NS + STEP_NS // 2, means


KEPT_NS = 10_000_000_000
"""Age of the readings that are kept for pre-triggers and for display."""
MOST_KEPT = 200_000
"""Number of readings that are kept, and that may wait for a capture whose disk stalls."""
DISK_TOO_SLOW = "disk too slow"


class Part(NamedTuple):
    """Readings that came together.

    Attributes:
        posted_ns: When they came.
        time_ns: (K,) when each was taken, ascending.
        values: (K, C) of the logger's channels in their order, in its own units; NaN where one has none.
        kpa: (K, C) the same in kPa below atmosphere; of a light unchanged.
        calibrations: Conversions from values to kPa; the same object for all parts of one opening.
        dating: Base of the times.
        time_sigma_ns: σ of each.
        anomalies: Whatever else came.
        interruption: Why no more readings come, or None.
    """

    posted_ns: int
    time_ns: NDArray[np.int64]
    values: NDArray[np.float64]
    kpa: NDArray[np.float64]
    calibrations: tuple[ChannelCalibration, ...]
    dating: Dating
    time_sigma_ns: int
    anomalies: tuple[Anomaly, ...] = ()
    interruption: str | None = None

    @classmethod
    def interrupted(cls, posted_ns: int, reason: str) -> "Part":
        """A part without readings, and the reason."""
        nothing = np.empty((0, 0))
        return cls(posted_ns, np.empty(0, np.int64), nothing, nothing, (), Dating.ARRIVAL, 0, (), reason)

    @property
    def newest_ns(self) -> int:
        """Time of its last reading, or of its arrival if it has none."""
        return int(self.time_ns[-1]) if len(self.time_ns) else self.posted_ns

    def until(self, time_ns: int) -> tuple["Part", "Part | None"]:
        """The part up to a time, and the rest; anomalies are split by their own times."""
        if self.newest_ns <= time_ns:
            return self, None
        count = int(np.searchsorted(self.time_ns, time_ns, side="right"))
        earlier = tuple(one for one in self.anomalies if one.time_ns <= time_ns)
        later = tuple(one for one in self.anomalies if one.time_ns > time_ns)
        first = self._rows(slice(None, count))._replace(anomalies=earlier, interruption=None)
        return first, self._rows(slice(count, None))._replace(anomalies=later)

    def _rows(self, rows: slice) -> "Part":
        return self._replace(time_ns=self.time_ns[rows], values=self.values[rows], kpa=self.kpa[rows])


class Follower:
    """Parts that wait for one capture; those that do not fit are counted."""

    def __init__(self, feed: "Feed", kept: list[Part]) -> None:
        self._feed = feed
        self._parts = deque(kept)
        self._waiting = sum(len(one.time_ns) for one in kept)
        self._refused = 0

    def take(self, until_ns: int) -> list[Part]:
        """Removes and returns the parts up to a time, in order."""
        taken = []
        with self._feed.lock:
            while self._parts:
                first, rest = self._parts.popleft().until(until_ns)
                self._waiting -= len(first.time_ns)
                taken.append(first)
                if rest is not None:
                    self._parts.appendleft(rest)
                    break
        return taken

    def close(self) -> None:
        """Stops following."""
        with self._feed.lock:
            self._feed.followers.discard(self)

    def put(self, part: Part) -> None:
        """Adds a part; called by the feed, which holds the lock."""
        if self._waiting + len(part.time_ns) > MOST_KEPT:
            self._refused += len(part.time_ns)
            return
        if self._refused:
            lost = Anomaly(part.posted_ns, DISK_TOO_SLOW, "", self._refused)
            part, self._refused = part._replace(anomalies=(lost, *part.anomalies)), 0
        self._parts.append(part)
        self._waiting += len(part.time_ns)


class Feed:
    """Takes parts from the logger's thread; reading them does not delay that thread.

    Attributes:
        lock: Held while a part is passed on.
        followers: The captures that record all readings.
        newest_ns: Time of the newest reading; None before the first.
        newest_sigma_ns: Its σ.
    """

    def __init__(self) -> None:
        self.lock = runtime.lock()
        self.followers: set[Follower] = set()
        self.newest_ns: int | None = None
        self.newest_sigma_ns: int | None = None
        self._means: StepMeans | None = None
        self._kept: deque[Part] = deque()
        self._count = 0

    def put(self, part: Part) -> None:
        """Passes a part on to all followers, and drops parts that are too old."""
        with self.lock:
            self._kept.append(part)
            self._count += len(part.time_ns)
            if len(part.time_ns):
                self.newest_ns, self.newest_sigma_ns = part.newest_ns, part.time_sigma_ns
                self._means = self._means or StepMeans(part.kpa.shape[1])
                self._means.add(part.time_ns, part.kpa)
            oldest_ns = part.posted_ns - KEPT_NS
            while self._kept and (self._count > MOST_KEPT or self._kept[0].posted_ns < oldest_ns):
                self._count -= len(self._kept.popleft().time_ns)
            for follower in self.followers:
                follower.put(part)

    def follow(self) -> Follower:
        """Follows the feed from now on, including the kept parts."""
        with self.lock:
            follower = Follower(self, list(self._kept))
            self.followers.add(follower)
            return follower

    def newest(self, since_ns: int) -> list[Part]:
        """Parts with readings that came since a time, in order."""
        with self.lock:
            return [one for one in self._kept if one.posted_ns >= since_ns and len(one.time_ns)]

    def means_since(self, since_ns: int, channel: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """(K,) middle of each step in which a channel has readings, and (K,) its mean."""
        with self.lock:
            if self._means is None:
                return np.empty(0, np.int64), np.empty(0)
            return self._means.since(since_ns, channel)


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
