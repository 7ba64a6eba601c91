"""Server-sent events: the whole state first, then its changes."""

import json
import secrets
from collections.abc import AsyncIterator
from contextlib import aclosing
from functools import lru_cache

from fastapi.responses import StreamingResponse
from starlette.types import Send

from grabberd.documents.named_types import JsonObject
from grabberd.instrument.live.state_changes import History, Version, changes
from grabberd.server.api.streams.broadcast import Broadcast
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
        """The events after the last one that a client has seen; ends when the daemon does."""
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
        # The client is new, was away for longer than versions are kept, or knew another start of the daemon.
        if known is None:
            return self._event("state", number, version.document)
        return self._event("change", number, changes(known.document, version.document))

    def _event(self, kind: str, number: int, document: JsonObject) -> str:
        data = json.dumps(document, ensure_ascii=False, separators=(",", ":"))
        return f"id: {self._start}-{number}\nevent: {kind}\ndata: {data}\n\n"


class EventStream(StreamingResponse):
    """An endless response that closes its source as soon as its client has gone."""

    media_type = "text/event-stream"

    async def stream_response(self, send: Send) -> None:
        """Sends the events."""
        async with aclosing(self.body_iterator):  # type: ignore[type-var]
            await super().stream_response(send)
