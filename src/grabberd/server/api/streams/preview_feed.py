"""The newest field for all who look at it: each kind of message made once, and none while nobody looks."""

import asyncio
import math

from starlette.concurrency import run_in_threadpool

from grabberd.clock import UtcClock
from grabberd.errors import NotReady
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.live.newest_field import light_document
from grabberd.instrument.live.preview import Preview, PreviewField, View
from grabberd.server.api.streams.broadcast import Broadcast

EVERY_S = 1 / 25
LIGHT_EVERY_S = 0.2


class FieldMessages:
    """Messages of one field, each made once for all who are shown the same of it; used in the event loop."""

    def __init__(self, field: PreviewField) -> None:
        self._field = field
        self._made: dict[View, asyncio.Future[bytes]] = {}

    async def of(self, view: View) -> bytes:
        """The message with this view."""
        if view not in self._made:
            self._made[view] = asyncio.ensure_future(run_in_threadpool(self._field.message, view))
        # Others wait for it, too: it is made whether or not this client stays.
        return await asyncio.shield(self._made[view])


class PreviewFeed(Broadcast[FieldMessages]):
    """The newest field of a device, and its light."""

    def __init__(self, instrument: Instrument, clock: UtcClock) -> None:
        self._preview = Preview(instrument, clock)
        super().__init__(self._next, EVERY_S)
        self._instrument = instrument
        self._light: asyncio.Future[str | None] | None = None
        self._light_due_s = -math.inf

    async def light(self) -> str | None:
        """The light of the newest field as JSON, made at most five times a second; None without a field."""
        now_s = asyncio.get_running_loop().time()
        if self._light is None or now_s >= self._light_due_s:
            self._light = asyncio.ensure_future(run_in_threadpool(self._make_light))
            self._light_due_s = now_s + LIGHT_EVERY_S
        return await asyncio.shield(self._light)

    def _next(self) -> FieldMessages | None:
        field = self._preview.make()
        return None if field is None else FieldMessages(field)

    def _make_light(self) -> str | None:
        try:
            return light_document(self._instrument, None).model_dump_json()
        except NotReady:
            return None
