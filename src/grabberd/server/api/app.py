"""The application: every route, the error handlers, and the lifespan of the service."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from weakref import WeakValueDictionary

from fastapi import Depends, FastAPI
from fastapi.routing import APIRoute
from starlette.concurrency import run_in_threadpool

from grabberd import __version__
from grabberd.extension import extensions, in_order, load
from grabberd.server.api import problems
from grabberd.server.api.answers import AnswerMemory
from grabberd.server.api.contents import Contents
from grabberd.server.api.guard.authentication import Attempts, Authenticator, check_declared
from grabberd.server.api.guard.front import Front
from grabberd.server.api.guard.gate import Gate, HeadAsGet
from grabberd.server.api.guard.limits import Streams
from grabberd.server.api.openapi import describe
from grabberd.server.api.readings import Readings
from grabberd.server.api.routes import (
    calibrations,
    capture_contents,
    captures,
    devices,
    jobs,
    live,
    metrics,
    page,
    system,
)
from grabberd.server.api.routes.dependencies import KeptSince
from grabberd.server.api.snapshots import Shortcuts, Snapshots
from grabberd.server.api.streams.feeds import Feeds
from grabberd.server.daemon.service import Service
from grabberd.server.web import Files, Site

VERSIONED = {
    "captures": captures.router,
    "capture_zip": captures.zip_router,
    "capture_groups": captures.group_router,
    "capture_contents": capture_contents.router,
    "calibrations": calibrations.router,
    "jobs": jobs.router,
    "sessions": page.session_router,
    "live": live.router,
    "settings": system.settings_router,
    "devices": devices.router,
}
"""Routes under /api/v1; extensions insert theirs between them."""


def create_app(service: Service, front: Front | None = None) -> FastAPI:
    """The application over a service, which it starts and stops.

    Args:
        service: The service that the routes call.
        front: How clients reach the daemon; default: on a loopback address.
    """
    front = front or Front()
    app = FastAPI(
        title="grabberd",
        version=__version__,
        description="A 50 Hz three-dimensional measuring instrument.",
        openapi_url="/api/v1/openapi.json",
        docs_url=None,
        redoc_url=None,
        lifespan=_life,
        generate_unique_id_function=_name_of,
        dependencies=[Depends(check_declared)],
    )
    app.state.service = service
    app.state.front = front
    app.state.once = WeakValueDictionary()
    app.state.kept_since = KeptSince(service.clock)
    app.state.streams = streams = Streams(front.limits)
    app.state.metrics = metrics.registry_of(service, lambda: streams.count)
    app.state.feeds = Feeds(service)
    app.state.readings = Readings(front.limits)
    app.state.answers = answers = AnswerMemory()
    app.state.contents = Contents(front.limits, memory=answers)
    problems.install(app)
    app.state.files = Files()
    app.state.site = Site()
    app.state.authenticator = authenticator = Authenticator(service.access, front.private, Attempts())
    app.state.snapshots = snapshots = Snapshots(service)
    app.add_middleware(Shortcuts, snapshots=snapshots)
    app.add_middleware(HeadAsGet)
    app.add_middleware(Gate, front=front, authenticator=authenticator)
    added = [place for one in extensions() for place in one.routes]
    for router in in_order(VERSIONED.items(), added).values():
        app.include_router(load(router) if isinstance(router, str) else router, prefix="/api/v1")
    for router in (devices.check_router, system.router, metrics.router, page.router):
        app.include_router(router)
    describe(app)
    return app


@asynccontextmanager
async def _life(app: FastAPI) -> AsyncIterator[None]:
    service: Service = app.state.service
    await run_in_threadpool(service.start)
    yield
    try:
        app.state.readings.close()
        await app.state.contents.close()
    finally:
        await run_in_threadpool(service.stop)


def _name_of(route: APIRoute) -> str:
    return route.name
