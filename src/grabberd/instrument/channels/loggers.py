"""All data loggers: started and stopped with the service, reported as faults, followed by captures."""

import itertools
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.reading_groups import RecordedChannel
from grabberd.config.section import without_secrets
from grabberd.core.channels import Dating, LoggerInfo
from grabberd.core.channels.vacuum import Channel
from grabberd.documents.channels import ChannelValueDocument, LoggerDocument
from grabberd.documents.document import assembled
from grabberd.documents.enums import DeviceState
from grabberd.errors import Cause
from grabberd.fault_board import FaultBoard
from grabberd.instrument.channels.feed import ChannelRecording, Feed, LoggerRecording, calibration_of
from grabberd.instrument.channels.logger_board import LoggerBoard
from grabberd.instrument.channels.logger_setup import LoggerSetup
from grabberd.instrument.channels.logger_thread import LoggerThread
from grabberd.runtime import SystemClock, UtcClock

STOP_S = 1.0
"""Time for all loggers together to close; one that hangs is abandoned."""
SHOWN_NS = 500_000_000
"""Age of the readings whose mean is shown as the current value."""
_TROUBLED = (DeviceState.ABSENT, DeviceState.FAILED)


@dataclass(frozen=True, slots=True)
class _Logger:
    setup: LoggerSetup
    feed: Feed
    board: LoggerBoard
    thread: LoggerThread

    def is_settled(self, sigma_ns: int) -> bool:
        """True if its readings are dated to within a σ, or waiting longer would not help."""
        status = self.board.now
        if not status.is_reading:
            return status.state is not DeviceState.OPENING
        if status.info is None or status.info.dating is not Dating.OWN_CLOCK:
            return True
        newest_sigma_ns = self.feed.newest_sigma_ns
        return newest_sigma_ns is not None and newest_sigma_ns <= sigma_ns


class ChannelMeans(NamedTuple):
    """Means of the readings of one channel, over the time of a field each.

    Attributes:
        channel: The channel.
        logger: Name of its logger.
        time_ns: (K,) middle of each time, ascending; those without readings are omitted.
        kpa: (K,) kPa below atmosphere, or the level of a light.
    """

    channel: Channel
    logger: str
    time_ns: NDArray[np.int64]
    kpa: NDArray[np.float64]


class Loggers:
    """The loggers of a configuration.

    Args:
        setups: Their parts, by name.
        clock: Source of time.
        faults: Where trouble is reported; None: only in their documents.
    """

    def __init__(
        self,
        setups: Mapping[str, LoggerSetup],
        clock: UtcClock | None = None,
        faults: FaultBoard | None = None,
    ) -> None:
        self._clock = clock or SystemClock()
        self._faults = faults
        self._loggers = {name: self._logger(setup) for name, setup in setups.items()}

    def _logger(self, setup: LoggerSetup) -> _Logger:
        feed, board = Feed(), LoggerBoard(setup.name, self._clock, self.look)
        return _Logger(setup, feed, board, LoggerThread(setup, feed, board, self._clock))

    def start(self) -> None:
        """Opens all of them, each in a separate thread."""
        for one in self._loggers.values():
            one.thread.start()

    def stop(self) -> None:
        """Closes all of them; those that hang delay it by `STOP_S` at most."""
        started = [one.thread for one in self._loggers.values() if one.thread.ident is not None]
        for thread in started:
            thread.stop()
        end_ns = self._clock.now_ns() + STOP_S * 1e9
        for thread in started:
            thread.join(max(end_ns - self._clock.now_ns(), 0) / 1e9)

    def follow(self, device: str, *, same_clock: bool) -> ChannelRecording | None:
        """Follows the channels of a device for a capture, with the last ten seconds.

        Args:
            device: Name of the device.
            same_clock: False if its fields have another clock than the loggers; then nothing is recorded,
                and the ledger states this.

        Returns:
            None if the device has no channels.
        """
        recordings, numbers = [], itertools.count()
        for one in self._loggers.values():
            channels = {
                place: _recorded(next(numbers), channel, one.setup, one.board.now.info)
                for place, channel in enumerate(one.setup.channels)
                if not channel.devices or device in channel.devices
            }
            if channels:
                follower = one.feed.follow() if same_clock else None
                recordings.append(LoggerRecording(one.board, channels, follower))
        return ChannelRecording(recordings, self._clock) if recordings else None

    def means(self, device: str, since_ns: int) -> list[ChannelMeans]:
        """Means of the channels of a device since a time, for the last minutes."""
        return [
            ChannelMeans(channel, name, *one.feed.means_since(since_ns, place))
            for name, one in self._loggers.items()
            for place, channel in enumerate(one.setup.channels)
            if not channel.devices or device in channel.devices
        ]

    def unsettled(self, sigma_ns: int) -> list[str]:
        """Names of loggers that are not open yet, or whose clocks are not yet synchronised to within a σ."""
        return [name for name, one in self._loggers.items() if not one.is_settled(sigma_ns)]

    def ages_s(self) -> dict[str, float]:
        """Age of the newest reading of each logger that has had one."""
        now_ns = self._clock.now_ns()
        known = {name: one.feed.newest_ns for name, one in self._loggers.items()}
        return {name: (now_ns - ns) / 1e9 for name, ns in known.items() if ns is not None}

    def document(self) -> dict[str, LoggerDocument]:
        """Current documents of the loggers, by name."""
        since_ns = self._clock.now_ns() - SHOWN_NS
        return {name: _document(one, since_ns) for name, one in self._loggers.items()}

    def look(self) -> None:
        """Reports loggers in trouble as one fault, and doubtful ones as another."""
        if self._faults is None:
            return
        now = {name: one.board.now for name, one in self._loggers.items()}
        troubled = {name: one for name, one in now.items() if one.state in _TROUBLED}
        doubtful = {name: one.doubt for name, one in now.items() if one.doubt and name not in troubled}
        if troubled:
            self._faults.report(
                Cause.LOGGER_FAILED,
                f"no readings: {'; '.join(f'{name}: {one.cause}' for name, one in troubled.items())}",
                f"{'; '.join(dict.fromkeys(one.hint or '' for one in troubled.values()))}; captures go on "
                "without these channels",
            )
        else:
            self._faults.resolve(Cause.LOGGER_FAILED)
        if doubtful:
            said = "; ".join(
                f"{name}: {one.reason}{f' ({one.example})' if one.example else ''}"
                for name, one in doubtful.items()
            )
            self._faults.report(
                Cause.LOGGER_DOUBTFUL,
                f"doubtful readings: {said}",
                "check the logger's cable, its settings and its unit; captures count such readings",
                "warning",
            )
        else:
            self._faults.resolve(Cause.LOGGER_DOUBTFUL)


def _recorded(number: int, channel: Channel, setup: LoggerSetup, info: LoggerInfo | None) -> RecordedChannel:
    """A channel as stored in a capture."""
    source = {
        "driver": setup.config.driver,
        "options": without_secrets(setup.config.options),
        "column": channel.column,
        "found": None if info is None else asdict(info),
    }
    calibration = calibration_of(channel, setup.config, info)
    return RecordedChannel(number, channel.name, channel.quantity, setup.name, calibration, source)


def _document(logger: _Logger, since_ns: int) -> LoggerDocument:
    status, setup = logger.board.now, logger.setup
    info = status.info
    now = _present(logger, since_ns) if status.is_reading else {}
    return assembled(
        LoggerDocument,
        status,
        name=setup.name,
        driver=setup.config.driver,
        cause_code=status.code,
        model=info and info.model,
        rate_hz=info and info.rate_hz,
        dating=info and info.dating,
        anomalies={one.reason: one.times for one in status.anomalies},
        lost=sum(one.lost for one in status.anomalies),
        warnings=list(info.remarks) if info else [],
        channels={
            one.name: assembled(
                ChannelValueDocument,
                one,
                kpa=now.get(one.name) if one.quantity.is_vacuum else None,
                level=None if one.quantity.is_vacuum else now.get(one.name),
            )
            for one in setup.channels
        },
    )


def _present(logger: _Logger, since_ns: int) -> dict[str, float]:
    """The mean of the newest readings of each vacuum, and the newest of each light."""
    parts, found = logger.feed.newest(since_ns), {}
    for place, one in enumerate(logger.setup.channels if parts else ()):
        kpa = np.concatenate([part.kpa[:, place] for part in parts])
        kpa = kpa[np.isfinite(kpa)]
        if len(kpa):
            found[one.name] = round(float(kpa.mean() if one.quantity.is_vacuum else kpa[-1]), 2)
    return found
