"""Slots and clocks for the tests of the service."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta

import numpy as np

from grabberd.core.field import Field, FieldOrder, NumberedField, quantise
from grabberd.core.ledger import LedgerEntry, Outcome, Slot
from grabberd.core.measurement.marks import Located
from grabberd.instrument.acquisition import StreamInfo

PERIOD_NS = 20_000_000
STREAM = StreamInfo("test", "card", "PAL", 16, 4, 50.0, FieldOrder.ALTERNATE, "GREY", 8, True, True, True, 0)


class ManualClock:
    """Stands still until it is moved."""

    def __init__(self, ns: int = 1_000_000_000) -> None:
        self.ns = ns

    def now_ns(self) -> int:
        return self.ns

    def utc_now(self) -> datetime:
        return datetime(2026, 1, 1, tzinfo=UTC) + timedelta(microseconds=self.ns / 1000)

    def advance(self, seconds: float) -> None:
        self.ns += round(seconds * 1e9)


def numbered(n: int, value: int = 200) -> NumberedField:
    luma = np.full((4, 16), value, np.uint8)
    return NumberedField(n, n * PERIOD_NS, n, quantise(Field.intact(luma, n % 2), 1, 128))


def slot(n: int, lost_before: int = 0, reason: str = "time gap") -> Slot:
    lost = (LedgerEntry(n - lost_before, lost_before, Outcome.LOST, reason),) if lost_before else ()
    return Slot(numbered(n), n, Outcome.RECEIVED, None, lost, n * PERIOD_NS)


def damaged(n: int, reason: str = "error flag") -> Slot:
    return Slot(numbered(n), n, Outcome.DAMAGED, reason, (), n * PERIOD_NS)


def without_signal(n: int) -> Slot:
    return Slot(None, n, Outcome.NO_SIGNAL, "no signal", (), n * PERIOD_NS)


class Source:
    """A source of fields that is interrupted when the test says so."""

    def __init__(
        self, interruption: Callable[[], str | None] = lambda: None, rate_hz: float = STREAM.rate_hz
    ) -> None:
        self._interruption = interruption
        self.rate_hz = rate_hz

    @property
    def interruption(self) -> str | None:
        return self._interruption()

    def marks_before(self, _: int) -> list[tuple[int, Located]]:
        return []
