"""Several captures at once: annotate, delete, analyse, take home."""

from collections.abc import Generator
from typing import Annotated, Any, cast

from fastapi import APIRouter, Query, status
from fastapi.responses import StreamingResponse

from grabberd.archive.catalogue.batches import for_each
from grabberd.archive.catalogue.capture_zip import captures_zip
from grabberd.documents.capture_library import (
    MOST_AT_ONCE,
    BatchDocument,
    CaptureSelection,
    CapturesPatch,
)
from grabberd.documents.requests import AnalysisRequest, CaptureName
from grabberd.server.api.idempotency import TAKES_KEY, OnceRoute
from grabberd.server.api.reading.readings import reads
from grabberd.server.api.routes.capture_filter import Zone, zone_of
from grabberd.server.api.routes.dependencies import PROBLEMS, ServiceOf
from grabberd.server.api.streams.downloads import Download, download
from grabberd_liner.analyses.routes import queue_analysis

router = APIRouter(prefix="/captures", tags=["captures"], responses=PROBLEMS, route_class=OnceRoute)
_WITH_PROFILES = AnalysisRequest(profiles=True)


@router.patch("", summary="Pin or annotate several captures")
def patch_captures(patch: CapturesPatch, service: ServiceOf) -> BatchDocument:
    """Change notes, labels or pins of up to a hundred captures; those that fail are named with the reason."""

    def annotate(capture_id: str) -> None:
        service.annotations.annotate(capture_id, pinned=patch.pinned, note=patch.note, labels=patch.labels)

    return for_each(patch.captures, annotate)


@router.post("/deletion", summary="Delete several captures")
def delete_captures(selection: CaptureSelection, service: ServiceOf) -> BatchDocument:
    """Delete up to a hundred captures and their files permanently. Those that are armed, running, pinned or
    used by a job stay, and are named with the reason.
    """
    return for_each(selection.captures, service.annotations.delete)


@router.post(
    "/analysis",
    status_code=status.HTTP_202_ACCEPTED,
    dependencies=[TAKES_KEY],
    summary="Analyse several captures",
)
def analyse_captures(selection: CaptureSelection, service: ServiceOf) -> BatchDocument:
    """Queue an analysis of each of up to a hundred captures, with the inputs that the profiles of its labels
    give.
    """
    return for_each(selection.captures, lambda one: queue_analysis(service, one, _WITH_PROFILES).id)


@router.get(
    ".zip",
    response_class=StreamingResponse,
    summary="Download several captures",
    responses={200: {"content": {"application/zip": {}}}},
)
@reads
def get_captures_zip(
    service: ServiceOf,
    capture: Annotated[
        list[CaptureName],
        Query(min_length=1, max_length=MOST_AT_ONCE, description="Id of a capture; can be given repeatedly."),
    ],
    zone: Zone = "UTC",
) -> Download:
    """The files of up to a hundred captures in one ZIP file, named by time and labels, with a table of all.
    It is created while it is sent. Files that could not be sent completely are listed in `MISSING.txt`
    inside.
    """
    pieces = captures_zip(service.archive, capture, zone_of(zone))
    return download(cast("Generator[Any, None, None]", pieces), "application/zip", "captures.zip")
