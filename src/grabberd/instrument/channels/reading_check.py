"""Checks what a logger gives, before anybody relies on it: a driver may err like every other program."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from grabberd.core.channels import Anomaly, LoggerInfo, Readings
from grabberd.errors import StreamFailed

AHEAD_NS = 1_000_000_000
"""How far a reading may lie in the future: clocks that are related to each other err by less."""
NOT_FINITE = "not a finite number"
TIME_BACK = "its time went back"
TIME_AHEAD = "its time is ahead of the clock"
Wrong = Callable[[NDArray[np.int64]], NDArray[np.bool_]]
"""Tells of each time whether it cannot be."""


def checked(readings: Readings, info: LoggerInfo, last_ns: int, now_ns: int) -> Readings:
    """Readings without those that cannot be; each kind of them is an anomaly more.

    Args:
        readings: What the driver gave.
        info: The logger as found.
        last_ns: Time of the reading before.
        now_ns: The present moment.

    Raises:
        StreamFailed: They are not of this logger's columns.
    """
    time_ns, values, anomalies = readings.time_ns, readings.values, list(readings.anomalies)
    if values.shape != (len(time_ns), len(info.channels)):
        raise StreamFailed(
            f"the driver gave {len(time_ns)} times and values of shape {values.shape} "
            f"for {len(info.channels)} columns",
            "please report this to whoever wrote the driver",
        )
    for wrong_of, reason in ((_ahead(now_ns), TIME_AHEAD), (_back(last_ns), TIME_BACK)):
        wrong = wrong_of(time_ns)
        if wrong.any():
            example = f"{(time_ns[wrong][0] - now_ns) / 1e9:+.3f} s from now"
            anomalies.append(Anomaly(now_ns, reason, example, int(wrong.sum())))
            time_ns, values = time_ns[~wrong], values[~wrong]
    infinite = np.isinf(values)
    if infinite.any():
        anomalies.append(Anomaly(now_ns, NOT_FINITE, "inf", int(infinite.any(axis=1).sum())))
        values = np.where(infinite, np.nan, values)
    return readings._replace(time_ns=time_ns, values=values, anomalies=tuple(anomalies))


def _ahead(now_ns: int) -> Wrong:
    return lambda time_ns: time_ns > now_ns + AHEAD_NS


def _back(last_ns: int) -> Wrong:
    return lambda time_ns: time_ns <= np.maximum.accumulate(np.concatenate(([last_ns], time_ns)))[:-1]
