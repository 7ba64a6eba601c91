"""Recorders without threads, for the tests of what belongs to a capture."""

from collections.abc import Callable

from slots import STREAM, ManualClock, Source

from grabberd.core.ledger import Slot
from grabberd.instrument.acquisition import Backlog, Ring, RingReader, StreamInfo
from grabberd.instrument.capture.recorder import Begin, Recorder


def recorder(
    fields: int | None = None,
    capacity: int = 500,
    clock: ManualClock | None = None,
    *,
    reader: RingReader | None = None,
    stream: StreamInfo = STREAM,
    interruption: Callable[[], str | None] = lambda: None,
    begin: Begin | None = None,
) -> tuple[Recorder, Backlog[Slot]]:
    backlog: Backlog[Slot] = Backlog(capacity)
    clock, reader = clock or ManualClock(), reader or Ring().reader()
    return Recorder(
        reader, backlog, clock, stream, Source(interruption, stream.rate_hz), fields, begin
    ), backlog


def recorded(backlog: Backlog[Slot]) -> list[int]:
    return [one.n for one in backlog.from_index(0, 0)]
