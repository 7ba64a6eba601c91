"""Readings from an MQTT topic: what a message means, and a real broker."""

import socket
import time
from pathlib import Path

import pytest

pytest.importorskip("paho.mqtt.client", reason="pip install 'grabberd[mqtt]'")

from brokers import Mosquitto, broker, needs_mosquitto
from paho.mqtt import client as paho
from paho.mqtt import publish
from paho.mqtt.enums import CallbackAPIVersion

from grabberd.errors import DeviceAbsent, DeviceLost, DeviceRefused
from grabberd.runtime import SystemClock
from grabberd_loggers.lines import NOT_A_NUMBER, Line, LineFormat, LineReadings, Refused
from grabberd_loggers.mqtt_topic import (
    OTHER_KEYS,
    OVERLONG,
    RETAINED,
    BoundedClient,
    MqttLogger,
    MqttOptions,
    Unusable,
    _Topic,
    line_of,
)

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


class Link:
    """A socket with a packet in it; `asked` has the sizes that it was asked for."""

    def __init__(self, packet: bytes, length: int) -> None:
        self._left, self._length, self.asked = packet, length, 0

    def recv(self, size: int) -> bytes:
        self.asked = max(self.asked, size)
        piece, self._left = self._left[:size], self._left[size:]
        filler = b"7" * min(size, self._length) if not piece else b""
        self._length -= len(filler)
        return piece + filler


def test_a_message_of_60_mb_is_refused_by_its_announced_length_and_never_kept() -> None:
    topic = _Topic(MqttOptions(host="broker", topic="vacuum", columns=["p1"]), SystemClock())
    client = topic._made()
    body = 60_000_000
    length = bytearray()
    left = body + 8
    while left:
        left, digit = divmod(left, 128)
        length.append(digit | (128 if left else 0))
    link = Link(b"\x30" + bytes(length) + b"\x00\x06vacuum", body)
    client._sock = link  # type: ignore[assignment]
    kept = 0
    while not topic._messages:
        client._packet_read()
        kept = max(kept, len(client._in_packet["packet"]))
    client._sock = None
    assert kept < 1 << 18
    assert link.asked <= 1 << 16
    assert topic._received().lines == (Refused(OVERLONG, f"{body} bytes"),)


def test_an_empty_message_is_no_reading() -> None:
    with pytest.raises(Unusable, match="another number of cells"):
        line_of(b" ", FORMAT.columns)


BREAKS = ["\r", "\n", "\r\n", "\x00", "\x0b", "\x1c", "\x85", "\u2028"]


def read_all(
    *payloads: bytes, columns: tuple[str, ...] = ("p1 [kPa]",)
) -> tuple[list[list[float]], list[str], int]:
    """Values, reasons and losses of messages that arrive together."""
    topic = _Topic(MqttOptions(host="broker", topic="vacuum", columns=columns), SystemClock())
    for payload in payloads:
        message = paho.MQTTMessage(topic=b"vacuum")
        message.payload = payload
        topic._arrived(BoundedClient(CallbackAPIVersion.VERSION2), None, message)
    lines = LineReadings(LineFormat.of_columns(columns), None, False)
    readings = lines.take(topic._received().lines, 10**9)
    reasons = [anomaly.reason for anomaly in readings.anomalies]
    return readings.values.tolist(), reasons, sum(anomaly.lost for anomaly in readings.anomalies)


@pytest.mark.parametrize("between", BREAKS)
def test_a_message_is_one_reading_or_a_counted_refusal_whatever_line_breaks_it_has(between: str) -> None:
    for text in (f"41{between}42", f'{{"p1": "41{between}42"}}', f'["41{between}42"]', f"41{between}{{"):
        values, reasons, lost = read_all(text.encode())
        assert (values, len(reasons), lost) == ([], 1, 1), text
    values, reasons, _ = read_all(f"{between}41{between}".encode())
    assert len(values) + len(reasons) == 1


@pytest.mark.parametrize("between", ["\r", "\n", "\r\n"])
def test_line_breaks_between_the_parts_of_json_are_none_of_the_message(between: str) -> None:
    assert read_all(f'{{{between}"p1":{between}41{between}}}'.encode()) == ([[41.0]], [], 0)


def test_refused_messages_are_lost_readings_unless_their_time_tells() -> None:
    payloads = (b"41", b"x", b"", b"{", b"7" * 5000, b"42")
    values, reasons, lost = read_all(*payloads)
    assert (values, len(reasons), lost) == ([[41.0], [42.0]], 4, 4)
    assert read_all(b"1;41", b"x", b"2;42", columns=("time_s", "p1 [kPa]"))[2] == 0


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
