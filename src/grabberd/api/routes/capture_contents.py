"""What is in a capture: its file, its points, its fields."""

from typing import Annotated

from fastapi import APIRouter, Path, Query, Response, status
from fastapi.responses import FileResponse, StreamingResponse

from grabberd.api.etags import ASK_AGAIN, IMMUTABLE, NOT_MODIFIED, IfNoneMatch, is_known, tagged
from grabberd.api.problems import Problem
from grabberd.api.routes.capture_models import PointsDocument, WholeRunDocument
from grabberd.api.routes.captures import CaptureId
from grabberd.api.routes.dependencies import PROBLEMS, ServiceOf
from grabberd.api.streams.downloads import Download, download
from grabberd.api.streams.whole_file import WholeFile
from grabberd.service.archive.run_documents import whole_run
from grabberd.storage import field_png, points_csv, points_ply
from grabberd.storage.capture.reader import stat_at_rest
from grabberd.storage.export.parquet_stream import parquet_stream
from grabberd.storage.export.points_document import PointsQuery, points_document

router = APIRouter(prefix="/captures", tags=["captures"], responses=PROBLEMS)

FIELD_END = 2**53
SQLITE = "application/vnd.sqlite3"
PLY = "application/ply"
PARQUET = "application/vnd.apache.parquet"

RunNumber = Annotated[
    int | None, Query(ge=1, le=2**53, description="Which run's points; default: the latest that is done.")
]
PlyField = Annotated[int | None, Query(ge=0, le=FIELD_END, description="Only this field's; default: all.")]
FieldNumber = Annotated[int, Path(ge=0, le=FIELD_END, description="Number of the field.")]


@router.get(
    "/{capture_id}/file",
    response_class=FileResponse,
    summary="Take a capture home",
    responses={
        200: {"content": {SQLITE: {}}},
        206: {"description": "The range that was asked for.", "content": {SQLITE: {}}},
        **NOT_MODIFIED,
        416: {"description": "There is no such range.", "content": {"text/plain": {}}},
    },
)
def get_capture_file(
    capture_id: CaptureId, service: ServiceOf, if_none_match: IfNoneMatch = None
) -> Response:
    """The whole sealed capture: one SQLite file. A part of it can be asked for (Range); a further run changes
    its ETag, and breaks the answer off that is being sent.
    """
    path = service.archive.sealed_path(capture_id)
    headers = {"Cache-Control": ASK_AGAIN}
    answer = WholeFile(path, 200, headers, SQLITE, filename=path.name, stat_result=stat_at_rest(path))
    if is_known(answer.headers["etag"], if_none_match):
        known = {**headers, "ETag": answer.headers["etag"]}
        return Response(status_code=status.HTTP_304_NOT_MODIFIED, headers=known)
    return answer


@router.get("/{capture_id}/runs/{run}", response_model=WholeRunDocument, summary="What a run was made with")
def get_run(
    capture_id: CaptureId,
    run: Annotated[int, Path(ge=1, le=2**53, description="Number of the run.")],
    service: ServiceOf,
) -> object:
    """A run with the calibration, the object model and the settings that its points were made with."""
    return whole_run(service.archive.path(capture_id), run)


@router.get("/{capture_id}/points", response_model=PointsDocument, summary="Points as JSON, thinned out")
def get_points(
    capture_id: CaptureId,
    service: ServiceOf,
    run: RunNumber = None,
    first_n: Annotated[int, Query(ge=0, le=FIELD_END, description="First field.")] = 0,
    end_n: Annotated[int, Query(ge=0, le=FIELD_END, description="Field after the last one.")] = FIELD_END,
    every: Annotated[
        int, Query(ge=1, le=1_000_000, description="Only fields whose number it divides; odd: both parities.")
    ] = 1,
    max_points: Annotated[
        int, Query(ge=1000, le=200_000, description="`every` is raised until no more are left.")
    ] = 20_000,
    target: Annotated[
        list[Annotated[int, Query(ge=0, le=2**31 - 1)]] | None,
        Query(max_length=1000, description="Only this target; may be repeated."),
    ] = None,
) -> object:
    """The points of a run, field by field, with their standard deviations."""
    query = PointsQuery(run, first_n, end_n, every, max_points, target or ())
    return points_document(service.archive.path(capture_id), query)


@router.get(
    "/{capture_id}/points.csv",
    response_class=StreamingResponse,
    summary="Points as CSV",
    responses={200: {"content": {"text/csv": {}}}},
)
def get_points_csv(capture_id: CaptureId, service: ServiceOf, run: RunNumber = None) -> Download:
    """The points as CSV, a row for each target and field, with their standard deviations."""
    text = points_csv(service.archive.path(capture_id), run)
    return download(text, "text/csv", f"{capture_id}-points.csv")


@router.get(
    "/{capture_id}/points.ply",
    response_class=StreamingResponse,
    summary="Points as a PLY cloud",
    responses={200: {"content": {PLY: {}}}},
)
def get_points_ply(
    capture_id: CaptureId, service: ServiceOf, run: RunNumber = None, field: PlyField = None
) -> Download:
    """The points as one cloud for programs that draw clouds: x, y, z in mm, with field number, target and
    standard deviations as further properties. Of all fields, or of one.
    """
    parts = points_ply(service.archive.path(capture_id), run, field)
    suffix = "points" if field is None else f"field-{field:08d}"
    return download(parts, PLY, f"{capture_id}-{suffix}.ply")


@router.get(
    "/{capture_id}/points.parquet",
    response_class=StreamingResponse,
    summary="Points as Parquet",
    responses={200: {"content": {PARQUET: {}}}, 501: {"model": Problem}},
)
def get_points_parquet(capture_id: CaptureId, service: ServiceOf, run: RunNumber = None) -> Download:
    """The points as Parquet, the columns of the CSV with their units as metadata; 501 where the optional part
    that writes it is not installed.
    """
    parts = parquet_stream(service.archive.path(capture_id), run)
    return download(parts, PARQUET, f"{capture_id}-points.parquet")


@router.get(
    "/{capture_id}/fields/{n}.png",
    response_class=Response,
    summary="A field as a picture",
    responses={200: {"content": {"image/png": {}}}, **NOT_MODIFIED},
)
def get_field_png(
    capture_id: CaptureId, n: FieldNumber, service: ServiceOf, if_none_match: IfNoneMatch = None
) -> Response:
    """One field as a picture, as it was recorded; it never changes."""
    png = field_png(service.archive.path(capture_id), n)
    return tagged(png, "image/png", if_none_match, IMMUTABLE)
