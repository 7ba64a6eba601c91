"""Several captures at once: take home."""

from collections.abc import Generator
from typing import Annotated, Any, cast

from fastapi import APIRouter, Query
from fastapi.responses import StreamingResponse

from grabberd.archive.catalogue.capture_zip import captures_zip
from grabberd.documents.capture_library import MOST_AT_ONCE
from grabberd.documents.requests import CaptureName
from grabberd.server.api.reading.readings import reads
from grabberd.server.api.rendering import RenderedRoute
from grabberd.server.api.routes.capture_filter import Zone, zone_of
from grabberd.server.api.routes.dependencies import PROBLEMS, ServiceOf
from grabberd.server.api.streams.downloads import Download, download

router = APIRouter(prefix="/captures", tags=["captures"], responses=PROBLEMS, route_class=RenderedRoute)


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
