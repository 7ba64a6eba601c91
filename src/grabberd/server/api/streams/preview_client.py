"""One client of a preview: what it asks for, what it has taken, and what it is sent."""

import asyncio
import math

from fastapi import WebSocket
from pydantic import ValidationError

from grabberd.documents.preview import PreviewAsk, PreviewWords
from grabberd.instrument.live.grey_picture import LADDER, Detail, Part
from grabberd.instrument.live.preview import View
from grabberd.server.api.streams.link import Link
from grabberd.server.api.streams.preview_feed import LIGHT_EVERY_S, FieldMessages, PreviewFeed

PATIENCE_S = 60.0
UNASKED_EVERY_S = 1 / 12
"""Shortest time between messages to a client that does not say what it takes."""
SOONER = 0.9
"""Share of a client's period after which the next field is its own: fields come in steps of theirs."""
FRAME_COLUMNS = 720
COARSEST = LADDER[-1].reduce
INVALID = 1008
"""Close code for what breaks the rules (RFC 6455, 7.4.1)."""


class PreviewClient:
    """Sends one client the newest fields, as it asks for them and as fast as it takes them.

    Args:
        socket: Its WebSocket, which is open.
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
        """Takes what the client says, until it has gone or says what cannot be understood."""
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
        """Sends pictures while there are any; gives up on a client that takes none."""
        with self._feed.listening() as listener:
            while not self._feed.closed:
                await self._until_free()
                field = await listener.next(PATIENCE_S)
                if self._now_s() < self._due_s:
                    continue  # not wanted yet, so the link is not judged by it
                self._link.offered(listener.passed, self._now_s())
                if field is not None:
                    await self._send_one(field)

    async def _until_free(self) -> None:
        """Waits until the client has taken enough of what is on its way."""
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
    """Detail that the link carries, and no more than the screen shows."""
    if ask.part is not None:
        # A small part takes little of a link even with every pixel.
        return detail._replace(reduce=1 if 2 * ask.part.columns <= FRAME_COLUMNS else detail.reduce)
    reduce = detail.reduce
    while ask.width_px is not None and ask.width_px * 2 * reduce <= FRAME_COLUMNS and reduce < COARSEST:
        reduce *= 2
    return detail._replace(reduce=reduce)


def _reason(error: ValidationError) -> str:
    """The first thing that is wrong, in as many bytes as a close frame holds."""
    first = error.errors()[0]
    return f"{'.'.join(map(str, first['loc']))}: {first['msg']}"[:120]
