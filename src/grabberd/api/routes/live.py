"""Live data: the state as server-sent events, the newest field as a picture and over a WebSocket."""

import asyncio
from typing import Annotated

from fastapi import APIRouter, Header, Query, Request, Response, WebSocket
from starlette.websockets import WebSocketDisconnect

from grabberd.api.guard.stream_limit import OneStream
from grabberd.api.rendering import RenderedRoute
from grabberd.api.routes.dependencies import PROBLEMS, ServiceOf
from grabberd.api.streams.broadcast import Broadcast
from grabberd.api.streams.events import EventStream
from grabberd.api.streams.feeds import Feeds

PATIENCE_S = 60.0
GOING_AWAY = 1001
"""Close code of a server that goes down (RFC 6455, 7.4.1)."""

router = APIRouter(tags=["live"], route_class=RenderedRoute)

DeviceOf = Annotated[
    str | None, Query(max_length=32, description="Name of the device; not needed if there is only one.")
]


@router.get(
    "/events",
    response_class=EventStream,
    summary="Follow the state",
    responses={200: {"description": "`state` first, then `change`.", "content": {"text/event-stream": {}}}},
)
async def get_events(
    request: Request,
    _: OneStream,
    last_event_id: Annotated[
        str | None, Header(max_length=80, description="`id` of the last event that was received.")
    ] = None,
) -> EventStream:
    """Server-sent events: the state, then its changes, at most five times a second."""
    feeds: Feeds = request.app.state.feeds
    # nginx would otherwise hold events back until its buffer is full.
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    return EventStream(feeds.events.events(last_event_id), headers=headers)


@router.get(
    "/preview.png",
    response_class=Response,
    responses={**PROBLEMS, 200: {"content": {"image/png": {}}}},
    summary="Get the newest field as a picture",
)
def get_preview_png(service: ServiceOf, request: Request, device: DeviceOf = None) -> Response:
    """The newest field in 8 bits, with its lines as recorded. A new one at most five times a second."""
    feeds: Feeds = request.app.state.feeds
    png = feeds.pictures[service.instrument(device).name].png()
    return Response(png, media_type="image/png", headers={"Cache-Control": "no-store"})


@router.websocket("/preview")
async def preview(socket: WebSocket, _: OneStream, device: DeviceOf = None) -> None:
    """Binary messages of a device's newest field: header, centroids, packed bits."""
    feeds: Feeds = socket.app.state.feeds
    broadcast = feeds.preview(device)
    await socket.accept()
    timeout_s = socket.app.state.front.limits.write_timeout_s
    await _first_to_end(_until_gone(socket), _send(socket, broadcast, timeout_s))


async def _send(socket: WebSocket, broadcast: Broadcast[bytes], timeout_s: float) -> None:
    """Sends the newest message as fast as the client reads; gives up on a client that does not read."""
    with broadcast.listening() as listener:
        while not broadcast.closed:
            message = await listener.next(PATIENCE_S)
            if message is not None:
                async with asyncio.timeout(timeout_s):
                    await socket.send_bytes(message)
    await socket.close(GOING_AWAY)


async def _until_gone(socket: WebSocket) -> None:
    """Waits until the client has gone; anything it sends is ignored."""
    # A closed connection is noticed only by receiving: while there is nothing to send, no send fails.
    while (await socket.receive())["type"] != "websocket.disconnect":
        pass


async def _first_to_end(*works: object) -> None:
    tasks = [asyncio.ensure_future(work) for work in works]  # type: ignore[call-overload]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            if not isinstance(task.exception(), TimeoutError | WebSocketDisconnect):
                task.result()
    finally:
        for task in tasks:
            task.cancel()
