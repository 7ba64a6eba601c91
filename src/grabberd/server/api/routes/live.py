"""Live data: the state as server-sent events, the newest field as a picture, fields over WebSockets."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Annotated, TypeVar

from fastapi import APIRouter, Depends, Header, Query, Response, WebSocket
from fastapi.requests import HTTPConnection
from starlette.websockets import WebSocketDisconnect

from grabberd.documents.points_frame import PROTOCOL as POINTS_PROTOCOL
from grabberd.server.api.guard.limits import OneStream
from grabberd.server.api.responses import RenderedRoute
from grabberd.server.api.routes.dependencies import PROBLEMS
from grabberd.server.api.streams.broadcast import Channel
from grabberd.server.api.streams.feeds import EventStream, Feeds, PointsMessage
from grabberd.server.api.streams.preview import PreviewClient

T = TypeVar("T")

PATIENCE_S = 60.0
GOING_AWAY = 1001
"""Close code of a server that is shutting down (RFC 6455, 7.4.1)."""


async def _feeds(connection: HTTPConnection) -> Feeds:
    return connection.app.state.feeds


FeedsOf = Annotated[Feeds, Depends(_feeds)]

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
    feeds: FeedsOf,
    _: OneStream,
    last_event_id: Annotated[
        str | None, Header(max_length=80, description="`id` of the last event that was received.")
    ] = None,
) -> EventStream:
    """Server-sent events: the state, then its changes, at most five times a second."""
    # Otherwise nginx would buffer events until its buffer is full.
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    return EventStream(feeds.events.events(last_event_id), headers=headers)


@router.get(
    "/preview.png",
    response_class=Response,
    responses={**PROBLEMS, 200: {"content": {"image/png": {}}}},
    summary="Get the newest field as a picture",
)
def get_preview_png(feeds: FeedsOf, device: DeviceOf = None) -> Response:
    """The newest field in 8 bits, with its lines as recorded. Updated at most five times a second."""
    png = feeds.of(device).picture.png()
    return Response(png, media_type="image/png", headers={"Cache-Control": "no-store"})


@router.websocket("/preview")
async def preview(socket: WebSocket, feeds: FeedsOf, _: OneStream, device: DeviceOf = None) -> None:
    """Binary messages of a device's newest field: header, centroids, its picture, points."""
    feed = feeds.of(device).preview
    await socket.accept()
    client = PreviewClient(socket, feed)
    await _first_to_end(client.hear(), _close_after(client.send(), socket))


@router.websocket("/points/stream")
async def stream_points(socket: WebSocket, feeds: FeedsOf, _: OneStream, device: DeviceOf = None) -> None:
    """Binary messages of every field's points, and a description in JSON before the first that needs it."""
    feed = feeds.of(device).points
    offered = socket.scope.get("subprotocols", ())
    await socket.accept(POINTS_PROTOCOL if POINTS_PROTOCOL in offered else None)
    described = 0

    async def send(message: PointsMessage) -> None:
        nonlocal described
        if message.number != described:
            described = message.number
            await socket.send_text(message.description)
        await socket.send_bytes(message.content)

    await _first_to_end(_until_gone(socket), _send(socket, feed, send))


@router.websocket("/curves/stream")
async def stream_curves(socket: WebSocket, feeds: FeedsOf, _: OneStream, device: DeviceOf = None) -> None:
    """The wall's width and the vacuum of the last second in JSON, five times a second."""
    broadcast = feeds.of(device).curves
    await socket.accept()
    await _first_to_end(_until_gone(socket), _send(socket, broadcast, socket.send_text))


async def _send(socket: WebSocket, channel: Channel[T], send: Callable[[T], Awaitable[None]]) -> None:
    """Sends messages as fast as the client reads them; gives up if it does not read."""
    timeout_s = socket.app.state.front.limits.write_timeout_s
    with channel.listening() as listener:
        while not channel.closed:
            message = await listener.next(PATIENCE_S)
            if message is not None:
                async with asyncio.timeout(timeout_s):
                    await send(message)
    await socket.close(GOING_AWAY)


async def _close_after(sending: Awaitable[None], socket: WebSocket) -> None:
    """Closes the WebSocket once the daemon has ended the stream."""
    await sending
    await socket.close(GOING_AWAY)


async def _until_gone(socket: WebSocket) -> None:
    """Waits until the client has disconnected; ignores anything it sends."""
    # A closed connection is noticed only by receiving: while there is nothing to send, no send can fail.
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
