"""Promises of every logger's driver to the thread that reads it, as tests that a driver's own subclass."""

from collections.abc import Iterator
from typing import Protocol

import numpy as np
import pytest

from grabberd.core.channels import Anomaly, Dating, Logger, LoggerInfo, Readings
from grabberd.errors import DeviceAbsent, DeviceError, DeviceLost, DeviceRefused
from grabberd.instrument.acquisition import LOGGERS

COUNT = 40
"""Readings that a test asks for."""


class LoggerBench(Protocol):
    """A logger and its other end, which says what it is told to say.

    Attributes:
        logger: The logger, not opened yet.
        columns: Number of its channels.
    """

    logger: Logger
    columns: int

    def say(self, count: int = COUNT) -> None:
        """Let so many readings come, at least."""
        ...

    def spoil(self) -> None:
        """Let nonsense come."""
        ...

    def unplug(self) -> None:
        """Take the logger away."""
        ...

    def now_ns(self) -> int:
        """The time on the clock that the logger goes by."""
        ...

    def close(self) -> None:
        """Close the logger and whatever its other end needs."""
        ...


class LoggerContract:
    """The contract of `grabberd.core.channels.logger`; a subclass has a fixture `bench`."""

    @pytest.fixture
    def bench(self) -> Iterator[LoggerBench]:
        """The logger that is tested, and its other end; closed after the test."""
        raise NotImplementedError("the test's class needs a fixture `bench` that yields a LoggerBench")

    @pytest.fixture
    def info(self, bench: LoggerBench) -> LoggerInfo:
        """The logger as it is found when it is opened."""
        return bench.logger.open()

    def test_it_says_what_was_found(self, bench: LoggerBench, info: LoggerInfo) -> None:
        assert info.driver in LOGGERS.available()
        assert info.model
        assert len(set(info.channels)) == len(info.channels) == len(info.units) == bench.columns
        assert info.dating in tuple(Dating)
        assert info.time_sigma_ns > 0
        assert info.rate_hz is None or info.rate_hz >= 100

    def test_its_readings_are_numbers_of_its_channels(self, bench: LoggerBench, info: LoggerInfo) -> None:
        for readings in take(bench):
            assert readings.time_ns.dtype == np.int64
            assert readings.values.dtype == np.float64
            assert readings.values.shape == (len(readings.time_ns), len(info.channels))
            assert np.isfinite(readings.values).all()
            assert readings.anomalies == ()

    def test_its_times_ascend_from_call_to_call(self, bench: LoggerBench, info: LoggerInfo) -> None:
        taken = take(bench) + take(bench)
        assert (np.diff(np.concatenate([readings.time_ns for readings in taken])) > 0).all()

    def test_nothing_was_taken_later_than_it_was_read(self, bench: LoggerBench, info: LoggerInfo) -> None:
        before_ns = bench.now_ns()
        taken = take(bench)
        assert taken[-1].time_ns[-1] <= bench.now_ns() + len(taken[-1].time_ns)
        assert taken[0].time_ns[0] > before_ns - 10_000_000_000

    def test_its_times_have_a_sigma(self, bench: LoggerBench, info: LoggerInfo) -> None:
        assert all(readings.time_sigma_ns > 0 for readings in take(bench) if len(readings.time_ns))

    def test_nonsense_is_named_and_the_reading_goes_on(self, bench: LoggerBench, info: LoggerInfo) -> None:
        take(bench)
        bench.spoil()
        named: list[Anomaly] = []
        for _ in range(5):
            named += bench.logger.read(0.02).anomalies
        assert named
        for anomaly in named:
            assert anomaly.reason
            assert len(anomaly.example) <= 80
            assert anomaly.lost >= 0
        bench.say()
        assert bench.logger.read(1.0) is not None

    def test_nothing_comes_from_a_logger_that_is_not_open(self, bench: LoggerBench) -> None:
        with pytest.raises(DeviceError, match="not open") as caught:
            bench.logger.read(0.0)
        assert caught.value.hint

    def test_nothing_comes_from_a_logger_that_was_closed(self, bench: LoggerBench, info: LoggerInfo) -> None:
        take(bench, 5)
        bench.logger.close()
        with pytest.raises(DeviceError, match="not open"):
            bench.logger.read(0.0)

    def test_it_can_be_closed_twice_and_without_having_been_open(self, bench: LoggerBench) -> None:
        bench.logger.close()
        bench.logger.open()
        bench.logger.close()
        bench.logger.close()

    def test_it_is_opened_once_at_a_time(self, bench: LoggerBench, info: LoggerInfo) -> None:
        with pytest.raises(DeviceRefused, match="open already"):
            bench.logger.open()
        assert take(bench, 5)

    def test_it_can_be_opened_again(self, bench: LoggerBench, info: LoggerInfo) -> None:
        take(bench, 5)
        bench.logger.close()
        assert bench.logger.open() == info
        assert take(bench, 5)

    def test_an_unplugged_logger_is_lost_and_then_absent(self, bench: LoggerBench, info: LoggerInfo) -> None:
        take(bench, 5)
        bench.unplug()
        assert _lost(bench).hint
        bench.logger.close()
        with pytest.raises(DeviceAbsent):
            bench.logger.open()

    def test_an_unknown_option_is_refused_by_name(self, info: LoggerInfo) -> None:
        with pytest.raises(ValueError, match="no_such_option"):
            LOGGERS.create(info.driver, {"no_such_option": 1})


def take(bench: LoggerBench, count: int = COUNT) -> list[Readings]:
    """Readings of a logger that says so many, in turn; the first line of a cable may be cut."""
    bench.say(count + 1)
    taken: list[Readings] = []
    while sum(len(readings.time_ns) for readings in taken) < count:
        taken.append(bench.logger.read(1.0))
        assert len(taken[-1].time_ns) or taken[-1].anomalies, "nothing came within a second"
    return taken


def _lost(bench: LoggerBench) -> DeviceLost:
    """The error that an unplugged logger ends with, after whatever was on its way."""
    for _ in range(5):
        try:
            bench.logger.read(1.0)
        except DeviceLost as error:
            return error
    raise AssertionError("it was not lost")
