"""Contents of a capture: its file, its runs and points, its fields, and stretches of both for its replay."""

from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Path, Query, Response, status
from fastapi.responses import FileResponse, StreamingResponse
from pydantic import BaseModel

from grabberd.archive.capture.reader import stat_at_rest
from grabberd.archive.capture_contents import mat_stream, parquet_stream
from grabberd.archive.catalogue.capture_documents import ledger_json, run_json
from grabberd.archive.export.c3d_file import points_c3d
from grabberd.archive.export.channels_export import channels_csv
from grabberd.archive.export.field_pictures import field_png, thumbnail_png
from grabberd.archive.export.page_documents import (
    MOST_PICTURES,
    MOST_POINT_FIELDS,
    PointsQuery,
    Stretch,
    channels_json,
    points_json,
    replay_pictures,
    replay_points,
)
from grabberd.archive.export.points_export import points_csv, points_ply
from grabberd.archive.export.table_files import DIALECTS
from grabberd.documents.captures import LedgerPage, WholeRunDocument, WidthCourse
from grabberd.documents.channels import CaptureChannelsDocument
from grabberd.documents.points_frame import PointsDocument
from grabberd.documents.problems import Problem
from grabberd.server.api.contents import Content
from grabberd.server.api.readings import reads
from grabberd.server.api.responses import (
    IMMUTABLE,
    JSON,
    NOT_MODIFIED,
    REVALIDATE,
    IfNoneMatch,
    RenderedRoute,
    Responses,
    is_known,
    tagged,
)
from grabberd.server.api.routes.dependencies import OF_A_FILE, CaptureId, Cursor, Limit, ServiceOf
from grabberd.server.api.streams.downloads import Download, WholeFile, download

router = APIRouter(prefix="/captures", tags=["captures"], responses=OF_A_FILE, route_class=RenderedRoute)

FIELD_END = 2**53
POINT_BYTES, READING_BYTES = 260, 100
"""Memory for a point, and for a reading of all channels, as JSON."""
SQLITE = "application/vnd.sqlite3"
PLY = "application/ply"
PARQUET = "application/vnd.apache.parquet"
MAT = "application/x-matlab-data"
C3D = "application/octet-stream"
"""Nobody has registered a type for it."""

RunNumber = Annotated[
    int | None, Query(ge=1, le=2**53, description="Number of the run; default: the latest completed one.")
]
CsvSeparator = Annotated[
    Literal["comma", "semicolon"],
    Query(
        description="Separator of the cells; with semicolons, numbers have decimal commas, as spreadsheet "
        "programs in many languages expect."
    ),
]
PlyField = Annotated[
    int | None, Query(ge=0, le=FIELD_END, description="Only the points of this field; default: all.")
]
FieldNumber = Annotated[int, Path(ge=0, le=FIELD_END, description="Number of the field.")]


def _content(
    path: str,
    summary: str,
    content: str | type[BaseModel],
    further: Responses | None = None,
    *,
    streamed: bool = False,
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Decorator for a route that reads a capture's file.

    Args:
        path: Path below that of the capture.
        summary: Summary for the API's description.
        content: Media type of the response, or the model of its JSON document.
        further: Further responses.
        streamed: True if the response is sent in pieces.
    """
    answer: dict[str, Any] = {"content": {content: {}}} if isinstance(content, str) else {"model": content}
    route = router.get(
        f"/{{capture_id}}/{path}",
        response_class=StreamingResponse if streamed else Response,
        summary=summary,
        responses={200: answer, **(further or {})},
    )
    return lambda endpoint: route(reads(endpoint))


@router.get(
    "/{capture_id}/file",
    response_class=FileResponse,
    summary="Download a capture",
    responses={
        200: {"content": {SQLITE: {}}},
        206: {"description": "The requested range.", "content": {SQLITE: {}}},
        **NOT_MODIFIED,
        416: {"description": "The range lies outside the file.", "content": {"text/plain": {}}},
    },
)
@reads
def get_capture_file(
    capture_id: CaptureId, service: ServiceOf, if_none_match: IfNoneMatch = None
) -> Response:
    """The whole sealed capture: one SQLite file. Range requests are supported. Adding a run changes the ETag,
    and aborts a download in progress.
    """
    path = service.archive.sealed_path(capture_id)
    headers = {"Cache-Control": REVALIDATE}
    answer = WholeFile(path, 200, headers, SQLITE, filename=path.name, stat_result=stat_at_rest(path))
    if is_known(answer.headers["etag"], if_none_match):
        known = {**headers, "ETag": answer.headers["etag"]}
        return Response(status_code=status.HTTP_304_NOT_MODIFIED, headers=known)
    return answer


@_content("ledger", "Get the ledger, page by page", LedgerPage)
def get_ledger(
    capture_id: CaptureId, service: ServiceOf, limit: Limit = 100, cursor: Cursor = None
) -> Content:
    """The entries of all fields that were not received intact, and all events, in the order of the fields; of
    a running capture, those on the disk.
    """
    return Content(ledger_json, (service.archive.path(capture_id), cursor, limit), media_type=JSON)


@_content("runs/{run}", "Look up a run", WholeRunDocument)
def get_run(
    capture_id: CaptureId,
    run: Annotated[int, Path(ge=1, le=2**53, description="Number of the run.")],
    service: ServiceOf,
) -> Content:
    """A run with the calibration, the object model and the settings that its points were measured with."""
    return Content(run_json, (service.archive.path(capture_id), run), media_type=JSON, weight=4 << 20)


@_content("points", "Get points as JSON, thinned out", PointsDocument)
def get_points(
    capture_id: CaptureId,
    service: ServiceOf,
    run: RunNumber = None,
    first_n: Annotated[int, Query(ge=0, le=FIELD_END, description="First field.")] = 0,
    end_n: Annotated[int, Query(ge=0, le=FIELD_END, description="Field after the last one.")] = FIELD_END,
    every: Annotated[
        int,
        Query(
            ge=1,
            le=1_000_000,
            description="Only fields whose number is a multiple of this; odd: fields of both parities.",
        ),
    ] = 1,
    max_points: Annotated[
        int,
        Query(
            ge=1000, le=200_000, description="Maximum number of points; `every` is raised to stay below it."
        ),
    ] = 20_000,
    target: Annotated[
        list[Annotated[int, Query(ge=0, le=2**31 - 1)]] | None,
        Query(max_length=1000, description="Only this target; can be given several times."),
    ] = None,
) -> Content:
    """The points of a run, field by field, with their standard deviations."""
    query = PointsQuery(run, first_n, end_n, every, max_points, target or ())
    arguments = service.archive.path(capture_id), query
    return Content(points_json, arguments, media_type=JSON, weight=max_points * POINT_BYTES)


@_content("points.csv", "Get points as CSV", "text/csv", streamed=True)
def get_points_csv(
    capture_id: CaptureId, service: ServiceOf, run: RunNumber = None, separator: CsvSeparator = "comma"
) -> Content:
    """The points as CSV, a row for each target and field, with their standard deviations."""
    arguments = service.archive.path(capture_id), run, None, DIALECTS[separator]
    return Content(points_csv, arguments, media_type="text/csv", name=f"{capture_id}-points.csv")


@_content("points.ply", "Get points as a PLY cloud", PLY, streamed=True)
def get_points_ply(
    capture_id: CaptureId, service: ServiceOf, run: RunNumber = None, field: PlyField = None
) -> Content:
    """The points of all fields or of one field as a point cloud: x, y, z in mm, with field number, target and
    standard deviations as further properties.
    """
    arguments = service.archive.path(capture_id), run, field
    suffix = "points" if field is None else f"field-{field:08d}"
    return Content(points_ply, arguments, media_type=PLY, name=f"{capture_id}-{suffix}.ply")


@_content("points.parquet", "Get points as Parquet", PARQUET, {501: {"model": Problem}}, streamed=True)
def get_points_parquet(capture_id: CaptureId, service: ServiceOf, run: RunNumber = None) -> Download:
    """The points as Parquet, the columns of the CSV with their units as metadata. 501 if the optional package
    that writes it is not installed.
    """
    parts = parquet_stream(service.archive.path(capture_id), run)
    return download(parts, PARQUET, f"{capture_id}-points.parquet")


@_content("points.mat", "Get points as a MAT-file", MAT, streamed=True)
def get_points_mat(capture_id: CaptureId, service: ServiceOf, run: RunNumber = None) -> Download:
    """The points as a MAT-file of version 5 for MATLAB and Octave: dense arrays over fields and targets, NaN
    where there is no point, with units, meanings, ledger and origin. 422 if it would take more than 600 MB.
    """
    parts = mat_stream(service.archive.path(capture_id), run)
    return download(parts, MAT, f"{capture_id}-points.mat")


@_content("points.c3d", "Get points as C3D", C3D, streamed=True)
def get_points_c3d(capture_id: CaptureId, service: ServiceOf, run: RunNumber = None) -> Content:
    """The points as C3D for motion analysis programs: a marker for each target, and a frame for each field,
    including lost ones.
    """
    arguments = service.archive.path(capture_id), run
    return Content(points_c3d, arguments, media_type=C3D, name=f"{capture_id}-points.c3d")


@_content("channels", "Get channels as JSON, thinned out", CaptureChannelsDocument)
def get_channels(
    capture_id: CaptureId,
    service: ServiceOf,
    max_readings: Annotated[
        int, Query(ge=100, le=200_000, description="Maximum number of readings of each channel.")
    ] = 2000,
) -> Content:
    """The vacuum and other quantities measured beside the picture, in kPa on the time axis of the points,
    with gaps and their reasons. Empty if no channels were recorded.
    """
    arguments = service.archive.path(capture_id), max_readings
    return Content(channels_json, arguments, media_type=JSON, weight=(2 << 20) + max_readings * READING_BYTES)


@_content("channels.csv", "Get channels as CSV", "text/csv", streamed=True)
def get_channels_csv(capture_id: CaptureId, service: ServiceOf, separator: CsvSeparator = "comma") -> Content:
    """All readings of all channels as CSV, a row for each, as measured and in kPa."""
    arguments = service.archive.path(capture_id), DIALECTS[separator]
    return Content(channels_csv, arguments, media_type="text/csv", name=f"{capture_id}-channels.csv")


@_content("fields/{n}.png", "Get a field as a picture", "image/png", NOT_MODIFIED)
def get_field_png(
    capture_id: CaptureId, n: FieldNumber, service: ServiceOf, if_none_match: IfNoneMatch = None
) -> Content:
    """One field as recorded, as a picture that never changes."""
    answer = partial(tagged, media_type="image/png", if_none_match=if_none_match, cache=IMMUTABLE)
    return Content(field_png, (service.archive.path(capture_id), n), answer)


@_content("thumbnail.png", "Get a small picture of a capture", "image/png", NOT_MODIFIED)
def get_thumbnail(capture_id: CaptureId, service: ServiceOf, if_none_match: IfNoneMatch = None) -> Content:
    """A small picture of the field in the middle of a sealed capture, which never changes."""
    answer = partial(tagged, media_type="image/png", if_none_match=if_none_match, cache=IMMUTABLE)
    return Content(thumbnail_png, (service.archive.sealed_path(capture_id),), answer)


@router.get("/{capture_id}/widths", summary="Get the course of the wall's width in few numbers")
@reads
def get_widths(capture_id: CaptureId, service: ServiceOf) -> WidthCourse:
    """Widths across the middle row over six seconds in the middle of a sealed capture, for a small curve."""
    return WidthCourse(widths_mm=service.width_courses.of(capture_id))


BINARY = "application/octet-stream"
FirstField = Annotated[int, Query(ge=0, le=FIELD_END, description="First field.")]


@_content("replay/points", "Get points of a stretch for replay", BINARY)
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
    arguments = service.archive.path(capture_id), run, stretch
    return Content(replay_points, arguments, media_type=BINARY, weight=4 << 20)


@_content("replay/pictures", "Get pictures of a stretch for replay", BINARY)
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
    arguments = service.archive.path(capture_id), stretch
    return Content(replay_pictures, arguments, media_type=BINARY, weight=8 << 20)
