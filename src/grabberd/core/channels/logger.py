"""The logger contract: the interface of every data logger, real or simulated, to the thread that reads it.

A driver of loggers is a separate package, found by name through the entry point group `grabberd.loggers`. It
is constructed with the options of its configuration (`Driver(**options)`) and raises `ValueError` with a
clear message for options it cannot use; nothing is opened before `open()`. Only one thread uses a logger at a
time, and nothing that takes fields ever waits for it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array


class Quantity(StrEnum):
    """Quantity that a channel measures: vacuum in kPa below atmosphere, or a level in any unit."""

    PULSATION = "pulsation"
    """Vacuum in the pulsation chamber."""
    LINER = "liner"
    """Vacuum inside the liner, below the teat."""
    MOUTHPIECE = "mouthpiece"
    """Vacuum in the mouthpiece chamber."""
    MILK_LINE = "milk_line"
    """Vacuum in the milk line."""
    LIGHT = "light"
    """State of the light in the picture, in any unit: a switch's 0 and 1, or the voltage at the diode."""

    FLOW = "flow"
    """Milk in the short milk tube, in any unit: a sensor's flow, light or conductivity."""

    @property
    def is_vacuum(self) -> bool:
        """True for those that are in kPa."""
        return self not in (Quantity.LIGHT, Quantity.FLOW)


class Dating(StrEnum):
    """Source of the times of readings."""

    ARRIVAL = "arrival"
    """Each reading is as old as its way to the program is long, which nobody knows."""
    OWN_CLOCK = "own_clock"
    """The logger's own clock, related to CLOCK_MONOTONIC by the readings that came soonest."""
    MONOTONIC = "monotonic"
    """CLOCK_MONOTONIC, stamped by the kernel or by the simulator when the reading was taken."""


@dataclass(frozen=True, slots=True)
class LoggerInfo:
    """The logger as found (not as asked for), and how far its times can be trusted.

    Attributes:
        driver: Name of the driver.
        model: The logger's own name.
        channels: Names of its columns, in the order of `Readings.values`.
        units: The unit that the logger itself states for each column, or None where it states none.
        rate_hz: Readings per second, or None where only the logger knows.
        dating: See `Dating`.
        time_sigma_ns: Standard deviation to expect of a reading's time about the moment it was taken, without
            what is the same for all readings; `Readings.time_sigma_ns` says what it has become.
        delay_sigma_ns: Standard deviation of what is the same for all readings, where the driver knows it.
        details: Further information for people.
        remarks: Warnings for people, in sentences.
    """

    driver: str
    model: str
    channels: tuple[str, ...]
    units: tuple[str | None, ...]
    rate_hz: float | None
    dating: Dating
    time_sigma_ns: int
    delay_sigma_ns: int | None = None
    details: dict[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


class Anomaly(NamedTuple):
    """Something a logger said that is no reading, or readings that it did not say.

    Attributes:
        time_ns: When it was noticed, CLOCK_MONOTONIC.
        reason: A few words that are the same each time, so that they can be counted: "not a number".
        example: What was read, cut to a length that can be shown.
        lost: Number of readings that are missing because of it, where that is known; else 0.
    """

    time_ns: int
    reason: str
    example: str
    lost: int = 0


class Readings(NamedTuple):
    """K readings of C channels, in the order in which they were taken.

    Attributes:
        time_ns: (K,) int64, when each was taken, CLOCK_MONOTONIC, ascending, also from one call to the next.
        values: (K, C) in the logger's own unit, before any calibration; NaN where a channel has none.
        anomalies: What else has come meanwhile.
        time_sigma_ns: Standard deviation of these times, without what is the same for all readings: it
            shrinks while a logger's clock becomes known, and grows when that has jumped.
    """

    time_ns: NDArray[np.int64]
    values: Array
    anomalies: tuple[Anomaly, ...] = ()
    time_sigma_ns: int = 0

    @classmethod
    def none(cls, channels: int, anomalies: Sequence[Anomaly] = ()) -> Self:
        """No readings of so many channels, but perhaps anomalies."""
        return cls(np.empty(0, np.int64), np.empty((0, channels)), tuple(anomalies))


class Logger(Protocol):
    """A data logger."""

    def open(self) -> LoggerInfo:
        """Open the logger and start reading.

        Raises:
            DeviceAbsent: The logger is not there; trying again later may help.
            DeviceRefused: The logger is there but cannot be used as asked.
            StreamFailed: The logger does not answer as it should.
        """
        ...

    def read(self, timeout_s: float) -> Readings:
        """Wait up to `timeout_s` for the next readings; none where nothing came in time.

        Nonsense never ends the reading: it is an `Anomaly`.

        Raises:
            DeviceLost: The logger went away.
            StreamFailed: The logger is there but answers no longer.
            StreamEnded: A recording has no further reading.
        """
        ...

    def close(self) -> None:
        """Stop reading and release the logger; safe to call twice, and after a failed `open`."""
        ...
