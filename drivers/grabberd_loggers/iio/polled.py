"""A device that is polled: one file a channel, read at a steady rate."""

import math
import os
from collections.abc import Sequence

import numpy as np

from grabberd.clock import Clock
from grabberd.core.channels import Anomaly, Dating, Readings
from grabberd.errors import DeviceLost
from grabberd_loggers.iio.tree import IioChannel

MISSED = "a reading was left out: the one before took too long"
FAILED, NOT_A_NUMBER = "a channel could not be read", "not a number"
_GONE = "plug the sensor in again, or load its driver; grabberd retries automatically"
_USUAL_NS = 200_000
"""Time that a conversion usually takes."""


class PolledChannels:
    """Reads channels one after the other, at a steady rate.

    Args:
        channels: Channels to read.
        rate_hz: Readings per second.
        clock: Clock that they are read by.

    Raises:
        OSError: A channel cannot be opened.
    """

    dating = Dating.MONOTONIC
    time_sigma_ns = _USUAL_NS

    def __init__(self, channels: Sequence[IioChannel], rate_hz: float, clock: Clock) -> None:
        self._channels, self._clock = channels, clock
        self._period_ns = round(1e9 / rate_hz)
        self.rate_hz: float | None = rate_hz
        self._files: list[int] = []
        try:
            self._files += [os.open(channel.file, os.O_RDONLY) for channel in channels]
        except OSError:
            self.close()
            raise
        self._due_ns = clock.now_ns()

    def read(self, timeout_s: float) -> Readings:
        """The next reading, once it is due.

        Raises:
            DeviceLost: The device went away.
        """
        wait_ns = self._due_ns - self._clock.now_ns()
        if wait_ns > timeout_s * 1e9:
            self._clock.sleep(timeout_s)
            return Readings.none(len(self._channels))
        self._clock.sleep(wait_ns / 1e9)
        begin_ns = self._clock.now_ns()
        anomalies: list[Anomaly] = []
        values = [
            self._value(*one, begin_ns, anomalies) for one in zip(self._channels, self._files, strict=True)
        ]
        end_ns = self._clock.now_ns()
        anomalies += self._next(end_ns)
        middle = np.array([(begin_ns + end_ns) // 2], np.int64)
        sigma_ns = max(round((end_ns - begin_ns) / math.sqrt(12)), 1_000)
        return Readings(middle, np.array([values]), tuple(anomalies), sigma_ns)

    def close(self) -> None:
        """Close the files."""
        while self._files:
            os.close(self._files.pop())

    def _next(self, now_ns: int) -> list[Anomaly]:
        """Put the next reading off to the first due time that has not passed."""
        self._due_ns += self._period_ns
        missed = max(-(-(now_ns - self._due_ns) // self._period_ns), 0)
        self._due_ns += missed * self._period_ns
        return [Anomaly(now_ns, MISSED, f"{missed} readings", missed)] if missed else []

    def _value(self, channel: IioChannel, file: int, now_ns: int, anomalies: list[Anomaly]) -> float:
        try:
            content = os.pread(file, 64, 0)
        except OSError as error:
            if not channel.file.exists():
                raise DeviceLost(f"{channel.file.parent} is gone", _GONE) from error
            anomalies.append(Anomaly(now_ns, FAILED, f"{channel.name}: {error.strerror}", 1))
            return math.nan
        if not content and not channel.file.exists():
            raise DeviceLost(f"{channel.file.parent} is gone", _GONE)
        try:
            raw = float(content)
        except ValueError:
            raw = math.nan
        if not math.isfinite(raw):
            anomalies.append(Anomaly(now_ns, NOT_A_NUMBER, f"{channel.name}: {content[:40]!r}", 1))
            return math.nan
        return channel.value(raw)
