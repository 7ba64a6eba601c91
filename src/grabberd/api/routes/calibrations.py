"""Calibrations: make from a capture, store, list, look, activate. A stored one is never changed."""

from typing import Annotated, Any

from fastapi import APIRouter, Path, Request, Response, status

from grabberd.api.etags import NOT_MODIFIED, IfNoneMatch, tagged
from grabberd.api.idempotency import TAKES_KEY, OnceRoute
from grabberd.api.problems import Problem
from grabberd.api.routes.calibration_models import (
    CalibrationChoice,
    CalibrationList,
    CalibrationOrder,
    CalibrationRow,
    RejectionOrder,
)
from grabberd.api.routes.dependencies import PROBLEMS, ServiceOf, job_document
from grabberd.api.routes.models import JobDocument
from grabberd.api.routes.paging import Cursor, Limit, page_of
from grabberd.service.calibrations.calibration_frames import calibration_frame_document
from grabberd.service.jobs.calibration import CalibrationJob
from grabberd.service.service import Service

router = APIRouter(prefix="/calibrations", tags=["calibrations"], responses=PROBLEMS, route_class=OnceRoute)

CalibrationId = Annotated[str, Path(pattern=r"^[0-9A-Za-z_-]{1,80}$", description="Id of the calibration.")]
ANY_DOCUMENT = {"$ref": "#/components/schemas/JsonObject"}

PAGE_HEADERS = {"Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; img-src data:"}
"""A report needs nothing but itself."""


@router.post(
    "",
    status_code=status.HTTP_202_ACCEPTED,
    response_model=JobDocument | CalibrationRow,
    responses={201: {"model": CalibrationRow}, 202: {"model": JobDocument}},
    dependencies=[TAKES_KEY],
    summary="Calibrate, or store a calibration",
)
def make_calibration(
    order: CalibrationOrder, service: ServiceOf, request: Request, response: Response
) -> object:
    """Calibrate from a sealed capture of the calibration frame, a job whose result names the calibration; or
    store a complete one (201).
    """
    if order.document is not None:
        return _store(order, order.document, service, request, response)
    options = order.options.model_dump(exclude_none=True) if order.options else {}
    capture_id = order.capture or ""
    path = service.archive.sealed_path(capture_id)
    device = order.device or service.archive.document(capture_id)["device"]
    job = service.jobs.submit(
        CalibrationJob(
            subject=capture_id,
            path=path,
            calibration_frame=calibration_frame_document(order.calibration_frame),
            options=options,
            store=service.calibrations.store.directory,
            device=service.instrument(device).name,
            calibrator=service.calibrator,
            note=order.note,
        )
    )
    response.headers["Location"] = str(request.url_for("get_job", job_id=job.id))
    return job_document(job)


@router.get("", response_model=CalibrationList, summary="List calibrations")
def list_calibrations(service: ServiceOf, limit: Limit = 100, cursor: Cursor = None) -> object:
    """The calibrations, the newest first, those of the configuration among them, page by page."""
    page, following = page_of(service.active.rows(), _place, limit, cursor)
    return {"calibrations": page, "next": following}


@router.put("/active", response_model=CalibrationRow, summary="Choose the calibration to measure with")
def activate_calibration(choice: CalibrationChoice, service: ServiceOf) -> object:
    """Measure with this calibration from the next field on, and after every restart; 409 while a capture
    runs.
    """
    service.activate_calibration(choice.id, choice.device)
    return service.active.row(choice.id, choice.device)


@router.put(
    "/{calibration_id}/rejection", response_model=CalibrationRow, summary="Say that a calibration is no good"
)
def reject_calibration(
    calibration_id: CalibrationId, service: ServiceOf, order: RejectionOrder | None = None
) -> object:
    """Reject a calibration that was read: it stays in the list, with a note; activating it takes that back.
    409 while a device measures with it.
    """
    service.active.reject(calibration_id, order.note if order else "")
    return service.active.row(calibration_id)


@router.get(
    "/{calibration_id}",
    response_class=Response,
    summary="Take a calibration home",
    responses={200: {"content": {"application/json": {"schema": ANY_DOCUMENT}}}, **NOT_MODIFIED},
)
def get_calibration(
    calibration_id: CalibrationId,
    service: ServiceOf,
    if_none_match: IfNoneMatch = None,
) -> Response:
    """The whole calibration as it was stored: one JSON document."""
    return tagged(service.calibrations.content(calibration_id), "application/json", if_none_match)


@router.get(
    "/{calibration_id}/report",
    response_class=Response,
    summary="A calibration's report as a page",
    responses={200: {"content": {"text/html": {}}}, 501: {"model": Problem}},
)
def get_calibration_report(calibration_id: CalibrationId, service: ServiceOf) -> Response:
    """How the calibration was made and how good it is: a page to be read and signed."""
    page = service.calibrations.page(calibration_id)
    return Response(page, media_type="text/html; charset=utf-8", headers=PAGE_HEADERS)


@router.get(
    "/{calibration_id}/report.json",
    response_class=Response,
    summary="A calibration's report as numbers",
    responses={200: {"content": {"application/json": {"schema": ANY_DOCUMENT}}}},
)
def get_calibration_report_json(calibration_id: CalibrationId, service: ServiceOf) -> Response:
    """The report's numbers."""
    return Response(service.calibrations.report(calibration_id), media_type="application/json")


def _place(row: dict[str, Any]) -> tuple[str, str]:
    return row["created_utc"] or "", row["id"]


def _store(
    order: CalibrationOrder,
    document: dict[str, object],
    service: Service,
    request: Request,
    response: Response,
) -> object:
    calibration_id = service.import_calibration(document, order.device, order.note)
    response.status_code = status.HTTP_201_CREATED
    response.headers["Location"] = str(request.url_for("get_calibration", calibration_id=calibration_id))
    return service.active.row(calibration_id)
