"""Serial ports and sensors that may be loggers."""

from pathlib import Path

import pytest

from drivers.loggers.iio_tree import IioTree
from grabberd.instrument.acquisition import LOGGERS, discover
from grabberd.instrument.acquisition.device import LOGGER_SEARCH, Roots
from grabberd_loggers.discovery import sensors, serial_ports


@pytest.fixture
def roots(tmp_path: Path) -> Roots:
    """A computer with an adapter on USB, and four names for a serial port on its mainboard, which has one."""
    made = Roots(tmp_path / "sys", tmp_path / "dev")
    links = made.dev / "serial" / "by-id"
    links.mkdir(parents=True)
    for name in ("ttyUSB0", "ttyS0", "ttyS1", "ttyS2", "tty1", "null"):
        (made.dev / name).touch()
    (links / "usb-FTDI_FT232R_A9-if00-port0").symlink_to("../../ttyUSB0")
    for name, kind in (("ttyS0", "4"), ("ttyS1", "0"), ("ttyS2", "0")):
        folder = made.sys / "class" / "tty" / name
        folder.mkdir(parents=True)
        (folder / "type").write_text(f"{kind}\n")
    return made


def test_ports_that_exist_are_listed_by_the_link_that_stays(roots: Roots) -> None:
    board, adapter = serial_ports(roots)
    assert adapter.options == {"port": f"{roots.dev}/serial/by-id/usb-FTDI_FT232R_A9-if00-port0"}
    assert adapter.is_meant_by("serial", {"port": f"{roots.dev}/ttyUSB0", "baud": 9600})
    assert board.options == {"port": f"{roots.dev}/ttyS0"}
    assert any("may change" in remark for remark in board.remarks)


def test_what_is_listed_can_be_used(roots: Roots) -> None:
    for found in serial_ports(roots):
        LOGGERS.create(found.driver, found.options)


def test_sensors_of_pressure_and_voltage_are_listed(tmp_path: Path) -> None:
    tree = IioTree(tmp_path)
    (found,) = sensors(tree.roots)
    assert found.options == {
        "device": "milk-line",
        "channels": ["pressure", "voltage0", "voltage1", "voltage2"],
    }
    assert found.is_meant_by("iio", {"device": "bmp280-barn"})
    LOGGERS.create(found.driver, found.options)


def test_a_thermometer_is_no_logger_of_vacuum(tmp_path: Path) -> None:
    tree = IioTree(tmp_path)
    for file in tree.device.glob("in_*"):
        file.unlink()
    tree.write("in_temp_input", "21000")
    assert list(sensors(tree.roots)) == []


def test_every_computer_can_be_searched() -> None:
    discover(LOGGER_SEARCH)
