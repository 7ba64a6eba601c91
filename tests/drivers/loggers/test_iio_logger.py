"""The driver of industrial I/O devices: polled and streaming, on a tree of files."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from drivers.loggers.iio_tree import IioTree
from grabberd.core.channels.dating import MISSING
from grabberd.errors import Cause, DeviceAbsent, DeviceLost, DeviceRefused
from grabberd.testing import ManualClock
from grabberd_loggers.iio.logger import IioLogger
from grabberd_loggers.iio.readers import BACKWARD, FAILED, MISSED, NOT_A_NUMBER, OTHER_CLOCK

MS = 1_000_000


@pytest.fixture
def tree(tmp_path: Path) -> Iterator[IioTree]:
    made = IioTree(tmp_path)
    yield made
    made.close()


def logger(tree: IioTree, clock: ManualClock | None = None, **options: object) -> IioLogger:
    return IioLogger(clock=clock or ManualClock(), roots=tree.roots, **({"device": "milk-line"} | options))


def test_a_device_without_a_buffer_is_polled_at_the_rate(tree: IioTree) -> None:
    made = logger(tree, rate_hz=100, channels=["voltage1", "pressure"])
    info = made.open()
    assert (info.channels, info.units, info.details["read"]) == (
        ("voltage1", "pressure"),
        ("mV", "kPa"),
        "polled",
    )
    readings = [made.read(1.0) for _ in range(5)]
    assert [one.values.tolist() for one in readings] == [[[50.0, 49.0]]] * 5
    assert np.diff(np.concatenate([one.time_ns for one in readings])).tolist() == [10 * MS] * 4
    tree.write("in_pressure_raw", "1020")
    assert made.read(1.0).values.tolist() == [[50.0, 50.0]]


def test_nothing_is_read_before_it_is_due(tree: IioTree) -> None:
    clock = ManualClock()
    made = logger(tree, clock, rate_hz=100)
    made.open()
    made.read(1.0)
    begin_ns = clock.time_ns
    assert len(made.read(0.004).time_ns) == 0
    assert clock.time_ns - begin_ns == 4 * MS
    assert len(made.read(1.0).time_ns) == 1


def test_readings_that_would_be_late_are_left_out_and_counted(tree: IioTree) -> None:
    clock = ManualClock()
    made = logger(tree, clock, rate_hz=100)
    made.open()
    made.read(1.0)
    clock.sleep(0.035)
    (anomaly,) = made.read(1.0).anomalies
    assert (anomaly.reason, anomaly.lost) == (MISSED, 2)
    assert made.read(1.0).anomalies == ()


def test_a_channel_that_says_nonsense_has_no_reading_and_the_others_have(tree: IioTree) -> None:
    made = logger(tree, channels=["pressure", "voltage1"])
    made.open()
    tree.write("in_pressure_raw", "error")
    readings = made.read(1.0)
    assert readings.anomalies[0].reason == NOT_A_NUMBER
    assert np.isnan(readings.values[0, 0])
    assert readings.values[0, 1] == 50.0


def test_a_channel_that_fails_is_named(tree: IioTree, monkeypatch: pytest.MonkeyPatch) -> None:
    made = logger(tree, channels=["pressure"])
    made.open()

    def failing(*_: object) -> bytes:
        raise OSError(110, "Connection timed out")

    monkeypatch.setattr("os.pread", failing)
    readings = made.read(1.0)
    assert [(one.reason, one.example) for one in readings.anomalies] == [
        (FAILED, "pressure: Connection timed out")
    ]


def test_a_streaming_device_is_set_up_and_dated_by_the_kernel(tree: IioTree) -> None:
    tree.add_buffer()
    clock = ManualClock()
    made = logger(tree, clock, rate_hz=200)
    info = made.open()
    assert (info.rate_hz, info.details["read"]) == (200.0, "buffered")
    assert tree.read("current_timestamp_clock") == "monotonic"
    assert tree.read("buffer/enable") == "1"
    assert {tree.read(f"scan_elements/in_{name}_en") for name in ("pressure", "voltage2", "timestamp")} == {
        "1"
    }
    times = [clock.time_ns - 5 * MS, clock.time_ns]
    tree.scans(times)
    readings = made.read(1.0)
    assert readings.time_ns.tolist() == times
    assert readings.values.tolist() == [[49.0, 0.0, 50.0, 100.0]] * 2
    made.close()
    assert tree.read("buffer/enable") == "0"


def test_channels_that_are_not_wanted_are_left_out_of_the_scans(tree: IioTree) -> None:
    tree.add_buffer()
    made = logger(tree, channels=["pressure"])
    made.open()
    assert tree.read("scan_elements/in_voltage0_en") == "0"
    assert tree.read("scan_elements/in_pressure_en") == "1"
    made.close()


def test_half_a_scan_waits_for_its_other_half(tree: IioTree) -> None:
    tree.add_buffer()
    clock = ManualClock()
    made = logger(tree, clock, channels=["pressure"])
    made.open()
    scan = np.array([(1000 << 8, 0, clock.time_ns)], "<i4,<i4,<i8").tobytes()
    tree.say(scan[:10])
    assert len(made.read(0.0).time_ns) == 0
    tree.say(scan[10:])
    assert made.read(0.0).values.tolist() == [[49.0]]
    made.close()


def test_times_of_another_clock_and_backward_ones_are_left_out(tree: IioTree) -> None:
    tree.add_buffer()
    clock = ManualClock()
    made = logger(tree, clock)
    made.open()
    now_ns = clock.time_ns
    tree.scans([now_ns - 20 * MS, 1_700_000_000_000_000_000, now_ns - 25 * MS, now_ns - 10 * MS])
    readings = made.read(0.0)
    assert readings.time_ns.tolist() == [now_ns - 20 * MS, now_ns - 10 * MS]
    assert {one.reason: one.lost for one in readings.anomalies} == {OTHER_CLOCK: 1, BACKWARD: 1}
    made.close()


def test_scans_that_the_kernel_lost_are_counted(tree: IioTree) -> None:
    tree.add_buffer()
    clock = ManualClock()
    made = logger(tree, clock)
    made.open()
    tree.scans([clock.time_ns + n * 10 * MS for n in range(30) if n not in (20, 21)])
    assert [(one.reason, one.lost) for one in made.read(0.0).anomalies] == [(MISSING, 2)]
    made.close()


@pytest.mark.parametrize("buffered", [True, False])
def test_a_device_that_is_unplugged_is_lost(tree: IioTree, buffered: bool) -> None:
    tree.add_buffer()
    made = logger(tree, buffered=buffered)
    made.open()
    tree.unplug()
    with pytest.raises(DeviceLost, match="is gone"):
        made.read(0.1)
    made.close()


def test_a_device_that_is_not_there_may_come_later(tree: IioTree) -> None:
    with pytest.raises(
        DeviceAbsent, match=r"no IIO device 'other'; present are: iio:device0 \(bmp280-barn\)"
    ):
        logger(tree, device="other").open()


def test_two_devices_of_one_name_are_told_apart_by_number(tree: IioTree) -> None:
    (tree.device.parent / "iio:device1").mkdir()
    (tree.device.parent / "iio:device1" / "name").write_text("bmp280-barn\n")
    with pytest.raises(DeviceRefused, match="iio:device0, iio:device1") as caught:
        logger(tree, device="bmp280-barn").open()
    assert caught.value.cause is Cause.SEVERAL_DEVICES


def test_a_channel_that_it_lacks_is_answered_with_those_it_has(tree: IioTree) -> None:
    with pytest.raises(DeviceRefused, match="has no pressure7; it has: pressure, voltage0"):
        logger(tree, channels=["pressure7"]).open()


def test_a_kernel_that_cannot_stamp_in_our_clock_is_refused(tree: IioTree) -> None:
    tree.add_buffer(clock=None)
    with pytest.raises(DeviceRefused, match="CLOCK_MONOTONIC") as caught:
        logger(tree).open()
    assert "buffered: false" in caught.value.hint


def test_a_type_that_is_not_known_is_refused(tree: IioTree) -> None:
    tree.add_buffer()
    tree.write("scan_elements/in_pressure_type", "le:f32/32")
    with pytest.raises(DeviceRefused, match="le:f32/32"):
        logger(tree).open()
