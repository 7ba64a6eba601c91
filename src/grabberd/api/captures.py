"""Captures: start, stop, list, look, take home."""

from collections.abc import Iterator
from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response, status
from fastapi.responses import FileResponse, StreamingResponse

from grabberd.api.models import CaptureDocument, CaptureList, CaptureOrder, JobDocument
from grabberd.api.of_service import PROBLEMS, ServiceOf, job_document
from grabberd.service.recorder import CaptureRequest
from grabberd.storage import field_png, points_csv

router = APIRouter(prefix="/captures", tags=["captures"], responses=PROBLEMS)

CaptureId = Annotated[str, Path(pattern=r"^[0-9A-Za-z_-]{1,80}$")]
RunNumber = Annotated[
    int | None, Query(ge=1, description="Which run's points; default: the latest that is done.")
]


@router.post("", status_code=status.HTTP_202_ACCEPTED, response_model=CaptureDocument)
def start_capture(order: CaptureOrder, service: ServiceOf, request: Request, response: Response) -> object:
    """Start a capture; 409 with the running one's id while one is running."""
    capture_id = service.start_capture(order.device, _request_of(order, service.rate_hz(order.device)))
    response.headers["Location"] = str(request.url_for("get_capture", capture_id=capture_id))
    return service.archive.document(capture_id)


@router.get("", response_model=CaptureList)
def list_captures(service: ServiceOf) -> object:
    """All captures, the newest first."""
    return {"captures": service.archive.documents()}


@router.get("/{capture_id}", response_model=CaptureDocument)
def get_capture(capture_id: CaptureId, service: ServiceOf) -> object:
    """One capture with its ledger."""
    return service.archive.document(capture_id)


@router.post("/{capture_id}/stop", status_code=status.HTTP_202_ACCEPTED, response_model=CaptureDocument)
def stop_capture(capture_id: CaptureId, service: ServiceOf) -> object:
    """Stop the running capture; its file is sealed at once."""
    service.stop_capture(capture_id)
    return service.archive.document(capture_id)


@router.post("/{capture_id}/measure", status_code=status.HTTP_202_ACCEPTED, response_model=JobDocument)
def measure_capture(
    capture_id: CaptureId, service: ServiceOf, request: Request, response: Response
) -> object:
    """Measure a sealed capture again with the device's present calibration: a job that adds a run."""
    job = service.measure(capture_id)
    response.headers["Location"] = str(request.url_for("get_job", job_id=job.id))
    return job_document(job)


@router.get("/{capture_id}/file", response_class=FileResponse)
def get_capture_file(capture_id: CaptureId, service: ServiceOf) -> FileResponse:
    """The whole sealed capture: one SQLite file."""
    path = service.archive.sealed_path(capture_id)
    return FileResponse(path, media_type="application/vnd.sqlite3", filename=path.name)


@router.get("/{capture_id}/points.csv", response_class=StreamingResponse)
def get_points_csv(capture_id: CaptureId, service: ServiceOf, run: RunNumber = None) -> StreamingResponse:
    """The points as CSV, a row for each target and field, with their standard deviations."""
    text: Iterator[str] = points_csv(service.archive.path(capture_id), run)
    name = f'attachment; filename="{capture_id}-points.csv"'
    return StreamingResponse(text, media_type="text/csv", headers={"Content-Disposition": name})


@router.get(
    "/{capture_id}/fields/{n}.png", response_class=Response, responses={200: {"content": {"image/png": {}}}}
)
def get_field_png(
    capture_id: CaptureId, n: Annotated[int, Path(ge=0, le=2**53)], service: ServiceOf
) -> Response:
    """One field as a picture, as it was recorded."""
    return Response(field_png(service.archive.path(capture_id), n), media_type="image/png")


def _request_of(order: CaptureOrder, rate_hz: float) -> CaptureRequest:
    fields = order.fields
    if order.duration_s is not None:
        fields = max(1, round(order.duration_s * rate_hz))
    return CaptureRequest(
        fields,
        order.bits,
        order.lines,
        order.pre_trigger_fields,
        order.overrun,
        order.on_interruption,
        order.note,
        dict(order.labels),
    )
