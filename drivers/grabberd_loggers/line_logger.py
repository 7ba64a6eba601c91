"""The logger contract over any source of lines: a serial port, a file that grows, an MQTT topic."""

from typing import Any, ClassVar, NamedTuple, Protocol

from grabberd.core.channels import Anomaly, Dating, LoggerInfo, Readings
from grabberd.errors import DeviceLost, DeviceRefused, StreamFailed
from grabberd.runtime import Clock, SystemClock
from grabberd_loggers.lines import LineBuffer, LineReadings, Refused
from grabberd_loggers.options import LineOptions, read_options

HEADER_S = 5.0
"""Time in which a logger must send its header: those that restart when they are opened need two seconds."""
OVERLONG = "a line without an end"
_BY_ARRIVAL = (
    "The lines carry no time and no rate is given: readings are dated by their arrival, which may be some "
    "10 ms late. A time column, or rate_hz in the options, is better."
)
_SIGMA_NS = {Dating.OWN_CLOCK: 1_000_000, Dating.ARRIVAL: 10_000_000}


class Opened(NamedTuple):
    """A source as found.

    Attributes:
        model: Its own name.
        details: As in `LoggerInfo`.
    """

    model: str
    details: dict[str, str]


class Received(NamedTuple):
    """Delivery of a source.

    Attributes:
        data: Bytes of lines, complete or not, of a source that separates them by their ends.
        anomalies: Reason and example of what else happened.
        starts_anew: True if the bytes begin a line, whatever came before.
        lines: Lines of a source that delivers them one by one, such as messages, whatever is in them.
    """

    data: bytes = b""
    anomalies: tuple[tuple[str, str], ...] = ()
    starts_anew: bool = False
    lines: tuple[str | Refused, ...] = ()


class Source(Protocol):
    """Source of lines; `begins_anywhere` if its first line may have lost its beginning."""

    driver: str
    begins_anywhere: bool

    def __init__(self, options: Any, clock: Clock) -> None: ...

    def open(self) -> Opened:
        """Open it; raises as `Logger.open`, and is closed then."""
        ...

    def receive(self, timeout_s: float) -> Received:
        """Wait for bytes up to `timeout_s`, while it is open; raises as `Logger.read`."""
        ...

    def close(self) -> None:
        """Close it; safe to call twice, and half open."""
        ...


class LineLogger:
    """A logger whose source delivers lines of text; a driver names its options and its source."""

    options_class: ClassVar[type[LineOptions]]
    source_class: ClassVar[type[Source]]

    def __init__(self, *, clock: Clock | None = None, **options: Any) -> None:
        """Checks the options; nothing is opened.

        Args:
            clock: Clock that arrivals are dated by; by default the machine's.
            options: See `options_class`.

        Raises:
            ValueError: An option is unknown or not allowed; the message has a line for each.
        """
        self._clock = clock or SystemClock()
        self._options = read_options(self.options_class, options)
        self._source = self.source_class(self._options, self._clock)
        self._lines: LineReadings | None = None
        self._buffer = LineBuffer()

    def open(self) -> LoggerInfo:
        """Opens the source and waits for its header, if no columns are given.

        Raises:
            DeviceAbsent, DeviceRefused: See `Logger.open`.
            StreamFailed: No header came, or it cannot be used.
        """
        if self._lines is not None:
            raise DeviceRefused(f"the {self._source.driver} logger is open already", "close it first")
        self._buffer = LineBuffer()
        options = self._options
        try:
            opened = self._source.open()
            self._lines = LineReadings(options.line_format, options.rate_hz, self._source.begins_anywhere)
            self._await_header(self._lines)
            return self._info(opened, self._lines)
        except BaseException:
            self.close()
            raise

    def read(self, timeout_s: float) -> Readings:
        """Waits for the next lines; see `Logger.read`."""
        if self._lines is None or self._lines.format is None:
            raise DeviceLost(f"the {self._source.driver} logger is not open", "open it first")
        deadline_ns = self._clock.now_ns() + round(timeout_s * 1e9)
        left_s = 0.0  # lines may have come with the header
        while True:
            readings = self._take(self._lines, self._source.receive(left_s))
            left_s = (deadline_ns - self._clock.now_ns()) / 1e9
            if len(readings.time_ns) or readings.anomalies or left_s <= 0:
                return readings

    def close(self) -> None:
        """Closes the source."""
        self._lines = None
        self._source.close()

    def _take(self, lines: LineReadings, received: Received) -> Readings:
        now_ns = self._clock.now_ns()
        unended = received.starts_anew and self._buffer.is_amid_a_line
        if received.starts_anew:
            self._buffer = LineBuffer()
        texts, overlong = self._buffer.feed(received.data)
        refused = [Refused(OVERLONG, "")] * (unended + overlong)
        readings = lines.take([*refused, *texts, *received.lines], now_ns)
        if not received.anomalies:
            return readings
        anomalies = tuple(Anomaly(now_ns, reason, example) for reason, example in received.anomalies)
        return readings._replace(anomalies=(*anomalies, *readings.anomalies))

    def _await_header(self, lines: LineReadings) -> None:
        deadline_ns = self._clock.now_ns() + round(HEADER_S * 1e9)
        seen = ""
        while lines.format is None:
            left_s = (deadline_ns - self._clock.now_ns()) / 1e9
            if left_s <= 0:
                came = f"the last line was {seen!r}" if seen else "nothing came at all"
                raise StreamFailed(
                    f"the {self._source.driver} logger sent no header within {HEADER_S:g} s; {came}",
                    "name the columns of its lines in the options: columns: [time_ms, 'p1 [kPa]']"
                    if seen
                    else "check cable, baud rate and power; then name the columns in the options",
                )
            received = self._source.receive(left_s)
            texts, _ = self._buffer.feed(received.data)
            for index, text in enumerate(texts):
                lines.take([text], self._clock.now_ns())
                seen = text[:60]
                if lines.format is not None:
                    # Lines that came with the header are its units and the first readings.
                    below = texts[index + 1 :]
                    if below and lines.take_units(below[0]):
                        below = below[1:]
                    self._buffer.push_back("".join(f"{one}\n" for one in below).encode())
                    break

    def _info(self, opened: Opened, lines: LineReadings) -> LoggerInfo:
        assert lines.format is not None
        channels = lines.format.channels
        dating = lines.dating
        return LoggerInfo(
            driver=self._source.driver,
            model=opened.model,
            channels=tuple(column.name for column in channels),
            units=tuple(column.unit for column in channels),
            rate_hz=self._options.rate_hz,
            dating=dating,
            time_sigma_ns=_SIGMA_NS[dating],
            details=opened.details,
            remarks=(_BY_ARRIVAL,) if dating is Dating.ARRIVAL else (),
        )
