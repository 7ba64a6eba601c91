"""The preview of a device: its newest field for all viewers, as fast as each client can take it.

Each kind of message is made once for all clients, and only while there are any. The pictures that a client
acknowledges show how much detail its link can carry.
"""

import asyncio
import math

from fastapi import WebSocket
from pydantic import ValidationError
from starlette.concurrency import run_in_threadpool

from grabberd.documents.requests import PreviewAsk, PreviewWords
from grabberd.errors import NotReady
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.live.field_streams import light_document
from grabberd.instrument.live.preview import LADDER, Detail, Part, Preview, PreviewField, View
from grabberd.runtime import UtcClock
from grabberd.server.api.streams.broadcast import Broadcast

WINDOW = 3
"""Pictures in flight: at 25 a second, enough for a round trip of 120 ms."""
LOOK_S, LONGEST_LOOK_S = 1.0, 3.0
LEAST_TAKEN = 6
"""Pictures that must be taken within `LOOK_S` for a judgement; with fewer it waits up to `LONGEST_LOOK_S`."""
ENOUGH = 0.85
"""Share of the offered pictures that a link must take to keep its level of detail."""
GAIN = 1.15
"""Factor by which less detail must raise that share; otherwise the detail was not the bottleneck."""
VAIN_S = 30.0
"""Time until less detail is tried again after it did not help."""
PATIENCE, MOST_PATIENCE = 8, 128
"""Good judgements after which more detail is tried; doubled each time that it turns out to be too much."""


class Link:
    """Judges a link by the pictures offered and those that its client has taken.

    Args:
        levels: Number of levels of detail.
        now_s: Present time.

    Attributes:
        level: Level of detail; 0 is the most detailed.
    """

    def __init__(self, levels: int, now_s: float) -> None:
        self.level = 0
        self._coarsest = levels - 1
        self._on_the_way = 0
        self._good_looks = 0
        self._patience = PATIENCE
        self._trying_more = False
        self._share_before: float | None = None
        self._vain_until_s = now_s
        self._restart(now_s)

    @property
    def is_free(self) -> bool:
        """True if another picture may be sent."""
        return self._on_the_way < WINDOW

    def sent(self) -> None:
        """Counts a picture that was sent."""
        self._on_the_way += 1

    def taken(self, count: int) -> None:
        """Counts pictures that the client has taken."""
        count = min(count, self._on_the_way)
        self._on_the_way -= count
        self._taken += count

    def offered(self, count: int, now_s: float) -> None:
        """Counts available pictures, sent or not, and judges the link after enough of them."""
        self._offered += count
        passed_s = now_s - self._since_s
        if passed_s < LOOK_S or (self._taken < LEAST_TAKEN and passed_s < LONGEST_LOOK_S):
            return
        share = min((self._taken + 1) / self._offered, 1.0)
        self._keeps_up() if share >= ENOUGH else self._falls_behind(share, now_s)
        self._restart(now_s)

    def _restart(self, now_s: float) -> None:
        self._since_s, self._offered, self._taken = now_s, 0, 0

    def _keeps_up(self) -> None:
        self._share_before = None
        self._good_looks += 1
        if self._good_looks < self._patience:
            return
        if self._trying_more:
            self._patience, self._trying_more = PATIENCE, False
        if self.level:
            self.level, self._good_looks, self._trying_more = self.level - 1, 0, True

    def _falls_behind(self, share: float, now_s: float) -> None:
        self._good_looks = 0
        if self._trying_more:
            self._patience, self._trying_more = min(2 * self._patience, MOST_PATIENCE), False
        if now_s < self._vain_until_s:
            return
        if self._share_before is not None and share < GAIN * self._share_before:
            self.level -= 1
            self._share_before, self._vain_until_s = None, now_s + VAIN_S
        elif self.level < self._coarsest:
            self._share_before = share
            self.level += 1


EVERY_S = 1 / 25
LIGHT_EVERY_S = 0.2


class FieldMessages:
    """Messages of one field, each made once for all clients with the same view; used in the event loop."""

    def __init__(self, field: PreviewField) -> None:
        self._field = field
        self._made: dict[View, asyncio.Future[bytes]] = {}

    async def of(self, view: View) -> bytes:
        """The message for a view."""
        if view not in self._made:
            self._made[view] = asyncio.ensure_future(run_in_threadpool(self._field.message, view))
        # Shielded: other clients may be waiting for it, too.
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


PATIENCE_S = 60.0
UNASKED_EVERY_S = 1 / 12
"""Shortest interval of messages to a client that does not acknowledge pictures."""
SOONER = 0.9
"""Share of a client's period after which the next field is sent to it, since fields come at fixed times."""
FRAME_COLUMNS = 720
COARSEST = LADDER[-1].reduce
INVALID = 1008
"""Close code for invalid messages (RFC 6455, 7.4.1)."""


class PreviewClient:
    """Sends one client the newest fields, as requested and as fast as it takes them.

    Args:
        socket: Its accepted WebSocket.
        feed: The preview of the device.
    """

    def __init__(self, socket: WebSocket, feed: PreviewFeed) -> None:
        self._socket = socket
        self._feed = feed
        self._now_s = asyncio.get_running_loop().time
        self._timeout_s = socket.app.state.front.limits.write_timeout_s
        self._ask: PreviewAsk | None = None
        self._link = Link(len(LADDER), self._now_s())
        self._heard = asyncio.Event()
        self._due_s = self._light_due_s = -math.inf

    async def hear(self) -> None:
        """Receives the client's messages until it disconnects or sends an invalid one."""
        while (event := await self._socket.receive())["type"] != "websocket.disconnect":
            try:
                words = PreviewWords.model_validate_json(event.get("text") or "")
            except ValidationError as error:
                await self._socket.close(INVALID, _reason(error))
                return
            self._ask = words.ask or self._ask
            self._link.taken(words.taken)
            self._heard.set()

    async def send(self) -> None:
        """Sends pictures until the feed ends; gives up on a client that takes none."""
        with self._feed.listening() as listener:
            while not self._feed.closed:
                await self._until_free()
                field = await listener.next(PATIENCE_S)
                if self._now_s() < self._due_s:
                    continue  # not requested yet, so it does not count for the link
                self._link.offered(listener.passed, self._now_s())
                if field is not None:
                    await self._send_one(field)

    async def _until_free(self) -> None:
        """Waits until the client has taken enough of the pictures in flight."""
        async with asyncio.timeout(self._timeout_s):
            while self._ask is not None and not self._link.is_free:
                self._heard.clear()
                await self._heard.wait()

    async def _send_one(self, field: FieldMessages) -> None:
        ask = self._ask
        message = await field.of(self._view())
        async with asyncio.timeout(self._timeout_s):
            await self._socket.send_bytes(message)
        if ask is None:
            self._due_s = self._now_s() + UNASKED_EVERY_S
            return
        if ask.rate_hz is not None:
            self._due_s = self._now_s() + SOONER / ask.rate_hz
        self._link.sent()
        if ask.light and self._now_s() >= self._light_due_s:
            self._light_due_s = self._now_s() + LIGHT_EVERY_S
            await self._send_light()

    async def _send_light(self) -> None:
        light = await self._feed.light()
        if light is not None:
            async with asyncio.timeout(self._timeout_s):
                await self._socket.send_text(light)

    def _view(self) -> View:
        ask = self._ask
        if ask is None or ask.picture == "bits":
            return View()
        part = None if ask.part is None else Part(ask.part.x, ask.part.y, ask.part.columns, ask.part.lines)
        return View(True, part, _detail(LADDER[self._link.level], ask))


def _detail(detail: Detail, ask: PreviewAsk) -> Detail:
    """Detail that the link carries, limited to what the screen can show."""
    if ask.part is not None:
        # A small part needs little bandwidth even with every pixel.
        return detail._replace(reduce=1 if 2 * ask.part.columns <= FRAME_COLUMNS else detail.reduce)
    reduce = detail.reduce
    while ask.width_px is not None and ask.width_px * 2 * reduce <= FRAME_COLUMNS and reduce < COARSEST:
        reduce *= 2
    return detail._replace(reduce=reduce)


def _reason(error: ValidationError) -> str:
    """The first problem, truncated to what a close frame can hold."""
    first = error.errors()[0]
    return f"{'.'.join(map(str, first['loc']))}: {first['msg']}"[:120]
