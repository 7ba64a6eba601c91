"""Readings from an MQTT topic: what a message means, and a real broker."""

import socket
import time
from pathlib import Path

import pytest

pytest.importorskip("paho.mqtt.client", reason="pip install 'grabberd[mqtt]'")

from brokers import Mosquitto, broker, needs_mosquitto
from paho.mqtt import publish

from grabberd.errors import DeviceAbsent, DeviceLost, DeviceRefused
from grabberd_loggers.json_message import OTHER_KEYS, Unusable
from grabberd_loggers.lines import NOT_A_NUMBER, Line, LineFormat
from grabberd_loggers.mqtt_topic import OVERLONG, RETAINED, MqttLogger, line_of

COLUMNS = ["time_ms", "p1 [kPa]", "p2 [kPa]"]
FORMAT = LineFormat.of_columns(COLUMNS)


@pytest.mark.parametrize(
    "payload",
    [
        '{"p2": 0.02, "p1": 41.93, "time_ms": 12005, "battery": 3.7}',
        "[12005, 41.93, 0.02]",
        "12005,41.93,0.02",
        "12005;41,93;0,02\n",
    ],
)
def test_a_message_is_json_or_a_line(payload: str) -> None:
    assert FORMAT.read(line_of(payload.encode(), FORMAT.columns)) == Line(12_005_000_000, (41.93, 0.02))


def test_a_message_may_be_one_number() -> None:
    one = LineFormat.of_columns(["p1 [kPa]"])
    assert one.read(line_of(b" 41.93 ", one.columns)) == Line(None, (41.93,))


@pytest.mark.parametrize("payload", [b"online", b"\xff\xfe", b"[true, 1, 2]", b"true"])
def test_what_is_not_a_number_has_a_reason(payload: bytes) -> None:
    assert isinstance(FORMAT.read(line_of(payload, FORMAT.columns)), str)


def test_an_empty_message_is_no_reading() -> None:
    with pytest.raises(Unusable, match="another number of cells"):
        line_of(b" ", FORMAT.columns)


def test_columns_are_required() -> None:
    with pytest.raises(ValueError, match="columns: missing"):
        MqttLogger(host="broker", topic="barn/vacuum")


@pytest.mark.parametrize("topic", ["barn/#", "+/vacuum", ""])
def test_a_topic_has_no_wildcards(topic: str) -> None:
    with pytest.raises(ValueError, match="topic"):
        MqttLogger(host="broker", topic=topic, columns=["p1"])


def test_a_broker_that_is_away_may_come_later() -> None:
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))  # and does not listen
        port = nobody.getsockname()[1]
        with pytest.raises(DeviceAbsent, match="cannot be reached"):
            MqttLogger(host="127.0.0.1", port=port, topic="vacuum", columns=["p1"]).open()


def read_until(logger: MqttLogger, count: int) -> tuple[list[float], list[str]]:
    values, reasons, end_s = [], [], time.monotonic() + 10
    while len(values) < count and time.monotonic() < end_s:
        readings = logger.read(0.5)
        values += readings.values[:, 0].tolist()
        reasons += [anomaly.reason for anomaly in readings.anomalies]
    return values, reasons


def opened(one: Mosquitto, **options: object) -> MqttLogger:
    """A logger on the broker, once that accepts connections."""
    logger, end_s = (
        MqttLogger(host="127.0.0.1", port=one.port, topic="vacuum", **options),
        time.monotonic() + 10,
    )
    while True:
        try:
            logger.open()
            return logger
        except DeviceAbsent:
            assert time.monotonic() < end_s
            time.sleep(0.05)


@needs_mosquitto
def test_messages_of_a_real_broker_are_read_and_nonsense_is_named(tmp_path: Path) -> None:
    with broker(tmp_path) as one:
        logger = opened(one, columns=["p1 [kPa]"])
        for payload in ("41.5", '{"p1": 42.5}', "x", "7" * 5000, '{"p2": 1}', "43.5"):
            publish.single("vacuum", payload, hostname="127.0.0.1", port=one.port)
        values, reasons = read_until(logger, 3)
        assert values == [41.5, 42.5, 43.5]
        assert sorted(reasons) == sorted([NOT_A_NUMBER, OVERLONG, OTHER_KEYS])
        logger.close()


@needs_mosquitto
def test_a_retained_message_is_an_old_reading(tmp_path: Path) -> None:
    with broker(tmp_path) as one:
        opened(one, columns=["p1 [kPa]"]).close()
        publish.single("vacuum", "41.5", hostname="127.0.0.1", port=one.port, retain=True)
        logger = opened(one, columns=["p1 [kPa]"])
        readings = logger.read(5.0)
        assert (len(readings.time_ns), readings.anomalies[0].reason) == (0, RETAINED)
        logger.close()


@needs_mosquitto
def test_a_broker_that_ends_is_a_lost_device(tmp_path: Path) -> None:
    with broker(tmp_path) as one:
        logger = opened(one, columns=["p1 [kPa]"])
        one.kill()
        with pytest.raises(DeviceLost, match="connection to the broker is lost"):
            read_until(logger, 1)
        logger.close()


@needs_mosquitto
def test_a_broker_that_wants_a_password_refuses(tmp_path: Path) -> None:
    (tmp_path / "passwords").touch()
    with broker(tmp_path, "allow_anonymous false") as one, pytest.raises(DeviceRefused, match="refuses"):
        opened(one, columns=["p1 [kPa]"])
