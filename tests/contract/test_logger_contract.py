"""What every driver of a logger promises to the thread that reads it; the suite runs over all of them."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from contract.loggers import BENCHES, COUNT, Bench
from grabberd.acquisition import LOGGERS
from grabberd.acquisition.channels import Dating, LoggerInfo, Readings
from grabberd.errors import DeviceAbsent, DeviceError, DeviceLost, DeviceRefused


@pytest.fixture(params=BENCHES)
def bench(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Bench]:
    made = BENCHES[request.param](tmp_path)
    yield made
    made.close()


@pytest.fixture
def info(bench: Bench) -> LoggerInfo:
    return bench.logger.open()


def take(bench: Bench, count: int = COUNT) -> list[Readings]:
    """Readings of a logger that says so many, in turn; the first line of a cable may be cut."""
    bench.say(count + 1)
    taken: list[Readings] = []
    while sum(len(readings.time_ns) for readings in taken) < count:
        taken.append(bench.logger.read(1.0))
        assert len(taken[-1].time_ns) or taken[-1].anomalies, "nothing came within a second"
    return taken


def test_it_says_what_was_found(bench: Bench, info: LoggerInfo) -> None:
    assert info.driver in LOGGERS.available()
    assert info.model
    assert len(set(info.channels)) == len(info.channels) == len(info.units) == bench.columns
    assert info.dating in tuple(Dating)
    assert info.time_sigma_ns > 0
    assert info.rate_hz is None or info.rate_hz >= 100


def test_its_readings_are_numbers_of_its_channels(bench: Bench, info: LoggerInfo) -> None:
    for readings in take(bench):
        assert readings.time_ns.dtype == np.int64
        assert readings.values.dtype == np.float64
        assert readings.values.shape == (len(readings.time_ns), len(info.channels))
        assert np.isfinite(readings.values).all()
        assert readings.anomalies == ()


def test_its_times_ascend_from_call_to_call(bench: Bench, info: LoggerInfo) -> None:
    taken = take(bench) + take(bench)
    assert (np.diff(np.concatenate([readings.time_ns for readings in taken])) > 0).all()


def test_nothing_was_taken_later_than_it_was_read(bench: Bench, info: LoggerInfo) -> None:
    before_ns = bench.now_ns()
    taken = take(bench)
    assert taken[-1].time_ns[-1] <= bench.now_ns() + len(taken[-1].time_ns)
    assert taken[0].time_ns[0] > before_ns - 10_000_000_000


def test_its_times_have_a_sigma(bench: Bench, info: LoggerInfo) -> None:
    assert all(readings.time_sigma_ns > 0 for readings in take(bench) if len(readings.time_ns))


def test_nonsense_is_named_and_the_reading_goes_on(bench: Bench, info: LoggerInfo) -> None:
    take(bench)
    bench.spoil()
    named = []
    for _ in range(5):
        named += bench.logger.read(0.02).anomalies
    assert named
    for anomaly in named:
        assert anomaly.reason
        assert len(anomaly.example) <= 80
        assert anomaly.lost >= 0
    bench.say()
    assert bench.logger.read(1.0) is not None


def test_nothing_comes_from_a_logger_that_is_not_open(bench: Bench) -> None:
    with pytest.raises(DeviceError, match="not open") as caught:
        bench.logger.read(0.0)
    assert caught.value.hint


def test_nothing_comes_from_a_logger_that_was_closed(bench: Bench, info: LoggerInfo) -> None:
    take(bench, 5)
    bench.logger.close()
    with pytest.raises(DeviceError, match="not open"):
        bench.logger.read(0.0)


def test_it_can_be_closed_twice_and_without_having_been_open(bench: Bench) -> None:
    bench.logger.close()
    bench.logger.open()
    bench.logger.close()
    bench.logger.close()


def test_it_is_opened_once_at_a_time(bench: Bench, info: LoggerInfo) -> None:
    with pytest.raises(DeviceRefused, match="open already"):
        bench.logger.open()
    assert take(bench, 5)


def test_it_can_be_opened_again(bench: Bench, info: LoggerInfo) -> None:
    take(bench, 5)
    bench.logger.close()
    assert bench.logger.open() == info
    assert take(bench, 5)


def test_an_unplugged_logger_is_lost_and_then_absent(bench: Bench, info: LoggerInfo) -> None:
    take(bench, 5)
    bench.unplug()
    assert lost(bench).hint
    bench.logger.close()
    with pytest.raises(DeviceAbsent):
        bench.logger.open()


def lost(bench: Bench) -> DeviceLost:
    """The error that an unplugged logger ends with, after whatever was on its way."""
    for _ in range(5):
        try:
            bench.logger.read(1.0)
        except DeviceLost as error:
            return error
    raise AssertionError("it was not lost")


@pytest.mark.parametrize("driver", LOGGERS.available())
def test_an_unknown_option_is_refused_by_name(driver: str) -> None:
    if driver == "mqtt":
        pytest.importorskip("paho", reason="pip install 'grabberd[mqtt]'")
    with pytest.raises(ValueError, match="no_such_option"):
        LOGGERS.create(driver, {"no_such_option": 1})
