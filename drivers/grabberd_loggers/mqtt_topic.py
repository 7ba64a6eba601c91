"""Readings that somebody publishes to an MQTT topic: a number, a line of text, or JSON."""

import ssl
import time
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Self

from pydantic import Field, model_validator

from grabberd.clock import Clock
from grabberd.errors import Cause, DeviceAbsent, DeviceLost, DeviceRefused, StreamFailed
from grabberd.tables import Column
from grabberd_loggers.json_message import Unusable, cells_of
from grabberd_loggers.line_logger import LineLogger, Opened, Received
from grabberd_loggers.lines import LONGEST, OTHER_CELLS
from grabberd_loggers.options import LineOptions

try:
    from paho.mqtt import client as paho
    from paho.mqtt.enums import CallbackAPIVersion
except ImportError as error:
    raise ImportError(str(error), name="grabberd[mqtt]") from error

_ANSWER_S = 5.0
_STEP_S = 0.1
_WAITING = 10_000
"""Messages that wait for the reader, the newest: a thread that stood still need not fill the memory."""
RETAINED = "a retained message is an old reading"
OVERLONG = "a message is too long to be a reading"
DROPPED = "messages were dropped: they came faster than they were read"
_CHECK = "check host, port and topic, and the broker's log; under systemd install the drop-in egress.conf"


class MqttOptions(LineOptions):
    """All options.

    Attributes:
        host: the broker; `port`: 1883, with TLS 8883.
        topic: the topic, without wildcards.
        columns: names of the numbers in a message; in a JSON object, its keys, dotted where one is further
            down: `BMP280.Pressure`.
        user, password_file: credentials; the file holds the password alone.
        tls: true, or the path of a PEM file with the broker's certificate authority.
        qos: 0, 1 or 2.
    """

    host: str = Field(min_length=1, max_length=253)
    port: int | None = Field(None, ge=1, le=65535)
    topic: str = Field(pattern=r"^[^+#\x00]+$", max_length=1000)
    user: str | None = None
    password_file: Path | None = None
    tls: bool | Path = False
    qos: int = Field(0, ge=0, le=2)

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.columns is None:
            raise ValueError("columns: missing; messages have no header")
        if self.password_file is not None and self.user is None:
            raise ValueError("password_file requires user")
        return self


def line_of(payload: bytes, columns: Sequence[Column]) -> str:
    """The line of text that a message means; what is neither a JSON object nor a list is a line already.

    Raises:
        Unusable: It is empty, or see `cells_of`.
    """
    text = payload.decode("utf-8", "replace").strip()
    if not text:
        raise Unusable(OTHER_CELLS, "an empty message")
    return ";".join(cells_of(text, columns)) if text[0] in "{[" else " ".join(text.split("\n"))


class _Topic:
    """A subscription to one topic."""

    driver = "mqtt"
    begins_anywhere = False

    def __init__(self, options: MqttOptions, _clock: Clock) -> None:
        self._options = options
        self._columns = tuple(map(Column.of, options.columns or ()))
        self._client: paho.Client | None = None
        self._messages: deque[paho.MQTTMessage] = deque(maxlen=_WAITING)
        self._dropped = 0
        self._refusal: str | None = None
        self._is_subscribed = False

    def open(self) -> Opened:
        options = self._options
        host, port = options.host, options.port or (8883 if options.tls else 1883)
        broker = f"{host}:{port}"
        self._messages.clear()
        self._refusal, self._is_subscribed = None, False
        self._client = self._made()
        try:
            self._client.connect(host, port, keepalive=30)
        except (OSError, ValueError) as error:
            raise DeviceAbsent(f"the broker {broker} cannot be reached: {error}", _CHECK) from error
        self._await_subscription(self._client)
        return Opened(options.topic, {"broker": broker, "topic": options.topic})

    def receive(self, timeout_s: float) -> Received:
        assert self._client is not None
        deadline_s = time.monotonic() + timeout_s
        while True:
            left_s = max(deadline_s - time.monotonic(), 0.0)
            if not self._messages:
                self._loop(self._client, min(left_s, _STEP_S))
            if self._messages or left_s <= 0:
                return self._received()

    def close(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.disconnect()

    def _received(self) -> Received:
        lines, anomalies = [], []
        if self._dropped:
            anomalies.append((DROPPED, f"{self._dropped} messages"))
            self._dropped = 0
        while self._messages:
            message = self._messages.popleft()
            if message.retain:
                anomalies.append((RETAINED, self._options.topic))
            elif len(message.payload) > LONGEST:
                anomalies.append((OVERLONG, f"{len(message.payload)} bytes"))
            else:
                try:
                    lines.append(line_of(bytes(message.payload), self._columns) + "\n")
                except Unusable as unusable:
                    anomalies.append((unusable.reason, unusable.example))
        return Received("".join(lines).encode(), tuple(anomalies))

    def _made(self) -> paho.Client:
        options = self._options
        client = paho.Client(CallbackAPIVersion.VERSION2)
        client.connect_timeout = _ANSWER_S
        if options.user is not None:
            client.username_pw_set(options.user, self._password())
        if options.tls:
            client.tls_set_context(self._tls())
        client.on_connect, client.on_subscribe = self._connected, self._subscribed
        client.on_message = self._arrived
        return client

    def _password(self) -> str | None:
        file = self._options.password_file
        try:
            return None if file is None else file.read_text(encoding="utf-8").rstrip("\r\n")
        except (OSError, UnicodeDecodeError) as error:
            raise DeviceRefused(f"{file} cannot be read: {error}", "let the daemon's user read it") from error

    def _tls(self) -> ssl.SSLContext:
        authority = self._options.tls
        try:
            return ssl.create_default_context(cafile=authority if isinstance(authority, Path) else None)
        except OSError as error:
            hint = "give a PEM file with the broker's certificate authority"
            raise DeviceRefused(f"{authority} cannot be used: {error}", hint) from error

    def _connected(self, client: paho.Client, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            self._refusal = f"the broker refuses the connection: {reason}"
        else:
            client.subscribe(self._options.topic, self._options.qos)

    def _subscribed(self, _client: Any, _data: Any, _mid: Any, reasons: Any, _properties: Any) -> None:
        refused = [reason for reason in reasons if reason.is_failure]
        self._is_subscribed = not refused
        if refused:
            self._refusal = f"the broker refuses {self._options.topic}: {refused[0]}"

    def _arrived(self, _client: Any, _data: Any, message: paho.MQTTMessage) -> None:
        self._dropped += len(self._messages) == _WAITING
        self._messages.append(message)

    def _await_subscription(self, client: paho.Client) -> None:
        deadline_s = time.monotonic() + _ANSWER_S
        while not self._is_subscribed:
            if self._refusal is not None:
                hint = "check user, password and the broker's access list"
                raise DeviceRefused(self._refusal, hint, Cause.NO_RIGHTS)
            if time.monotonic() > deadline_s:
                raise StreamFailed(f"the broker did not answer within {_ANSWER_S:g} s", _CHECK)
            result = client.loop(_STEP_S)
            if result != paho.MQTT_ERR_SUCCESS and self._refusal is None:
                raise StreamFailed(f"the broker ended the connection: {paho.error_string(result)}", _CHECK)

    def _loop(self, client: paho.Client, timeout_s: float) -> None:
        result = client.loop(max(timeout_s, 0.001))
        if result != paho.MQTT_ERR_SUCCESS:
            hint = "grabberd connects again by itself; check network and broker if it does not"
            raise DeviceLost(f"the connection to the broker is lost: {paho.error_string(result)}", hint)


class MqttLogger(LineLogger):
    """An MQTT topic; `MqttOptions` lists its options."""

    options_class = MqttOptions
    source_class = _Topic
