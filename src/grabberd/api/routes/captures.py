"""Captures: start, arm, trigger, stop, list, look, keep, measure again."""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response, status

from grabberd.api.idempotency import TAKES_KEY, OnceRoute
from grabberd.api.routes.capture_models import (
    CaptureDocument,
    CaptureList,
    CaptureOrder,
    CapturePatch,
    CaptureWish,
)
from grabberd.api.routes.dependencies import PROBLEMS, ServiceOf, job_document
from grabberd.api.routes.models import JobDocument
from grabberd.api.routes.paging import Cursor, Limit, cursor_of, place_of
from grabberd.service.archive.capture_list import CaptureQuery, Position
from grabberd.service.archive.capture_list import list_captures as page_of_captures
from grabberd.service.capture.capture_request import CaptureRequest
from grabberd.service.clock import iso_utc
from grabberd.service.jobs.measurement import MeasurementJob

router = APIRouter(prefix="/captures", tags=["captures"], responses=PROBLEMS, route_class=OnceRoute)

CaptureId = Annotated[str, Path(pattern=r"^[0-9A-Za-z_-]{1,80}$", description="Id of the capture.")]


@router.post(
    "",
    status_code=status.HTTP_202_ACCEPTED,
    response_model=CaptureDocument,
    dependencies=[TAKES_KEY],
    summary="Start or arm a capture",
)
def start_capture(order: CaptureOrder, service: ServiceOf, request: Request, response: Response) -> object:
    """Start a capture, or arm one that waits for its trigger; 409 with the other one's id while one is
    running or armed.
    """
    wanted = request_of(order, service.rate_hz(order.device))
    begin = service.capture_control.arm if order.armed else service.capture_control.start
    capture_id = begin(order.device, wanted)
    response.headers["Location"] = str(request.url_for("get_capture", capture_id=capture_id))
    return service.archive.document(capture_id)


@router.get("", response_model=CaptureList, summary="List captures")
def list_captures(
    service: ServiceOf,
    limit: Limit = 100,
    cursor: Cursor = None,
    device: Annotated[str | None, Query(max_length=200, description="Only this device's.")] = None,
    since: Annotated[datetime | None, Query(description="Only those that began then or later.")] = None,
    until: Annotated[datetime | None, Query(description="Only those that began before.")] = None,
    search: Annotated[
        str | None, Query(max_length=200, description="Only those with this text in id, note or labels.")
    ] = None,
    pinned: Annotated[bool | None, Query(description="Only pinned ones, or only others.")] = None,
) -> object:
    """Captures, the newest first, page by page: one that comes or goes meanwhile shifts no page."""
    after = None if cursor is None else Position(*place_of(cursor))
    query = CaptureQuery(limit, after, device, _utc(since), _utc(until), search, pinned)
    documents, last = page_of_captures(service.archive, query)
    return {"captures": documents, "next": None if last is None else cursor_of(*last)}


@router.get("/{capture_id}", response_model=CaptureDocument, summary="Look at a capture")
def get_capture(capture_id: CaptureId, service: ServiceOf) -> object:
    """One capture with its ledger."""
    return service.archive.document(capture_id)


@router.patch(
    "/{capture_id}", response_model=CaptureDocument, summary="Pin a capture, or say something of it"
)
def patch_capture(capture_id: CaptureId, patch: CapturePatch, service: ServiceOf) -> object:
    """Change note, labels or pin. They are kept beside the file, which stays as it was recorded."""
    service.annotations.annotate(capture_id, pinned=patch.pinned, note=patch.note, labels=patch.labels)
    return service.archive.document(capture_id)


@router.delete(
    "/{capture_id}",
    status_code=status.HTTP_204_NO_CONTENT,
    response_class=Response,
    summary="Delete a capture",
)
def delete_capture(capture_id: CaptureId, service: ServiceOf) -> None:
    """Delete a capture and its file, for good; 409 while it is armed, running, pinned or worked on."""
    service.annotations.delete(capture_id)


@router.post(
    "/{capture_id}/trigger",
    status_code=status.HTTP_202_ACCEPTED,
    response_model=CaptureDocument,
    dependencies=[TAKES_KEY],
    summary="Trigger an armed capture",
)
def trigger_capture(capture_id: CaptureId, service: ServiceOf) -> object:
    """Have an armed capture record, with the fields before this moment that it wants, and all others of its
    group with it; 409 if it is not armed.
    """
    service.capture_control.trigger(capture_id)
    return service.archive.document(capture_id)


@router.post(
    "/{capture_id}/stop",
    status_code=status.HTTP_202_ACCEPTED,
    response_model=CaptureDocument,
    summary="Stop a capture",
)
def stop_capture(capture_id: CaptureId, service: ServiceOf) -> object:
    """Stop the running capture, whose file is sealed at once; of an armed one nothing is left."""
    before = service.archive.document(capture_id)
    service.capture_control.stop(capture_id)
    if before["state"] == "armed":
        return {**before, "state": "disarmed", "ended_because": "stopped before it was triggered"}
    return service.archive.document(capture_id)


@router.post(
    "/{capture_id}/measure",
    status_code=status.HTTP_202_ACCEPTED,
    response_model=JobDocument,
    dependencies=[TAKES_KEY],
    summary="Measure a capture again",
)
def measure_capture(
    capture_id: CaptureId, service: ServiceOf, request: Request, response: Response
) -> object:
    """Measure a sealed capture again with the device's present calibration: a job that adds a run."""
    path = service.archive.sealed_path(capture_id)
    instrument = service.instrument(service.archive.document(capture_id)["device"])
    job = service.jobs.submit(MeasurementJob(subject=capture_id, path=path, made_with=instrument.made_with))
    response.headers["Location"] = str(request.url_for("get_job", job_id=job.id))
    return job_document(job)


def _utc(since: datetime | None) -> str | None:
    """A time without a zone is UTC."""
    if since is None:
        return None
    return iso_utc(since.astimezone(UTC) if since.tzinfo else since.replace(tzinfo=UTC))


def request_of(wish: CaptureWish, rate_hz: float, labels: Mapping[str, str] | None = None) -> CaptureRequest:
    """What is asked of a device; further labels go beside those of the wish, and before them."""
    fields = wish.post_trigger_fields if wish.armed else wish.fields
    if wish.duration_s is not None:
        fields = max(1, round(wish.duration_s * rate_hz))
    return CaptureRequest(
        fields,
        wish.bits,
        wish.lines,
        wish.pre_trigger_fields,
        wish.overrun,
        wish.on_interruption,
        wish.note,
        {**wish.labels, **(labels or {})},
    )
