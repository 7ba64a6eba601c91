"""Readings out of lines of text, dated by the logger's own time, its rate, or their arrival."""

from collections.abc import Sequence

import numpy as np

from grabberd.core.channels import (
    Anomaly,
    ArrivalDating,
    ClockRelation,
    Dated,
    Dating,
    MissingReadings,
    Readings,
)
from grabberd.core.channels.missing_readings import MISSING
from grabberd.errors import StreamFailed
from grabberd_loggers.line_format import Line, LineFormat

REPEATED, HEADER_AGAIN = "a line was repeated", "the header came again"
_SHOWN = 60
_COUNTER_BITS = (32, 16)
"""Sizes of the counters that loggers take their time from; they wrap, and the time goes on."""
_WRAPPED_NS = 60e9
"""Longest time after the last reading at which a counter is believed to have wrapped."""


class LineReadings:
    """Turns a logger's lines into readings.

    Args:
        line_format: Format of the lines; None until a header has told it.
        rate_hz: Readings per second, if lines without a time come at a steady rate.
        begins_anywhere: True if the first line may have lost its beginning.
    """

    def __init__(self, line_format: LineFormat | None, rate_hz: float | None, begins_anywhere: bool) -> None:
        self.format = line_format
        self._rate_hz = rate_hz
        self._skips_first = begins_anywhere
        self._relation: ClockRelation | None = None
        self._arrivals, self._missing = ArrivalDating(), MissingReadings()
        self._counted = 0
        self._newest_own_ns: int | None = None
        self._wraps_ns = 0

    @property
    def dating(self) -> Dating:
        """Source of the readings' times."""
        has_time = self.format is not None and self.format.time_unit_ns is not None
        return Dating.OWN_CLOCK if has_time or self._rate_hz else Dating.ARRIVAL

    def take(self, lines: Sequence[str], arrival_ns: int) -> Readings:
        """Readings and anomalies of lines that arrived together.

        Raises:
            StreamFailed: A header announces other columns or units, or cannot be used.
        """
        anomalies: list[Anomaly] = []
        own_ns: list[int] = []
        values: list[tuple[float, ...]] = []
        for text in lines:
            line = self._line(text, arrival_ns, anomalies)
            if line is not None:
                own_ns.append(self._own_ns(line))
                values.append(line.values)
        if not values:
            return Readings.none(len(self.format.channels) if self.format else 0, anomalies)
        dated = self._date(np.array(own_ns, np.int64), arrival_ns)
        rows = np.array(values, np.float64)
        return Readings(dated.time_ns, rows, (*anomalies, *dated.anomalies), dated.sigma_ns)

    def _line(self, text: str, arrival_ns: int, anomalies: list[Anomaly]) -> Line | None:
        skips, self._skips_first = self._skips_first, False
        if (
            self._is_header(text, arrival_ns, anomalies)
            or text.startswith("#")
            or skips
            or self.format is None
        ):
            return None
        line = self.format.read(text)
        self._counted += 1  # also for nonsense: a reading was taken
        if isinstance(line, str):
            # Where lines carry a time, the gap in it counts what is lost.
            lost = 0 if self.format.time_unit_ns is not None else 1
            anomalies.append(Anomaly(arrival_ns, line, _shown(text), lost))
            return None
        if line.time_ns is not None and line.time_ns + self._wraps_ns == self._newest_own_ns:
            anomalies.append(Anomaly(arrival_ns, REPEATED, _shown(text)))
            return None
        if self._relation is None and self.dating is Dating.OWN_CLOCK:
            step_ns = self.format.time_step_ns(text) if line.time_ns is not None else 0.0
            self._relation = ClockRelation(resolution_ns=step_ns)
        return line

    def _is_header(self, text: str, arrival_ns: int, anomalies: list[Anomaly]) -> bool:
        if not text.startswith(("#", "time", "Time", "TIME")):
            return False
        try:
            announced = LineFormat.of_header(text)
        except ValueError as error:
            raise StreamFailed(f"the header {_shown(text)!r} cannot be used: {error}", _ADVICE) from error
        if announced is None:
            return False
        if self.format is None:
            self.format = announced
        elif announced.columns == self.format.columns:
            anomalies.append(Anomaly(arrival_ns, HEADER_AGAIN, _shown(text)))
        else:
            raise StreamFailed(
                f"the logger announces other columns than before: {_shown(text)!r}",
                "check units and columns in the configuration against what the logger sends now",
            )
        return True

    def _own_ns(self, line: Line) -> int:
        if line.time_ns is None:
            return round(self._counted * 1e9 / self._rate_hz) if self._rate_hz else 0
        own_ns = line.time_ns + self._wraps_ns
        if self._newest_own_ns is not None and own_ns < self._newest_own_ns:
            assert self.format is not None
            assert self.format.time_unit_ns is not None
            for bits in _COUNTER_BITS:
                wrap_ns = round(2**bits * self.format.time_unit_ns)
                if 0 < own_ns + wrap_ns - self._newest_own_ns < min(_WRAPPED_NS, wrap_ns / 2):
                    self._wraps_ns += wrap_ns
                    own_ns += wrap_ns
                    break
        self._newest_own_ns = own_ns
        return own_ns

    def _date(self, own_ns: "np.ndarray[tuple[int], np.dtype[np.int64]]", arrival_ns: int) -> Dated:
        if self._relation is None:
            return self._arrivals.date(len(own_ns), arrival_ns)
        dated = self._relation.date(own_ns, arrival_ns)
        if self._newest_own_ns is None:
            return dated._replace(anomalies=tuple(map(self._as_missing, dated.anomalies)))
        if dated.anomalies:
            self._missing.begin_anew()
        return dated._replace(anomalies=(*dated.anomalies, *self._missing.look(own_ns, arrival_ns)))

    def _as_missing(self, jump: Anomaly) -> Anomaly:
        """A jump of a clock that counts readings: so many have not come."""
        assert self._rate_hz is not None
        count = round(-float(jump.example.split()[0]) * self._rate_hz)
        return jump._replace(reason=MISSING, example=f"{count} at once", lost=max(count, 0))


_ADVICE = "write it like 'time_ms,p1 [kPa],p2 [kPa]', or name the columns in the options"


def _shown(text: str) -> str:
    """Printable part of a line, cut to a length that can be shown."""
    printable = "".join(char if char.isprintable() else "\ufffd" for char in text)
    return printable if len(printable) <= _SHOWN else printable[: _SHOWN - 1] + "…"
