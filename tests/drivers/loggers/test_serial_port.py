"""Loggers on serial ports, which pseudo-terminals stand in for."""

import os
import termios
from collections.abc import Iterator

import pytest

from drivers.loggers.ports import Port
from grabberd.errors import Cause, DeviceAbsent, DeviceLost, DeviceRefused, StreamFailed
from grabberd_loggers import line_logger
from grabberd_loggers.lines import HEADER_AGAIN
from grabberd_loggers.serial_port import PortSettings, SerialLogger


@pytest.fixture
def port() -> Iterator[Port]:
    made = Port()
    yield made
    made.close()


def logger(port: Port, **options: object) -> SerialLogger:
    return SerialLogger(port=str(port.path), **options)


def test_a_header_names_the_columns(port: Port) -> None:
    port.say("time_ms,p1 [kPa],p2 [mbar]\n")
    made = logger(port)
    info = made.open()
    assert (info.channels, info.units) == (("p1", "p2"), ("kPa", "mbar"))
    assert info.details["baud"] == "115200"
    port.say("10,41.9,4.2\n20,42.0,")
    assert made.read(1.0).values.tolist() == [[41.9, 4.2]]
    port.say("4.3\n")
    assert made.read(1.0).values.tolist() == [[42.0, 4.3]]


def test_bare_numbers_are_read_by_the_columns_of_the_options(port: Port) -> None:
    made = logger(port, columns=["p1 [V]", "-", "p2 [V]"])
    info = made.open()
    assert (info.channels, info.units) == (("p1", "p2"), ("V", "V"))
    assert any("rate_hz" in remark for remark in info.remarks)
    port.say("half a line\n1.5,9,2.5\n")
    assert made.read(1.0).values.tolist() == [[1.5, 2.5]]


def test_lines_that_come_with_the_header_are_read(port: Port) -> None:
    made = logger(port)
    port.say("time_ms,p1 [kPa]\n10,1\n20,2\n")
    made.open()
    assert made.read(0.0).values.tolist() == [[1.0], [2.0]]


def test_a_logger_that_sends_no_header_is_quoted(port: Port, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(line_logger, "HEADER_S", 0.1)
    port.say("41.9,0.2\n41.8,0.2\n")
    with pytest.raises(StreamFailed, match=r"no header .* the last line was '41.8,0.2'") as caught:
        logger(port).open()
    assert "columns:" in caught.value.hint


def test_a_logger_that_says_nothing_at_all_has_other_causes(
    port: Port, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(line_logger, "HEADER_S", 0.1)
    with pytest.raises(StreamFailed, match="nothing came at all") as caught:
        logger(port).open()
    assert "baud" in caught.value.hint


def test_a_logger_is_asked_to_start(port: Port) -> None:
    logger(port, columns=["p1 [kPa]"], start="GO\r\n").open()
    assert port.heard() == b"GO\r\n"


def test_a_restarted_logger_goes_on(port: Port) -> None:
    port.say("time_ms,p1 [kPa]\n")
    made = logger(port)
    made.open()
    port.say("10,1\n")
    made.read(1.0)
    port.say("time_ms,p1 [kPa]\n5,2\n")
    readings = made.read(1.0)
    assert readings.anomalies[0].reason == HEADER_AGAIN
    assert readings.values.tolist() == [[2.0]]


def test_a_pulled_plug_is_a_lost_device(port: Port) -> None:
    made = logger(port, columns=["p1 [kPa]"])
    made.open()
    port.unplug()
    with pytest.raises(DeviceLost, match="is gone"):
        made.read(1.0)
    made.close()


def test_what_is_not_there_may_come_later(tmp_path) -> None:
    with pytest.raises(DeviceAbsent, match="there is no"):
        SerialLogger(port=str(tmp_path / "ttyUSB0"), columns=["p1"]).open()


def test_what_is_no_serial_port_is_refused_as_what_it_is(tmp_path) -> None:
    (tmp_path / "file").touch(0o400)
    os.mkfifo(tmp_path / "pipe")
    kinds = {tmp_path: "a folder", tmp_path / "file": "a file", tmp_path / "pipe": "a pipe"}
    for path, kind in {**kinds, "/dev/null": "a device, but"}.items():
        with pytest.raises(DeviceRefused, match=f"is {kind},? ?not a serial port") as caught:
            SerialLogger(port=str(path), columns=["p1"]).open()
        assert "plug" not in caught.value.hint


@pytest.mark.parametrize("baud", [50, 12_345, 74_880, 250_000, 460_800, 3_000_000])
def test_any_speed_that_the_kernel_takes_is_taken(port: Port, baud: int) -> None:
    made = logger(port, columns=["p1"], baud=baud)
    made.open()
    assert port.baud() == baud
    made.close()


@pytest.mark.parametrize(
    ("options", "refused"),
    [
        ({"bits": 7}, "7 data bits"),
        ({"parity": "even"}, "even parity"),
        ({"bits": 7, "parity": "odd", "baud": 12_345}, "7 data bits and odd parity"),
    ],
)
def test_a_port_that_refuses_a_setting_is_told_by_name(port: Port, options: dict, refused: str) -> None:
    with pytest.raises(DeviceRefused) as caught:
        logger(port, columns=["p1"], **options).open()
    assert caught.value.message == f"{port.path} refuses {refused}"
    logger(port, columns=["p1"]).open()  # and can be opened with settings that it takes


def test_settings_are_compared_with_what_the_port_has_set() -> None:
    settings = PortSettings(baud=250_000, stop_bits=2)
    assert not settings.refused(250_000, settings.control | termios.CREAD | termios.CLOCAL)
    assert not settings.refused(249_600, settings.control)  # the nearest that its clock gives
    assert settings.refused(9600, settings.control) == "250000 baud (it gives 9600)"
    assert settings.refused(250_000, PortSettings().control) == "2 stop bits"
    assert settings.refused(250_000, PortSettings(parity="odd", stop_bits=2).control) == "no parity"
    assert PortSettings(parity="odd").refused(9600, PortSettings(parity="even").control) == "odd parity"


def test_a_port_that_another_program_has_keeps_its_settings(port: Port) -> None:
    logger(port, columns=["p1"], baud=19_200).open()
    with pytest.raises(DeviceRefused, match="another program has"):
        logger(port, columns=["p1"], baud=9600).open()
    assert port.baud() == 19_200


def test_two_programs_do_not_share_a_port(port: Port) -> None:
    first, second = (logger(port, columns=["p1"]) for _ in range(2))
    first.open()
    with pytest.raises(DeviceRefused) as caught:
        second.open()
    assert caught.value.cause is Cause.DEVICE_BUSY
    first.close()
    second.open()
    second.close()


def test_missing_rights_name_the_group(port: Port) -> None:
    port.path.chmod(0)
    user = os.geteuid()
    os.seteuid(user or 65_534)  # root may open everything
    try:
        with pytest.raises(DeviceRefused, match="may not be opened") as caught:
            logger(port, columns=["p1"]).open()
    finally:
        os.seteuid(user)
    assert (caught.value.cause, "dialout" in caught.value.hint) == (Cause.NO_RIGHTS, True)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"port": "/dev/ttyUSB0", "baud": 3}, "baud: Input should be greater than or equal to 50"),
        ({"port": "/dev/ttyUSB0", "columns": ["p1", "p1"]}, "columns: column p1 is given twice"),
        ({"port": "/dev/ttyUSB0", "rate_hz": 0}, "rate_hz"),
        ({"port": "/dev/ttyUSB0", "parity": "mark"}, "parity"),
        ({}, "port: missing"),
        ({"port": "/dev/ttyUSB0", "speed": 9600}, "speed: unknown option; known are columns"),
    ],
)
def test_options_that_cannot_be_used_are_named(options: dict, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        SerialLogger(**options)


def test_all_problems_of_the_options_are_named_at_once() -> None:
    with pytest.raises(ValueError, match=r"(?s)speed.*\n.*baud|baud.*\n.*speed"):
        SerialLogger(port="/dev/ttyUSB0", speed=9600, baud=3)
