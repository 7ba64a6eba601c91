"""Every field's points, encoded once for all clients as soon as they are published."""

import asyncio
import logging
import threading
from contextlib import suppress
from typing import NamedTuple

from grabberd.clock import UtcClock
from grabberd.documents.points_frame import encoded
from grabberd.instrument.device.worker import Live, Worker
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.live.points_stream import PointsEncoder
from grabberd.server.api.streams.broadcast import Channel

log = logging.getLogger(__name__)

KEPT = 10
"""Fields that a client may be behind before it gets the newest: it misses none when the daemon is held up."""
LOOK_EVERY_S = 0.25
"""Longest wait for a field, until it is seen that nobody listens any more."""


class PointsMessage(NamedTuple):
    """A field's points as they are sent.

    Attributes:
        number: Number of the description that holds for it.
        description: That description as JSON.
        content: The points.
    """

    number: int
    description: str
    content: bytes


class PointsFeed(Channel[PointsMessage]):
    """The points of a device's fields; a thread waits for them while anybody listens.

    Args:
        instrument: The device.
        clock: Source of time.
    """

    def __init__(self, instrument: Instrument, clock: UtcClock) -> None:
        super().__init__(KEPT)
        self._instrument = instrument
        self._clock = clock
        self._ended = threading.Event()

    def _begin(self) -> None:
        self._ended = ended = threading.Event()
        encoder = PointsEncoder(self._instrument, self._clock)
        arguments = asyncio.get_running_loop(), encoder, ended
        name = f"points-{self._instrument.name}"
        threading.Thread(target=self._follow, args=arguments, name=name, daemon=True).start()

    def _end(self) -> None:
        self._ended.set()
        published = self._instrument.worker.published
        with published:
            published.notify_all()  # so that threads do not add up where listeners come and go

    def _follow(
        self, loop: asyncio.AbstractEventLoop, encoder: PointsEncoder, ended: threading.Event
    ) -> None:
        worker, failed = self._instrument.worker, False
        with worker.published:
            last = 0 if worker.live is None else worker.live.number  # it may be old
        while not ended.is_set():
            for live in _fresh(worker, last, ended):
                try:
                    message = _message(encoder, live)
                except Exception:
                    if not failed:
                        log.exception("%s: points cannot be sent at this moment", worker.name)
                    failed = True
                else:
                    failed = False
                    with suppress(RuntimeError):  # the loop is closed: the daemon ends
                        loop.call_soon_threadsafe(self._take, message, ended)
                last = live.number

    def _take(self, message: PointsMessage, ended: threading.Event) -> None:
        if not ended.is_set():
            self._put(message)


def _fresh(worker: Worker, last: int, ended: threading.Event) -> list[Live]:
    """Fields published since, as soon as there are any; none if nobody listens any more, or for long."""
    with worker.published:
        worker.published.wait_for(lambda: ended.is_set() or worker.since(last), LOOK_EVERY_S)
        return worker.since(last)


def _message(encoder: PointsEncoder, live: Live) -> PointsMessage:
    description = encoder.description()
    frame = encoder.frame(live)
    return PointsMessage(frame.description, description, encoded(frame))
