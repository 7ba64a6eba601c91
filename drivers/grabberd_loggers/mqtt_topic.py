"""Readings that somebody publishes to an MQTT topic: a number, a line of text, or JSON."""

import json
import re
import ssl
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

from pydantic import Field, model_validator

from grabberd.bounded_documents import DEEPEST
from grabberd.errors import Cause, DeviceAbsent, DeviceLost, DeviceRefused, StreamFailed, count_of
from grabberd.runtime import Clock
from grabberd.tables import Column, number_of
from grabberd_loggers.line_logger import LineLogger, Opened, Received
from grabberd_loggers.lines import ABSENT, IGNORED, LONGEST, OTHER_CELLS, Refused, printable
from grabberd_loggers.options import LineOptions

OTHER_UNIT = "a message states another unit than the column"
NOT_JSON, OTHER_KEYS = "a message is not valid JSON", "a message has other keys than the columns"
_SHOWN = 300
_ISO = re.compile(r"(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d(?::\d\d)?)(?:[.,](\d{1,9}))?(Z|[+-]\d\d:?\d\d)?")
_SEPARATES = re.compile(r"[;,\s]")


class Unusable(ValueError):
    """A message without a reading: `reason` is the same each time, `example` says what this one has."""

    def __init__(self, reason: str, example: str) -> None:
        self.reason, self.example = reason, printable(example)
        super().__init__(reason, self.example)


def cells_of(text: str, columns: Sequence[Column]) -> list[str]:
    """The cells of a line that say the same as a JSON object or list.

    Args:
        text: The message.
        columns: Columns of the line; the values of a list are in their order.

    Raises:
        Unusable: It is not valid JSON, too deep, gives a key twice, has another number of values, or none of
            the measured columns, or one of them only under a longer name.
    """
    try:
        content = json.loads(text, object_pairs_hook=_distinct)
        values = _distinct([*_leaves(content, "", 0)]) if isinstance(content, dict) else content
    except RecursionError:
        raise Unusable(NOT_JSON, _TOO_DEEP) from None
    except ValueError as error:
        raise Unusable(NOT_JSON, f"{error}: {text[:60]}") from None
    if isinstance(values, dict):
        asked = [column for column in columns if column.name != IGNORED]
        _check_keys(values, asked)
        _check_units(values, asked)
        values = [values.get(column.name) for column in columns]
    if len(values) != len(columns):
        raise Unusable(
            OTHER_CELLS,
            f"{count_of(len(values), 'value')} for {count_of(len(columns), 'column')}: {text[:60]}",
        )
    return [_cell(column, value) for column, value in zip(columns, values, strict=True)]


_TOO_DEEP = f"it is nested in more than {DEEPEST} levels"


def _distinct(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object, of which plain JSON silently keeps the last of equal keys."""
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"the key {next(name for name in names if names.count(name) > 1)} is given twice")
    return found


def _leaves(value: Any, name: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Names and values without parts, in their order."""
    if depth > DEEPEST:
        raise ValueError(_TOO_DEEP)
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    if depth and not parts:
        yield name, value
    for key, part in parts:
        yield from _leaves(part, f"{name}.{key}" if depth else str(key), depth + 1)


def _check_keys(values: Mapping[str, Any], columns: Sequence[Column]) -> None:
    missing = [column.name for column in columns if column.name not in values]
    longer = {name: next((key for key in values if key.endswith(f".{name}")), None) for name in missing}
    measured = [column.name for column in columns if not column.is_time]
    if any(longer.values()) or not values.keys() & set(measured):
        keys = ", ".join(values)
        keys = keys if len(keys) <= _SHOWN else f"{keys[:_SHOWN]}…"
        advice = "".join(f"; write {key}" for key in longer.values() if key)
        are = "is" if len(missing) == 1 else "are"
        said = f"the message's keys are {keys}; {', '.join(missing)} {are} not among them{advice}"
        raise Unusable(OTHER_KEYS, said if values else "the message has no keys")


def _check_units(values: Mapping[str, Any], columns: Sequence[Column]) -> None:
    """Check the units that a message states beside its values, as `PressureUnit`, wherever it does."""
    stated = {key.rpartition(".")[2].lower(): text for key, text in values.items() if isinstance(text, str)}
    for column in columns:
        leaf = column.name.rpartition(".")[2].lower()
        unit = next((stated[key] for key in (f"{leaf}unit", f"{leaf}_unit") if key in stated), None)
        if unit and column.unit and _same(unit) != _same(column.unit):
            raise Unusable(
                OTHER_UNIT, f"the message says {column.name} is in {unit}, the column {column.unit}"
            )


def _same(unit: str) -> str:
    unit = unit.strip().lower()
    return {"mbar": "hpa", "torr": "mmhg"}.get(unit, unit)


def _cell(column: Column, value: Any) -> str:
    """A value as a cell; what is not a number stands with its key, in one piece."""
    if value is None or column.name == IGNORED:
        return IGNORED
    if isinstance(value, int | float) and not isinstance(value, bool):
        return str(value)
    if isinstance(value, str):
        words = value.strip().replace(",", ".")
        if column.is_time and column.unit in (None, "s"):
            words = _seconds(value.strip()) or words
        if number_of(words) is not None or words in ABSENT:
            return words or IGNORED
    return _SEPARATES.sub("_", f"{column.name}={value if isinstance(value, str) else json.dumps(value)}")


def _seconds(text: str) -> str | None:
    """Seconds since 1970 of a time in ISO 8601, with its decimals; None for something else.

    Without a zone it is taken for UTC: only the time from one reading to the next counts.
    """
    found = _ISO.fullmatch(text)
    if found is None:
        return None
    day, clock, decimals, zone = found.groups()
    try:
        whole = datetime.fromisoformat(f"{day}T{clock}{zone or ''}")
    except ValueError:
        return None
    seconds = int((whole if whole.tzinfo else whole.replace(tzinfo=UTC)).timestamp())
    return f"{seconds}.{decimals}" if decimals else str(seconds)


try:
    from paho.mqtt import client as paho
    from paho.mqtt.enums import CallbackAPIVersion, MQTTErrorCode
except ImportError as error:
    raise ImportError(str(error), name="grabberd[mqtt]") from error

_ANSWER_S = 5.0
_STEP_S = 0.1
_WAITING = 10_000
"""Messages that wait for the reader, the newest: a thread that stood still need not fill the memory."""
_LARGEST_PACKET, _PIECE = 4 * LONGEST, 1 << 16
"""Bytes of a packet that are kept: more than a topic and the longest line; bytes read at once beyond them."""
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

    A message is one line, whatever line breaks it has: they separate its numbers like blanks.

    Raises:
        Unusable: It is empty, or see `cells_of`.
    """
    text = payload.decode("utf-8", "replace").strip()
    if not text:
        raise Unusable(OTHER_CELLS, "an empty message")
    return ";".join(cells_of(text, columns)) if text[0] in "{[" else text


class BoundedClient(paho.Client):
    """Keeps the beginning of a packet alone, if that announces more than a reading can have.

    By itself the library collects up to 256 MB before anybody sees the message.

    Attributes:
        dropped: Bytes of the last packet that were read and dropped.
    """

    dropped = 0

    def _sock_recv(self, bufsize: int) -> bytes:
        if self._in_packet["remaining_length"] > _LARGEST_PACKET:
            del self._in_packet["packet"][_LARGEST_PACKET:]
            bufsize = min(bufsize, _PIECE)
        return super()._sock_recv(bufsize)

    def _packet_handle(self) -> MQTTErrorCode:
        del self._in_packet["packet"][_LARGEST_PACKET:]
        self.dropped = max(self._in_packet["remaining_length"] - _LARGEST_PACKET, 0)
        return super()._packet_handle()


class _Topic:
    """A subscription to one topic."""

    driver = "mqtt"
    begins_anywhere = False

    def __init__(self, options: MqttOptions, _clock: Clock) -> None:
        self._options = options
        self._columns = tuple(map(Column.of, options.columns or ()))
        self._client: BoundedClient | None = None
        self._messages: deque[str | Refused] = deque(maxlen=_WAITING)
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
        lines = [*self._messages]
        self._messages.clear()
        if self._dropped:
            lines.insert(0, Refused(DROPPED, count_of(self._dropped, "message"), self._dropped))
            self._dropped = 0
        return Received(lines=tuple(lines))

    def _line(self, message: paho.MQTTMessage, dropped: int) -> str | Refused:
        if message.retain:
            return Refused(RETAINED, self._options.topic, 0)
        if len(message.payload) > LONGEST:
            return Refused(OVERLONG, f"{len(message.payload) + dropped} bytes")
        try:
            return line_of(bytes(message.payload), self._columns)
        except Unusable as unusable:
            return Refused(unusable.reason, unusable.example)

    def _made(self) -> BoundedClient:
        options = self._options
        client = BoundedClient(CallbackAPIVersion.VERSION2)
        client.connect_timeout = _ANSWER_S
        if options.user is not None:
            client.username_pw_set(options.user, self._password())
        if options.tls:
            client.tls_set_context(self._tls())
        client.on_connect, client.on_subscribe = self._connected, self._subscribed
        client.on_message = self._arrived  # type: ignore[assignment]  # it is a BoundedClient
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

    def _arrived(self, client: BoundedClient, _data: Any, message: paho.MQTTMessage) -> None:
        self._dropped += len(self._messages) == _WAITING
        self._messages.append(self._line(message, client.dropped))

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
