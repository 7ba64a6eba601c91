"""The logger contract over a light that is switched here: its readings are what was done to it, and when.

Before and after every switching the clock is read, and both are readings: the old state and the new one. So
each switching lies between two readings, however long the way to the line took.
"""

import math
import secrets
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from grabberd.core.channels import Anomaly, Dating, LoggerInfo, Readings
from grabberd.errors import DeviceLost, DeviceRefused
from grabberd.runtime import Clock, SystemClock
from grabberd_loggers.options import Options, read_options

BIT_NS = 92_361_000
"""Time between two moments at which the light may change. It does not keep step with fields of 20 ms."""
STEP_NS = 10_000_000
"""Time between readings of a light that is not switched."""
SLOW_NS = 10_000_000
"""Duration of switching that is reported: half a field, below which it changes no result."""
_LOST_NS = 1_000_000_000
"""Delay after which nothing is said of the time before: the computer slept."""
_CLOCK_SIGMA_NS = 1_000

CHANNEL = "light"
SLOW, OTHER_HAND = "switching it took long", "it was switched by somebody else"


class Found(NamedTuple):
    """A line as found.

    Attributes:
        model: Its name, for people.
        details: Further information for people.
        delay_sigma_ns: σ of the time from a finished call to the light.
    """

    model: str
    details: dict[str, str]
    delay_sigma_ns: int


class Line(Protocol):
    """Something that a light hangs on; its calls raise as those of `Logger` do."""

    driver: str

    def __init__(self, options: Any) -> None: ...

    def open(self) -> Found:
        """Take the line; the light is off then."""
        ...

    def switch(self, on: bool) -> None:
        """Switch the light, and return when that is done."""
        ...

    def is_on(self) -> bool:
        """Ask the line itself for its state."""
        ...

    def close(self) -> None:
        """Leave the line, with the light off if that is possible; safe to call twice."""
        ...


class SwitchedLight:
    """A light on a line, switched by chance; a driver names its options and its line."""

    options_class: ClassVar[type[Options]]
    line_class: ClassVar[type[Line]]

    def __init__(self, *, clock: Clock | None = None, **options: Any) -> None:
        """Checks the options; nothing is opened.

        Args:
            clock: Clock that it is switched by; by default the machine's.
            options: See `options_class`.

        Raises:
            ValueError: An option is unknown or not allowed; the message has a line for each.
        """
        self._line = self.line_class(read_options(self.options_class, options))
        self._clock = clock or SystemClock()
        self._is_open = False
        self._on = False
        self._due_ns = self._told_ns = 0

    def open(self) -> LoggerInfo:
        """Takes the line; see `Logger.open`."""
        if self._is_open:
            raise DeviceRefused(
                f"the light of the driver {self._line.driver} is open already", "close it first"
            )
        found = self._line.open()
        self._is_open, self._on = True, False
        self._told_ns = self._clock.now_ns()
        self._due_ns = self._told_ns + BIT_NS
        return LoggerInfo(
            driver=self._line.driver,
            model=found.model,
            channels=(CHANNEL,),
            units=(None,),
            rate_hz=None,
            dating=Dating.MONOTONIC,
            time_sigma_ns=_CLOCK_SIGMA_NS,
            delay_sigma_ns=found.delay_sigma_ns,
            details=found.details,
        )

    def read(self, timeout_s: float) -> Readings:
        """Waits for the next switching and does it; see `Logger.read`."""
        if not self._is_open:
            raise DeviceLost("the light is not open", "open it first")
        now_ns = self._clock.now_ns()
        until_ns = min(self._due_ns, now_ns + round(timeout_s * 1e9))
        self._clock.sleep((until_ns - now_ns) / 1e9)
        if self._clock.now_ns() < self._due_ns:
            return Readings.none(1)
        return self._next()

    def close(self) -> None:
        """Leaves the line, with the light off."""
        self._is_open = False
        self._line.close()

    def _chance(self) -> bool:
        return bool(secrets.randbits(1))

    def _next(self) -> Readings:
        """Readings of the light until now, and of its switching."""
        anomalies = []
        was_on = self._line.is_on()
        before_ns = self._clock.now_ns()
        if was_on != self._on:
            anomalies.append(Anomaly(before_ns, OTHER_HAND, "on" if was_on else "off"))
        told = [] if was_on != self._on else self._since(before_ns)
        states = [(time_ns, was_on) for time_ns in (*told, before_ns)]
        self._on, after_ns = self._chance(), before_ns
        if self._on != was_on:
            self._line.switch(self._on)
            after_ns = max(self._clock.now_ns(), before_ns + 1)
            states.append((after_ns, self._on))
        if after_ns - before_ns > SLOW_NS:
            anomalies.append(Anomaly(after_ns, SLOW, f"{(after_ns - before_ns) / 1e6:.1f} ms"))
        self._told_ns = after_ns
        self._due_ns += BIT_NS * max(math.ceil((after_ns - self._due_ns) / BIT_NS), 1)
        time_ns = np.array([one[0] for one in states], np.int64)
        values = np.array([[float(one[1])] for one in states])
        sigma_ns = max(round((after_ns - before_ns) / math.sqrt(12)), _CLOCK_SIGMA_NS)
        return Readings(time_ns, values, tuple(anomalies), sigma_ns)

    def _since(self, now_ns: int) -> range:
        """Times since the last reading at which the light was as it was left and as it is found."""
        if now_ns - self._told_ns > _LOST_NS:
            return range(0)
        return range(self._told_ns + STEP_NS, now_ns - STEP_NS // 2, STEP_NS)
