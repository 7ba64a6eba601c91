"""The feeds of a service that stream to clients: its state, the points of every field, curves and preview.

The state is sent as server-sent events: first the whole state, then its changes. A field's points are encoded
once for all clients, as soon as they are published.
"""

import asyncio
import json
import logging
import secrets
import threading
from collections.abc import AsyncIterator
from contextlib import aclosing, suppress
from functools import lru_cache, partial
from typing import NamedTuple

from fastapi.responses import StreamingResponse
from starlette.types import Send

from grabberd.documents.document import JsonObject
from grabberd.documents.points_frame import encoded
from grabberd.instrument.capture.device_captures import of_device
from grabberd.instrument.device.worker import Live, Worker
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.live.field_streams import PointsEncoder, PreviewPicture, curves_message
from grabberd.instrument.live.state import History, Version, changes
from grabberd.runtime import UtcClock
from grabberd.server.api.streams.broadcast import Broadcast, Channel
from grabberd.server.api.streams.preview import PreviewFeed
from grabberd.server.daemon.service import Service

EVERY_S = 0.2
KEEP_ALIVE_S = 15.0
KEEP_ALIVE = ": nothing has changed\n\n"
RETRY = "retry: 2000\n\n"


class EventFeed:
    """The events of a service, made once for all clients.

    Attributes:
        broadcast: Broadcast of the versions of the state.
    """

    def __init__(
        self, service: Service, every_s: float = EVERY_S, keep_alive_s: float = KEEP_ALIVE_S
    ) -> None:
        self._service = service
        self._keep_alive_s = keep_alive_s
        self._start = secrets.token_hex(4)  # version numbers from before a restart are invalid
        self._history = History()
        self.broadcast: Broadcast[Version] = Broadcast(self._look, every_s)
        self._text = lru_cache(8)(self._make_text)  # most clients have seen the same version

    async def events(self, last_id: str | None) -> AsyncIterator[str]:
        """The events after the last one that a client has received; ends when the daemon stops."""
        seen = self._number(last_id)
        yield RETRY
        with self.broadcast.listening() as listener:
            while not self.broadcast.closed:
                version = await listener.next(self._keep_alive_s)
                if version is not None and version.number != seen:
                    yield self._text(seen, version.number)
                    seen = version.number
                elif not self.broadcast.closed:
                    yield KEEP_ALIVE

    def _look(self) -> Version | None:
        return self._history.enter(self._service.state().model_dump(mode="json"))

    def _number(self, last_id: str | None) -> int | None:
        start, _, number = (last_id or "").partition("-")
        return int(number) if start == self._start and number.isdecimal() else None

    def _make_text(self, seen: int | None, number: int) -> str:
        version, known = self._history.find(number), None if seen is None else self._history.find(seen)
        assert version is not None, "the newest is never forgotten"
        # The client is new, was away longer than versions are kept, or the daemon was restarted.
        if known is None:
            return self._event("state", number, version.document)
        return self._event("change", number, changes(known.document, version.document))

    def _event(self, kind: str, number: int, document: JsonObject) -> str:
        data = json.dumps(document, ensure_ascii=False, separators=(",", ":"))
        return f"id: {self._start}-{number}\nevent: {kind}\ndata: {data}\n\n"


class EventStream(StreamingResponse):
    """An endless response that closes its source as soon as its client disconnects."""

    media_type = "text/event-stream"

    async def stream_response(self, send: Send) -> None:
        """Sends the events."""
        async with aclosing(self.body_iterator):  # type: ignore[type-var]
            await super().stream_response(send)


log = logging.getLogger(__name__)

KEPT = 10
"""Fields by which a client may be late without missing any, so a short stall of the daemon costs none."""
LOOK_EVERY_S = 0.25
"""Longest wait for a field before checking whether anybody still listens."""


class PointsMessage(NamedTuple):
    """A field's points as sent to clients.

    Attributes:
        number: Number of the description that applies to it.
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
            published.notify_all()  # or threads would accumulate where listeners come and go

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
    """Fields published since, as soon as there are any; empty after a timeout or without listeners."""
    with worker.published:
        worker.published.wait_for(lambda: ended.is_set() or worker.since(last), LOOK_EVERY_S)
        return worker.since(last)


def _message(encoder: PointsEncoder, live: Live) -> PointsMessage:
    description = encoder.description()
    frame = encoder.frame(live)
    return PointsMessage(frame.description, description, encoded(frame))


CURVES_EVERY_S = 0.2


class DeviceFeeds(NamedTuple):
    """The feeds of a device.

    Attributes:
        preview: Its newest field, with the measured targets.
        points: The points of its fields.
        curves: Its movement and its vacuum.
        picture: Its newest field as a picture.
    """

    preview: PreviewFeed
    points: PointsFeed
    curves: Broadcast[str]
    picture: PreviewPicture


class Feeds:
    """The feeds of a service.

    Attributes:
        events: Feed of the state and its changes.
    """

    def __init__(self, service: Service) -> None:
        self.events = EventFeed(service)
        clock, loggers = service.clock, service.loggers
        self._devices = {
            name: DeviceFeeds(
                PreviewFeed(one, clock),
                PointsFeed(one, clock),
                Broadcast(partial(curves_message, one, loggers, clock), CURVES_EVERY_S),
                PreviewPicture(one),
            )
            for name, one in service.instruments.items()
        }

    def of(self, device: str | None) -> DeviceFeeds:
        """The feeds of a device, whose name may be None if there is only one.

        Raises:
            NotFound: The device does not exist, or a name is required.
        """
        return of_device(self._devices, device)

    def close(self) -> None:
        """Ends every stream, because the server waits for responses to end before it stops."""
        self.events.broadcast.close()
        for one in self._devices.values():
            one.preview.close()
            one.points.close()
            one.curves.close()
