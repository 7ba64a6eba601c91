"""Snapshots: documents that are made once for all concurrent requests.

`Shortcuts` answers the most frequent requests from them, without routing.
"""

import asyncio
import time
from collections.abc import Awaitable, Callable, Hashable, Mapping
from contextlib import suppress
from typing import NamedTuple

from fastapi.responses import Response
from pydantic import BaseModel
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from grabberd import __version__
from grabberd.documents.state import HealthDocument
from grabberd.errors import GrabberdError
from grabberd.instrument.device.worker import Live
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.live.field_streams import newest_points
from grabberd.instrument.live.state import revision_of
from grabberd.server.api.guard.authentication import is_declared
from grabberd.server.api.guard.front import UNSAFE
from grabberd.server.api.responses import JSON, etag_of, tagged
from grabberd.server.daemon.service import Service

STATE_S = 0.2
"""Age up to which the state is shared if only numbers can have changed; also the interval of events."""


class Snapshot(NamedTuple):
    """A document as JSON, and its ETag."""

    content: bytes
    etag: str

    @classmethod
    def of(cls, document: BaseModel) -> "Snapshot":
        """The snapshot of a document."""
        content = document.model_dump_json(by_alias=True).encode()
        return cls(content, etag_of(content))

    def response(self, if_none_match: str | None) -> Response:
        """The document, or 304 if the client has it."""
        return tagged(self.content, JSON, if_none_match, etag=self.etag)


class _Making(NamedTuple):
    """A snapshot of a revision, finished or being made."""

    revision: Hashable
    until_s: float
    task: "asyncio.Task[Snapshot]"


class Shared:
    """A snapshot made in a thread: once for each revision, and again when it has expired.

    Used within one event loop.

    Args:
        make: Makes the document; called in a thread of the server's pool.
        revision: Returns, without blocking, a value that changes with everything that must not be missed.
        life_s: Age up to which it is shared.
        now_s: Source of monotonic time.
    """

    def __init__(
        self,
        make: Callable[[], BaseModel],
        revision: Callable[[], Hashable],
        life_s: float,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._make = make
        self._revision = revision
        self._life_s = life_s
        self._now_s = now_s
        self._newest: _Making | None = None

    async def get(self) -> Snapshot:
        """The snapshot; waits for the one that is being made, if any."""
        revision, now_s = self._revision(), self._now_s()
        newest = self._newest
        if newest is None or newest.revision != revision or now_s >= newest.until_s or _failed(newest.task):
            task = asyncio.create_task(run_in_threadpool(self._snapshot))
            self._newest = newest = _Making(revision, now_s + self._life_s, task)
        # Shielded: a client that disconnects must not cancel it for the others.
        return newest.task.result() if newest.task.done() else await asyncio.shield(newest.task)

    def _snapshot(self) -> Snapshot:
        return Snapshot.of(self._make())


def _failed(task: "asyncio.Task[Snapshot]") -> bool:
    return task.done() and (task.cancelled() or task.exception() is not None)


class NewestPointsSnapshot:
    """The points of a device's newest field, made once a field; used within one event loop."""

    def __init__(self, instrument: Instrument, service: Service) -> None:
        self._instrument = instrument
        self._service = service
        self._of: Live | None = None
        self._snapshot: Snapshot | None = None

    async def get(self) -> Snapshot:
        """The snapshot of the newest field.

        Raises:
            NotReady: The device has not measured a field yet.
        """
        live = self._instrument.worker.live
        if self._snapshot is None or live is None or live is not self._of:
            self._snapshot = Snapshot.of(newest_points(self._instrument, self._service.clock))
            self._of = live
        return self._snapshot


class Snapshots:
    """The snapshots of a service.

    Attributes:
        state: The state at a glance.
        points: Points of the newest field, by device.
    """

    def __init__(self, service: Service) -> None:
        self._service = service
        self._changes = 0
        self.state = Shared(service.state, self._revision, STATE_S)
        self.points = {name: NewestPointsSnapshot(one, service) for name, one in service.instruments.items()}

    def changed(self) -> None:
        """Invalidates the state: a client may have changed something, which the next answer must contain."""
        self._changes += 1

    def shortcuts(self) -> Mapping[str, Callable[[], Awaitable[Snapshot | None]]]:
        """Sources of the most frequently requested snapshots, by path."""
        points = {f"/api/v1/devices/{name}/points": one.get for name, one in self.points.items()}
        return {
            "/api/v1/state": self.state.get,
            "/api/v1/settings": self.settings,
            "/healthz": self.health,
            **points,
        }

    async def settings(self) -> Snapshot:
        """The settings in force."""
        return Snapshot.of(self._service.settings.document())

    async def health(self) -> Snapshot | None:
        """The health document; None if a capture thread is stuck."""
        return Snapshot.of(HealthDocument(version=__version__)) if self._service.liveness.is_well else None

    def _revision(self) -> Hashable:
        service = self._service
        return self._changes, revision_of(service.instruments.values(), service.faults.now)


Give = Callable[[], Awaitable[Snapshot | None]]


class Shortcuts:
    """Answers requests for snapshots that the gate has admitted; passes all others on.

    Routing, dependencies and rendering in FastAPI would take longer than all the rest of such a request. The
    routes exist as well: they are part of the description, and report why there is no snapshot.

    Args:
        app: The application with the routes.
        snapshots: The snapshots, which are invalidated when a client may have changed something.
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
            self._snapshots.changed()  # before the client gets its answer, or it could read the old state
            await send(message)

        try:
            await self._app(scope, receive, send_after)
        finally:
            self._snapshots.changed()


async def _given(give: Give) -> Snapshot | None:
    with suppress(GrabberdError):
        return await give()
    return None
