"""A logger that follows a script, in simulated time."""

import numpy as np
from simulated_time import SimulatedClock, Until

from grabberd.config import ChannelConfig, LoggerConfig
from grabberd.core.channels import Anomaly, Dating, LoggerInfo, Quantity, Readings
from grabberd.core.channels.vacuum import Channel
from grabberd.errors import DeviceAbsent, DeviceRefused
from grabberd.instrument.channels.feed import Feed
from grabberd.instrument.channels.logger_board import LoggerBoard
from grabberd.instrument.channels.logger_setup import LoggerSetup
from grabberd.instrument.channels.logger_thread import LoggerThread

COLUMNS = ("p1", "p2", "p3")
RATE_HZ = 100.0
STEP_NS = 10_000_000
INFO = LoggerInfo("script", "scripted logger", COLUMNS, ("kPa",) * 3, RATE_HZ, Dating.MONOTONIC, 1000)
CHANNELS = (
    Channel("pulsation", Quantity.PULSATION, "p2", 0.2, "kPa", calibrated="2026-02-03"),
    Channel("liner", Quantity.LINER, "p1", 0.2, "kPa", calibrated="2026-02-03"),
)
CONFIG = LoggerConfig(
    driver="script", channels={one.name: ChannelConfig(column=one.column, sigma_kpa=0.2) for one in CHANNELS}
)
"""Its channels are those above."""


def readings_at(time_ns, *anomalies: Anomaly, kpa: float = 40.0) -> Readings:
    """Readings of three columns: `kpa` in the first, one and two more in the others."""
    time_ns = np.asarray(time_ns, np.int64)
    values = kpa + np.arange(3.0) * np.ones((len(time_ns), 1))
    return Readings(time_ns, values, tuple(anomalies), 1000)


class ScriptedLogger:
    """Gives readings at an even pace for so many steps, or raises what stands in its script.

    After its script nothing comes. It keeps what it was asked.
    """

    def __init__(
        self, clock: SimulatedClock, *script: Exception | Readings | int, info: LoggerInfo = INFO
    ) -> None:
        self.clock = clock
        self.script = list(script)
        self.info = info
        self.asked: list[str] = []

    def open(self) -> LoggerInfo:
        self.asked.append("open")
        if self.script and isinstance(self.script[0], DeviceAbsent | DeviceRefused):
            raise self.script.pop(0)  # type: ignore[misc]
        return self.info

    def read(self, timeout_s: float) -> Readings:
        step = self.script.pop(0) if self.script else 0
        if isinstance(step, Exception):
            raise step
        if isinstance(step, Readings):
            return step
        if step == 0:
            self.clock.sleep(timeout_s)
            return readings_at([])
        if step > 1:
            self.script.insert(0, step - 1)
        self.clock.sleep(STEP_NS / 1e9)
        return readings_at([self.clock.now_ns()])

    def close(self) -> None:
        self.asked.append("close")


class LoggerRun:
    """The thread of a logger from time 0 to `end_s`, in the thread of the test."""

    def __init__(
        self,
        *script: Exception | Readings | int,
        end_s: float = 5.0,
        info: LoggerInfo = INFO,
        delay_ms: float = 0.0,
    ) -> None:
        self.clock = SimulatedClock()
        self.logger = ScriptedLogger(self.clock, *script, info=info)
        self.feed = Feed()
        self.follower = self.feed.follow()
        self.told: list[str] = []
        self.board = LoggerBoard("tank", self.clock, self._tell)
        stopping = Until(self.clock, end_s)
        setup = setup_of(self.logger, delay_ms=delay_ms)
        LoggerThread(setup, self.feed, self.board, self.clock, stopping).run()

    def _tell(self) -> None:
        now = self.board.now
        self.told.append(f"{now.state}: {now.cause}" if now.cause else str(now.state))

    @property
    def parts(self):
        return self.follower.take(2**62)


def setup_of(logger: object, name: str = "tank", channels=CHANNELS, delay_ms: float = 0.0) -> LoggerSetup:
    config = CONFIG.model_copy(update={"delay_ms": delay_ms})
    return LoggerSetup(name, config, logger, channels)  # type: ignore[arg-type]
