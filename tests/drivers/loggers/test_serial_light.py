"""A light on a control line of a serial port, with the answers of a kernel: a pseudo-terminal has none."""

import errno
import fcntl
import termios

import pytest

from drivers.loggers.light_lines import ModemLines
from drivers.loggers.ports import Port
from grabberd.errors import Cause, DeviceAbsent, DeviceLost, DeviceRefused, StreamFailed
from grabberd_loggers.light.serial_line import SerialLight, SerialLightOptions, SerialLine
from grabberd_loggers.serial_port import SerialLogger


@pytest.fixture
def lines():
    made = ModemLines()
    yield made
    made.close()


def test_rts_is_set_and_cleared_and_nothing_else_is_touched(lines: ModemLines) -> None:
    line = lines.line()
    found = line.open()
    assert not line.is_on()
    line.switch(True)
    assert line.is_on()
    line.switch(False)
    assert not line.is_on()
    assert lines.asked == [
        (termios.TIOCMBIC, termios.TIOCM_RTS),
        (termios.TIOCMBIS, termios.TIOCM_RTS),
        (termios.TIOCMBIC, termios.TIOCM_RTS),
    ]
    assert lines.state == termios.TIOCM_DTR | termios.TIOCM_CTS
    assert found.details["line"] == "RTS"


def test_dtr_will_do_as_well(lines: ModemLines) -> None:
    line = lines.line(line="dtr")
    assert line.open().model == f"DTR of {lines.port.path.name}"
    line.switch(True)
    assert lines.asked[-1] == (termios.TIOCMBIS, termios.TIOCM_DTR)


def test_an_inverted_light_is_on_while_its_line_is_off(lines: ModemLines) -> None:
    line = lines.line(inverted=True)
    line.open()
    assert lines.state & termios.TIOCM_RTS
    assert not line.is_on()
    line.switch(True)
    assert line.is_on()
    assert not lines.state & termios.TIOCM_RTS


def test_the_light_is_off_when_the_port_is_left(lines: ModemLines) -> None:
    line = lines.line()
    line.open()
    line.switch(True)
    line.close()
    line.close()
    assert not lines.state & termios.TIOCM_RTS


def test_a_port_without_such_lines_is_refused_and_left() -> None:
    port = Port()
    light = SerialLight(port=str(port.path))
    for _ in range(2):  # left: nobody has it the second time either
        with pytest.raises(DeviceRefused, match="has no line RTS") as refused:
            light.open()
    assert refused.value.hint
    port.close()


def test_a_port_that_is_not_there_is_absent() -> None:
    with pytest.raises(DeviceAbsent, match="there is no /dev/ttyUSB99"):
        SerialLight(port="/dev/ttyUSB99").open()


def test_a_port_that_a_logger_reads_is_busy(lines: ModemLines) -> None:
    logger = SerialLogger(port=str(lines.port.path), columns=["p1 [kPa]"])
    logger.open()
    with pytest.raises(DeviceRefused, match="another program has") as refused:
        lines.line().open()
    assert refused.value.cause is Cause.DEVICE_BUSY
    logger.close()


def test_an_adapter_that_is_unplugged_is_lost(lines: ModemLines) -> None:
    line = lines.line()
    line.open()
    lines.gone = True
    for call in (line.is_on, lambda: line.switch(True)):
        with pytest.raises(DeviceLost, match="is gone"):
            call()
    line.close()
    with pytest.raises(DeviceLost, match="not open"):
        line.is_on()


def test_a_port_that_fails_while_it_is_there_is_opened_anew(lines: ModemLines) -> None:
    line = lines.line()
    line.open()

    def fails(*_: object) -> bytes:
        raise OSError(errno.EPROTO, "Protocol error")

    line._ioctl = fails
    with pytest.raises(StreamFailed, match="Protocol error"):
        line.switch(True)


@pytest.mark.parametrize(
    ("options", "words"),
    [({}, "port: missing"), ({"port": "/dev/ttyS0", "line": "cts"}, "line: "), ({"pin": 3}, "pin: unknown")],
)
def test_options_that_cannot_be_used_are_named(options: dict, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        SerialLight(**options)


def test_the_kernel_is_asked_unless_a_test_answers() -> None:
    assert SerialLine(SerialLightOptions(port="/dev/ttyS0"))._ioctl is fcntl.ioctl
