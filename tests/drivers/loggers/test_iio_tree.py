"""Industrial I/O devices as sysfs shows them."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.loggers.iio_tree import IioTree
from grabberd_loggers.iio.tree import iio_devices


@pytest.fixture
def tree(tmp_path: Path) -> Iterator[IioTree]:
    made = IioTree(tmp_path)
    yield made
    made.close()


def test_channels_have_the_units_of_the_kernels_abi(tree: IioTree) -> None:
    (device,) = iio_devices(tree.roots)
    channels = device.channels()
    assert [(one.name, one.unit) for one in channels] == [
        ("pressure", "kPa"),
        ("voltage0", "mV"),
        ("voltage1", "mV"),
        ("voltage2", "mV"),
    ]
    assert channels[0].value(1000) == pytest.approx((1000 - 20) * 0.05)
    assert channels[1].value(100) == 50.0  # by the scale that all voltages share


def test_a_channel_s_own_scale_comes_before_the_shared_one(tree: IioTree) -> None:
    tree.write("in_voltage1_scale", "2")
    (device,) = iio_devices(tree.roots)
    assert {one.name: one.scale for one in device.channels()} == {
        "pressure": 0.05,
        "voltage0": 0.5,
        "voltage1": 2.0,
        "voltage2": 0.5,
    }


def test_a_processed_value_needs_no_scale(tree: IioTree) -> None:
    tree.write("in_pressure_input", "95.5")
    (device,) = iio_devices(tree.roots)
    assert device.channels()[0].value(95.5) == 95.5


@pytest.mark.parametrize("name", ["milk-line", "bmp280-barn", "iio:device0"])
def test_a_device_is_called_by_label_name_or_number(tree: IioTree, name: str) -> None:
    (device,) = iio_devices(tree.roots)
    assert device.is_called(name)


def test_triggers_are_no_devices_and_a_computer_may_have_none(tree: IioTree, tmp_path: Path) -> None:
    (tree.device.parent / "trigger0").mkdir()
    assert len(iio_devices(tree.roots)) == 1
    assert iio_devices(tree.roots._replace(sys=tmp_path / "nowhere")) == []


def test_a_device_streams_if_it_has_a_buffer_with_times(tree: IioTree) -> None:
    assert not iio_devices(tree.roots)[0].streams
    tree.add_buffer()
    assert iio_devices(tree.roots)[0].streams
