"""Server-sent events: the whole state first, then what changes in it."""

import json
import secrets
from collections.abc import AsyncIterator, Mapping
from contextlib import aclosing
from functools import lru_cache
from typing import Annotated, Any

from fastapi import APIRouter, Header, Request
from fastapi.responses import StreamingResponse
from starlette.types import Send

from grabberd.api.guard.limits import OneStream
from grabberd.api.routes.state_models import StateDocument
from grabberd.api.streams.broadcast import Broadcast
from grabberd.service.live.state_changes import History, Version, changes
from grabberd.service.service import Service

EVERY_S = 0.2
KEEP_ALIVE_S = 15.0
KEEP_ALIVE = ": nothing has changed\n\n"
RETRY = "retry: 2000\n\n"

router = APIRouter(tags=["live"])


class EventFeed:
    """The events of a service, made once for all clients.

    Attributes:
        broadcast: of the state's versions.
    """

    def __init__(
        self, service: Service, every_s: float = EVERY_S, keep_alive_s: float = KEEP_ALIVE_S
    ) -> None:
        self._service = service
        self._keep_alive_s = keep_alive_s
        self._start = secrets.token_hex(4)  # numbers of before a restart mean nothing
        self._history = History()
        self.broadcast: Broadcast[Version] = Broadcast(self._look, every_s)
        self._text = lru_cache(8)(self._make_text)  # most clients have seen the same

    async def events(self, last_id: str | None) -> AsyncIterator[str]:
        """The events for a client that has seen those up to an id; endless but for the daemon's end."""
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
        document = StateDocument.model_validate(self._service.state()).model_dump(mode="json")
        return self._history.enter(document)

    def _number(self, last_id: str | None) -> int | None:
        start, _, number = (last_id or "").partition("-")
        return int(number) if start == self._start and number.isdecimal() else None

    def _make_text(self, seen: int | None, number: int) -> str:
        version, known = self._history.find(number), None if seen is None else self._history.find(seen)
        assert version is not None, "the newest is never forgotten"
        if known is None:
            return self._event("state", number, version.document)
        return self._event("change", number, changes(known.document, version.document))

    def _event(self, kind: str, number: int, document: Mapping[str, Any]) -> str:
        data = json.dumps(document, ensure_ascii=False, separators=(",", ":"))
        return f"id: {self._start}-{number}\nevent: {kind}\ndata: {data}\n\n"


class EventStream(StreamingResponse):
    """An endless answer, whose source is let go of at once when its client has gone."""

    media_type = "text/event-stream"

    async def stream_response(self, send: Send) -> None:
        """Sends it."""
        async with aclosing(self.body_iterator):  # type: ignore[type-var]
            await super().stream_response(send)


@router.get(
    "/events",
    response_class=EventStream,
    summary="The state, then its changes",
    responses={200: {"description": "`state` first, then `change`.", "content": {"text/event-stream": {}}}},
)
async def get_events(
    request: Request,
    _: OneStream,
    last_event_id: Annotated[
        str | None, Header(max_length=80, description="`id` of the last event that you have seen.")
    ] = None,
) -> EventStream:
    """Server-sent events: the state, then what changes in it, five times a second at most."""
    feed: EventFeed = request.app.state.live.events
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    return EventStream(feed.events(last_event_id), headers=headers)
