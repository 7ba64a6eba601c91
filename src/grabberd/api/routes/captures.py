"""Captures: start, arm, trigger, stop, list, look up, annotate, delete, re-measure."""

from dataclasses import replace
from datetime import UTC, datetime
from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request, Response, status
from pydantic import AfterValidator

from grabberd.acquisition.clock import iso_utc
from grabberd.api.idempotency import TAKES_KEY, OnceRoute
from grabberd.api.reading.readings import reads
from grabberd.api.routes.dependencies import PROBLEMS, CaptureId, ServiceOf, accepted
from grabberd.api.routes.paging import Cursor, Limit, cursor_of, position_of
from grabberd.documents.captures import CaptureDocument, CaptureList
from grabberd.documents.jobs import JobDocument
from grabberd.documents.named_types import Labels
from grabberd.documents.requests import CaptureOptions, CapturePatch, MeasurementRequest, NewCapture
from grabberd.service.archive.capture_list import CaptureQuery, Position, whole_list
from grabberd.service.archive.capture_list import list_captures as page_of_captures
from grabberd.service.archive.capture_table import captures_csv
from grabberd.service.capture.capture_request import CaptureRequest
from grabberd.service.jobs.measurement import MeasurementJob
from grabberd.service.setup import INCLUDE_DAMAGED

router = APIRouter(prefix="/captures", tags=["captures"], responses=PROBLEMS, route_class=OnceRoute)


def _in_utc(moment: datetime) -> datetime:
    """A time in UTC; one without a zone is in UTC already."""
    try:
        return moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)
    except OverflowError:
        raise ValueError("in UTC, this time is outside the years 1 to 9999") from None


TableLimit = Annotated[int, Query(ge=1, le=10_000, description="Maximum number of rows.")]
Moment = Annotated[datetime, AfterValidator(_in_utc)]


@router.post(
    "", status_code=status.HTTP_202_ACCEPTED, dependencies=[TAKES_KEY], summary="Start or arm a capture"
)
def start_capture(
    new: NewCapture, service: ServiceOf, request: Request, response: Response
) -> CaptureDocument:
    """Start a capture, or arm one that waits for its trigger. 409 with the id of the other capture while one
    is running or armed.
    """
    start = service.capture_control.arm if new.armed else service.capture_control.start
    capture = start(new.device, request_of(new, service.capture_control.rate_hz(new.device)))
    response.headers["Location"] = str(request.url_for("get_capture", capture_id=capture.id))
    return capture


async def _filter(
    device: Annotated[str | None, Query(max_length=200, description="Only captures of this device.")] = None,
    since: Annotated[Moment | None, Query(description="Only captures that started then or later.")] = None,
    until: Annotated[Moment | None, Query(description="Only captures that started before.")] = None,
    search: Annotated[
        str | None, Query(max_length=200, description="Only captures with this text in id, note or labels.")
    ] = None,
    pinned: Annotated[bool | None, Query(description="Only pinned captures, or only unpinned ones.")] = None,
) -> CaptureQuery:
    # Async though it waits for nothing: FastAPI calls other dependencies in threads.
    return CaptureQuery(
        device=device, since_utc=_utc(since), until_utc=_utc(until), search=search, pinned=pinned
    )


Filter = Annotated[CaptureQuery, Depends(_filter)]


@router.get("", summary="List captures")
@reads
def list_captures(
    service: ServiceOf, matching: Filter, limit: Limit = 100, cursor: Cursor = None
) -> CaptureList:
    """Captures, newest first, page by page. Captures that come or go meanwhile do not shift the pages."""
    after = None if cursor is None else Position(*position_of(cursor))
    documents, last = page_of_captures(service.archive, replace(matching, limit=limit, after=after))
    return CaptureList(captures=documents, next=None if last is None else cursor_of(*last))


@router.get(
    ".csv",
    response_class=Response,
    summary="List captures as CSV",
    responses={200: {"content": {"text/csv": {}}}},
)
@reads
def list_captures_as_csv(service: ServiceOf, matching: Filter, limit: TableLimit = 1000) -> Response:
    """Captures, newest first, a row each: verdicts, labels, and the main quantities of the latest analysis
    with their standard deviations.
    """
    text = captures_csv(whole_list(service.archive, replace(matching, limit=limit)))
    headers = {"Content-Disposition": 'attachment; filename="captures.csv"'}
    return Response(text, media_type="text/csv; charset=utf-8", headers=headers)


@router.get("/{capture_id}", summary="Look up a capture")
@reads
def get_capture(capture_id: CaptureId, service: ServiceOf) -> CaptureDocument:
    """One capture with its ledger."""
    return service.archive.document(capture_id)


@router.patch("/{capture_id}", summary="Pin or annotate a capture")
def patch_capture(capture_id: CaptureId, patch: CapturePatch, service: ServiceOf) -> CaptureDocument:
    """Change the note, the labels or the pin. They are stored apart from the file, which stays as it was
    recorded.
    """
    service.annotations.annotate(capture_id, pinned=patch.pinned, note=patch.note, labels=patch.labels)
    return service.archive.document(capture_id)


@router.delete(
    "/{capture_id}",
    status_code=status.HTTP_204_NO_CONTENT,
    response_class=Response,
    summary="Delete a capture",
)
def delete_capture(capture_id: CaptureId, service: ServiceOf) -> None:
    """Delete a capture and its file permanently. 409 while it is armed, running, pinned or used by a job."""
    service.annotations.delete(capture_id)


@router.post(
    "/{capture_id}/trigger",
    status_code=status.HTTP_202_ACCEPTED,
    dependencies=[TAKES_KEY],
    summary="Trigger an armed capture",
)
def trigger_capture(capture_id: CaptureId, service: ServiceOf) -> CaptureDocument:
    """Start recording an armed capture, including its pre-trigger fields, and all others of its
    group with it. 409 if it is not armed.
    """
    service.capture_control.trigger(capture_id)
    return service.archive.document(capture_id)


@router.post("/{capture_id}/stop", status_code=status.HTTP_202_ACCEPTED, summary="Stop a capture")
def stop_capture(capture_id: CaptureId, service: ServiceOf) -> CaptureDocument:
    """Stop a running capture and seal its file. Nothing remains of an armed capture."""
    before = service.archive.document(capture_id)
    service.capture_control.stop(capture_id)
    return before.disarmed if before.state == "armed" else service.archive.document(capture_id)


@router.post(
    "/{capture_id}/measure",
    status_code=status.HTTP_202_ACCEPTED,
    dependencies=[TAKES_KEY],
    summary="Re-measure a capture",
)
def measure_capture(
    capture_id: CaptureId,
    service: ServiceOf,
    request: Request,
    response: Response,
    options: MeasurementRequest | None = None,
) -> JobDocument:
    """Re-measure a sealed capture with the device's present calibration: a job that adds a run.

    Damaged fields are left out unless they are asked for, fields without a signal always.
    """
    service.archive.sealed_path(capture_id)
    setup = service.instrument(service.archive.document(capture_id).device).setup
    made_with = dict(setup.made_with)
    if options is not None and options.include_damaged:
        made_with["settings"] = {**made_with["settings"], INCLUDE_DAMAGED: True}
    job = service.jobs.submit(MeasurementJob(subject=capture_id, made_with=made_with))
    return accepted(job, request, response)


def request_of(options: CaptureOptions, rate_hz: float, labels: Labels | None = None) -> CaptureRequest:
    """The service's request for a capture of one device.

    Args:
        options: Options of the request body.
        rate_hz: Fields per second of the device.
        labels: Labels of this device's capture alone; they take precedence over those of `options`.
    """
    fields = options.post_trigger_fields if options.armed else options.fields
    if options.duration_s is not None:
        fields = max(1, round(options.duration_s * rate_hz))
    return CaptureRequest(
        fields,
        options.bits,
        options.lines,
        options.pre_trigger_fields,
        options.overrun,
        options.on_interruption,
        options.note,
        {**options.labels, **(labels or {})},
    )


def _utc(moment: datetime | None) -> str | None:
    return None if moment is None else iso_utc(moment)
