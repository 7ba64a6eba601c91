"""The only thread that uses a logger: opens it, takes its readings, and reopens it when none come.

Readings are checked before they are used: a driver may have errors like every other program.
"""

import logging

import numpy as np

from grabberd import runtime
from grabberd.core.channels import Anomaly, LoggerInfo, Readings
from grabberd.core.channels.vacuum import VacuumChannels
from grabberd.documents.enums import DeviceState
from grabberd.errors import GrabberdError, StreamEnded, StreamFailed
from grabberd.instrument.channels.feed import Feed, Part, calibration_of
from grabberd.instrument.channels.logger_board import LoggerBoard
from grabberd.instrument.channels.logger_setup import LoggerSetup
from grabberd.instrument.device.recovery import (
    PROVEN_S,
    RETRIES,
    STATES,
    FaultLog,
    Trouble,
    reason_of,
    trouble_of,
)
from grabberd.runtime import UtcClock

AHEAD_NS = 1_000_000_000
"""How far a reading may be in the future: synchronised clocks differ by less."""
NOT_FINITE = "not a finite number"
TIME_BACK = "its time went back"
TIME_AHEAD = "its time is ahead of the clock"


def checked(readings: Readings, info: LoggerInfo, last_ns: int, now_ns: int) -> Readings:
    """Readings without the impossible ones; each kind of those adds an anomaly.

    Args:
        readings: The driver's readings.
        info: The logger as found.
        last_ns: Time of the previous reading.
        now_ns: The current time.

    Raises:
        StreamFailed: They do not have this logger's columns.
    """
    time_ns, values, anomalies = readings.time_ns, readings.values, list(readings.anomalies)
    if values.shape != (len(time_ns), len(info.channels)):
        raise StreamFailed(
            f"the driver gave {len(time_ns)} times and values of shape {values.shape} "
            f"for {len(info.channels)} columns",
            "please report this to whoever wrote the driver",
        )
    ahead = time_ns > now_ns + AHEAD_NS
    before_ns = np.maximum.accumulate(np.concatenate(([last_ns], np.where(ahead, last_ns, time_ns))))[:-1]
    back = ~ahead & (time_ns <= before_ns)
    for wrong, reason in ((ahead, TIME_AHEAD), (back, TIME_BACK)):
        if wrong.any():
            example = f"{(time_ns[wrong][0] - now_ns) / 1e9:+.3f} s from now"
            anomalies.append(Anomaly(now_ns, reason, example, int(wrong.sum())))
    good = ~(ahead | back)
    time_ns, values = time_ns[good], values[good]
    infinite = np.isinf(values)
    if infinite.any():
        anomalies.append(Anomaly(now_ns, NOT_FINITE, "inf", int(infinite.any(axis=1).sum())))
        values = np.where(infinite, np.nan, values)
    return readings._replace(time_ns=time_ns, values=values, anomalies=tuple(anomalies))


log = logging.getLogger(__name__)

READ_TIMEOUT_S = 0.1
"""Longest wait for readings, and so the longest delay of a stop."""
SILENT_S, SILENT_STEPS = 3.0, 10.0
"""Silence after which a logger has failed: this time and this number of readings."""


class LoggerThread(runtime.Thread):
    """Takes readings into the feed until it is stopped, and never waits for other threads.

    Args:
        setup: Parts of the logger.
        feed: Receives the readings.
        board: Status of the logger.
        clock: Source of time.
        stopping: Set to end the thread.
    """

    def __init__(
        self,
        setup: LoggerSetup,
        feed: Feed,
        board: LoggerBoard,
        clock: UtcClock,
        stopping: runtime.Event | None = None,
    ) -> None:
        super().__init__(name=f"logger-{setup.name}", daemon=True)
        self._setup = setup
        self._logger = setup.logger
        self._feed = feed
        self._board = board
        self._clock = clock
        self._stopping = stopping or runtime.event()
        self._retries = 0
        self._trouble: Trouble | None = None
        self._faults = FaultLog(log, f"logger {board.name}: its thread failed")

    def stop(self) -> None:
        """Ends the thread within a read's time-out; the logger is closed."""
        self._stopping.set()

    def run(self) -> None:
        """Reads and reopens until stopped."""
        while not self._stopping.is_set():
            opened_ns = self._clock.now_ns()
            error = self._until_it_fails()
            self._close()
            if error is None:
                return
            self._feed.put(Part.interrupted(self._clock.now_ns(), reason_of(error)))
            if isinstance(error, StreamEnded):
                self._board.enter(DeviceState.ENDED, error)
                return
            proven = self._clock.now_ns() - opened_ns >= PROVEN_S * 1e9
            self._stopping.wait(self._pause_s(error, proven=proven))

    def _pause_s(self, error: GrabberdError, *, proven: bool) -> float:
        """Wait before the next opening: the same as that of a grabber."""
        trouble = trouble_of(error)
        if proven or trouble is not self._trouble:
            self._trouble, self._retries = trouble, 0
        self._board.enter(STATES[trouble], error)
        wait_s = RETRIES[trouble].wait_s(self._retries)
        self._retries += 1
        return wait_s

    def _until_it_fails(self) -> GrabberdError | None:
        """Opens the logger and reads; returns why no more readings come, or None when it is stopped."""
        try:
            info = self._logger.open()
            self._board.opened(info)
            self._read(info, VacuumChannels(self._setup.channels, info, self._setup.config.delay_ns))
        except GrabberdError as error:
            return error
        except Exception as error:
            return self._faults.refusal(error)
        return None

    def _read(self, info: LoggerInfo, channels: VacuumChannels) -> None:
        columns = [info.channels.index(one.column) for one in channels.channels]
        calibrations = tuple(calibration_of(one, self._setup.config, info) for one in channels.channels)
        silent_s = max(SILENT_S, SILENT_STEPS / info.rate_hz) if info.rate_hz else SILENT_S
        came_ns = self._clock.now_ns()
        while not self._stopping.is_set():
            readings = self._logger.read(READ_TIMEOUT_S)
            now_ns = self._clock.now_ns()
            last_ns = (self._feed.newest_ns or 0) + self._setup.config.delay_ns
            readings = checked(readings, info, last_ns, now_ns)
            time_ns, kpa, sigma_ns, anomalies = channels.vacuum(readings)
            if len(time_ns) or anomalies:
                values = (readings.values[:, columns], kpa, calibrations)
                about = (info.dating, sigma_ns or info.time_sigma_ns, anomalies)
                self._feed.put(Part(now_ns, time_ns, *values, *about))
            self._board.came(len(time_ns), anomalies)
            if len(readings.time_ns):
                came_ns = now_ns
            elif now_ns - came_ns > silent_s * 1e9:
                hint = "check its cable and its supply; it is reopened automatically"
                raise StreamFailed(f"no reading for {silent_s:g} s", hint)

    def _close(self) -> None:
        try:
            self._logger.close()
        except Exception as error:
            self._faults.refusal(error)
