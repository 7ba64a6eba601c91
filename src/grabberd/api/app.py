"""The application: every route, the error handlers, and the service's life."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import APIRouter, FastAPI
from fastapi.routing import APIRoute
from starlette.concurrency import run_in_threadpool

from grabberd import __version__
from grabberd.api import calibrations, captures, jobs, problems, system
from grabberd.service.service import Service


def create_app(service: Service) -> FastAPI:
    """An application over a service, which it starts and stops."""
    app = FastAPI(
        title="grabberd",
        version=__version__,
        description="A 50 Hz three-dimensional measuring instrument.",
        openapi_url="/api/v1/openapi.json",
        docs_url=None,
        redoc_url=None,
        lifespan=_life,
        generate_unique_id_function=_name_of,
    )
    app.state.service = service
    problems.install(app)
    v1 = APIRouter(prefix="/api/v1")
    for part in (captures, calibrations, jobs):
        v1.include_router(part.router)
    app.include_router(v1)
    app.include_router(system.router)
    return app


@asynccontextmanager
async def _life(app: FastAPI) -> AsyncIterator[None]:
    service: Service = app.state.service
    await run_in_threadpool(service.start)
    yield
    await run_in_threadpool(service.stop)


def _name_of(route: APIRoute) -> str:
    return route.name
