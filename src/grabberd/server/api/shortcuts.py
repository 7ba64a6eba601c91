"""Shortcuts: the requests that come most often are answered without being routed."""

from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from grabberd.errors import GrabberdError
from grabberd.server.api.guard.origins import UNSAFE
from grabberd.server.api.guard.roles import is_declared
from grabberd.server.api.snapshots import Snapshot, Snapshots

Give = Callable[[], Awaitable[Snapshot | None]]


class Shortcuts:
    """Answers requests for snapshots, which the gate has admitted; all others pass.

    To find a route, to call its dependencies and to make its response takes FastAPI longer than all the rest
    of such a request. The routes are there nevertheless: they describe it, and say why there is no snapshot.

    Args:
        app: The application with the routes.
        snapshots: The snapshots; they are told when a client may have changed something.
    """

    def __init__(self, app: ASGIApp, snapshots: Snapshots) -> None:
        self._app = app
        self._snapshots = snapshots
        self._given: Mapping[str, Give] = {
            path: give for path, give in snapshots.shortcuts().items() if is_declared("GET", path)
        }

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serves one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
        elif scope["method"] in UNSAFE:
            await self._change(scope, receive, send)
        else:
            give = self._given.get(scope["path"]) if scope["method"] == "GET" else None
            snapshot = None if give is None else await _given(give)
            if snapshot is None:
                await self._app(scope, receive, send)
            else:
                response = snapshot.response(Headers(scope=scope).get("if-none-match"))
                await response(scope, receive, send)

    async def _change(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def send_after(message: Message) -> None:
            self._snapshots.changed()  # before the client knows, or it would be told what was before
            await send(message)

        try:
            await self._app(scope, receive, send_after)
        finally:
            self._snapshots.changed()


async def _given(give: Give) -> Snapshot | None:
    with suppress(GrabberdError):
        return await give()
    return None
