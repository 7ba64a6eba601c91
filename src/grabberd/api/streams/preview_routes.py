"""The newest field for the eye: a WebSocket of small binary messages, and a picture."""

import asyncio
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response, WebSocket
from starlette.websockets import WebSocketDisconnect

from grabberd.api.guard.limits import OneStream
from grabberd.api.routes.dependencies import PROBLEMS, ServiceOf
from grabberd.api.streams.broadcast import Broadcast
from grabberd.api.streams.feeds import Live

PATIENCE_S = 60.0
GOING_AWAY = 1001

router = APIRouter(tags=["live"])

DeviceOf = Annotated[str | None, Query(max_length=32, description="Name of the device; not needed for one.")]


@router.get(
    "/preview.png",
    response_class=Response,
    responses={**PROBLEMS, 200: {"content": {"image/png": {}}}},
    summary="The newest field as a picture",
)
def get_preview_png(service: ServiceOf, request: Request, device: DeviceOf = None) -> Response:
    """The newest field in 8 bits, its lines as they came; a new one five times a second at most."""
    live: Live = request.app.state.live
    png = live.pictures[service.instrument(device).name].png()
    return Response(png, media_type="image/png", headers={"Cache-Control": "no-store"})


@router.websocket("/preview")
async def preview(socket: WebSocket, _: OneStream, device: DeviceOf = None) -> None:
    """Binary messages of a device's newest field: header, centroids, packed bits."""
    live: Live = socket.app.state.live
    broadcast = live.preview(device)
    await socket.accept()
    timeout_s = socket.app.state.front.limits.write_timeout_s
    await _first_to_end(_until_gone(socket), _send(socket, broadcast, timeout_s))


async def _send(socket: WebSocket, broadcast: Broadcast[bytes], timeout_s: float) -> None:
    """Sends the newest as often as the client takes it; gives up one that takes nothing."""
    with broadcast.listening() as listener:
        while not broadcast.closed:
            message = await listener.next(PATIENCE_S)
            if message is not None:
                async with asyncio.timeout(timeout_s):
                    await socket.send_bytes(message)
    await socket.close(GOING_AWAY)


async def _until_gone(socket: WebSocket) -> None:
    """A client has nothing to say here; what it says all the same is not heard."""
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
