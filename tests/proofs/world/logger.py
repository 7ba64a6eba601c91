"""A data logger of a world: its readings are numbers, ten times a second, of a clock that is the world's."""

import numpy as np
from tests.proofs.world.scheduler import Scheduler

from grabberd.config import LoggerConfig
from grabberd.core.channels.logger import Dating, LoggerInfo, Readings
from grabberd.errors import DeviceAbsent, DeviceLost
from grabberd.instrument.channels.logger_setup import LoggerSetup

PERIOD_NS = 100_000_000
CONFIG = LoggerConfig(driver="world", channels={"pulsation": {"column": "number", "sigma_kpa": 0.2}})


class WorldLogger:
    """Reading j is taken at `begin + j * PERIOD_NS`, and has the value j modulo 50.

    Attributes:
        gone: Times from one to another in which it is unplugged.
        silent: In which it says nothing.
    """

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._next = 0
        self.begin_ns = scheduler.now_ns
        self.gone: list[tuple[int, int]] = []
        self.silent: list[tuple[int, int]] = []

    def open(self) -> LoggerInfo:
        if self._is(self.gone):
            raise DeviceAbsent("the logger is unplugged", "plug it in")
        self._next = (self._scheduler.now_ns - self.begin_ns) // PERIOD_NS + 1
        return LoggerInfo("world", "logger", ("number",), ("kPa",), 10.0, Dating.MONOTONIC, 1_000_000)

    def read(self, timeout_s: float) -> Readings:
        scheduler = self._scheduler
        end_ns = scheduler.now_ns + round(timeout_s * 1e9)
        scheduler.sleep_until_ns(min(end_ns, self.begin_ns + self._next * PERIOD_NS + 1_000_000))
        if self._is(self.gone):
            raise DeviceLost("the logger was unplugged", "plug it in")
        newest = (scheduler.now_ns - self.begin_ns) // PERIOD_NS
        numbers = np.arange(self._next, newest + 1)
        self._next = max(self._next, newest + 1)
        if self._is(self.silent) or not len(numbers):
            return Readings.none(1)
        times: np.ndarray = self.begin_ns + numbers * PERIOD_NS
        return Readings(times, (numbers % 50).astype(np.float64)[:, None])

    def close(self) -> None:
        pass

    def _is(self, spans: list[tuple[int, int]]) -> bool:
        now_ns = self._scheduler.now_ns
        return any(begin_ns <= now_ns < end_ns for begin_ns, end_ns in spans)

    def setup(self) -> LoggerSetup:
        """As the configuration would make it."""
        return LoggerSetup("vacuum", CONFIG, self, CONFIG.measured())
