"""The daemon itself: state, health, diagnostics, the API's own page, settings and configuration."""

from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import HTMLResponse

from grabberd import __version__
from grabberd.documents.document import JsonObject
from grabberd.documents.requests import SettingsRequest
from grabberd.documents.state import HealthDocument, SettingsDocument, StateDocument
from grabberd.server.api.openapi import POLICY, page
from grabberd.server.api.problems import problem
from grabberd.server.api.readings import reads
from grabberd.server.api.responses import NOT_MODIFIED, IfNoneMatch, RenderedRoute
from grabberd.server.api.routes.dependencies import BUSY, PROBLEMS, ServiceOf, SnapshotsOf
from grabberd.server.daemon.diagnostics import bundle, daemon_parts

router = APIRouter(tags=["system"], route_class=RenderedRoute)

ZIP = "application/zip"


@router.get(
    "/api/v1/state",
    response_class=Response,
    responses={200: {"model": StateDocument}, **NOT_MODIFIED},
    summary="Get the state at a glance",
)
async def get_state(snapshots: SnapshotsOf, if_none_match: IfNoneMatch = None) -> Response:
    """State at a glance: devices, rings, newest points, storage. Its numbers are at most a fifth of a second
    old; changes made by a request are included once that request has been answered.
    """
    return (await snapshots.state.get()).response(if_none_match)


@router.get("/healthz", response_model=HealthDocument, summary="Check that the daemon serves", responses=BUSY)
async def get_health(service: ServiceOf) -> HealthDocument | Response:
    """The daemon is serving, whatever its devices do. 503 if a capture thread hangs: restart the daemon."""
    if service.liveness.is_well:
        return HealthDocument(version=__version__)
    detail = f"the capture thread of {' and '.join(service.liveness.silent)} does not answer"
    return problem(503, "stuck", detail, "restart the daemon; a capture that it records is kept")


@router.get(
    "/api/v1/diagnostics",
    response_class=Response,
    responses={200: {"content": {ZIP: {}}}, **BUSY},
    summary="Get diagnostics for support",
)
@reads
def get_diagnostics(
    service: ServiceOf,
    words: Annotated[bool, Query(description="Include labels, notes and the site's name.")] = False,
) -> Response:
    """One ZIP file for support: versions, grabbers, configuration without secrets, devices, captures with
    their ledgers, jobs, the last lines of the log. No pictures, tokens or certificates.
    """
    headers = {
        "Content-Disposition": 'attachment; filename="grabberd-diagnostics.zip"',
        "Cache-Control": "no-store",
    }
    return Response(bundle(daemon_parts(service, words=words), words=words), media_type=ZIP, headers=headers)


@router.get(
    "/api/v1/docs", response_class=HTMLResponse, summary="Read the API description as a page", responses=BUSY
)
@reads
def get_docs(request: Request) -> HTMLResponse:
    """This description as a page; it loads nothing from other hosts."""
    return HTMLResponse(page(request.app.openapi()), headers={"Content-Security-Policy": POLICY})


settings_router = APIRouter(tags=["settings"], route_class=RenderedRoute)


@settings_router.get("/settings", summary="Get the settings")
def get_settings(service: ServiceOf) -> SettingsDocument:
    """The active settings: those of the configuration, or those set in their place."""
    return service.settings.document()


@settings_router.put("/settings", responses=PROBLEMS, summary="Set the threshold")
def put_settings(new: SettingsRequest, service: ServiceOf) -> SettingsDocument:
    """Set how a device's threshold is determined. The setting survives restarts; 409 during a capture."""
    service.settings.set_threshold(service.instrument(new.device), new.threshold)
    return service.settings.document()


@settings_router.get("/config", response_model=JsonObject, summary="Get the configuration")
def get_config(service: ServiceOf) -> object:
    """The configuration as it was read, without secrets."""
    return service.configuration
