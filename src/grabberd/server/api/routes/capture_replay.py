"""Stretches of a capture for its replay: points and pictures of consecutive fields."""

from functools import partial
from typing import Annotated

from fastapi import APIRouter, Query, Response

from grabberd.archive.export.replay_stretches import (
    MOST_PICTURES,
    MOST_POINT_FIELDS,
    Stretch,
    replay_pictures,
    replay_points,
)
from grabberd.server.api.reading.contents import Content
from grabberd.server.api.reading.readings import reads
from grabberd.server.api.rendering import RenderedRoute
from grabberd.server.api.routes.capture_contents import FIELD_END, RunNumber
from grabberd.server.api.routes.dependencies import OF_A_FILE, CaptureId, ServiceOf

router = APIRouter(prefix="/captures", tags=["captures"], responses=OF_A_FILE, route_class=RenderedRoute)

BINARY = "application/octet-stream"
FirstField = Annotated[int, Query(ge=0, le=FIELD_END, description="First field.")]
_binary = partial(Response, media_type=BINARY)


@router.get(
    "/{capture_id}/replay/points",
    response_class=Response,
    summary="Get points of a stretch for replay",
    responses={200: {"content": {BINARY: {}}}},
)
@reads
def get_replay_points(
    capture_id: CaptureId,
    service: ServiceOf,
    first_n: FirstField = 0,
    count: Annotated[
        int, Query(ge=1, le=MOST_POINT_FIELDS, description="Number of fields, those without points included.")
    ] = 50,
    run: RunNumber = None,
) -> Content:
    """The points of consecutive fields with their images and residuals, as one binary message."""
    stretch = Stretch(first_n, first_n + count)
    return Content(replay_points, (service.archive.path(capture_id), run, stretch), _binary)


@router.get(
    "/{capture_id}/replay/pictures",
    response_class=Response,
    summary="Get pictures of a stretch for replay",
    responses={200: {"content": {BINARY: {}}}},
)
@reads
def get_replay_pictures(
    capture_id: CaptureId,
    service: ServiceOf,
    first_n: FirstField = 0,
    count: Annotated[
        int, Query(ge=1, le=MOST_PICTURES, description="Number of fields, lost ones included.")
    ] = 25,
) -> Content:
    """The pictures of consecutive fields as recorded, as one binary message."""
    stretch = Stretch(first_n, first_n + count)
    return Content(replay_pictures, (service.archive.path(capture_id), stretch), _binary)
