"""Calibrations: make, store, list, read, activate, reject; calibration frames and their identification.

A stored calibration never changes.
"""

from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, Path, Request, Response, status

from grabberd.archive.calibrations.calibration_catalog import (
    calibration_frame_document,
    frame_row,
    known_calibration_frames,
)
from grabberd.documents.calibration_reports import CalibrationReport
from grabberd.documents.calibrations import (
    CalibrationDocument,
    CalibrationFrameList,
    CalibrationFrameRow,
    CalibrationList,
    CalibrationRow,
    UnusableFrame,
)
from grabberd.documents.enums import Role
from grabberd.documents.jobs import JobDocument
from grabberd.documents.problems import Problem
from grabberd.documents.requests import (
    CalibrationChoice,
    CalibrationOptions,
    CalibrationRequest,
    IdentificationRequest,
    RejectionRequest,
)
from grabberd.library.jobs.calibration_jobs import CalibrationJob, IdentificationJob
from grabberd.server.api.guard.authentication import IdentityOf
from grabberd.server.api.problems import Refusal
from grabberd.server.api.readings import reads
from grabberd.server.api.responses import NOT_MODIFIED, IfNoneMatch, tagged
from grabberd.server.api.routes.dependencies import (
    ACCEPTED_ONCE,
    PROBLEMS,
    REPORT_HEADERS,
    CaptureId,
    Cursor,
    Limit,
    OnceRoute,
    ServiceOf,
    accepted,
    page_of,
)

router = APIRouter(tags=["calibrations"], responses=PROBLEMS, route_class=OnceRoute)

CalibrationId = Annotated[str, Path(pattern=r"^[0-9A-Za-z_-]{1,80}$", description="Id of the calibration.")]


@router.get("/calibration-frames", summary="List the calibration frames")
def list_calibration_frames(
    service: ServiceOf, limit: Limit = 100, cursor: Cursor = None
) -> CalibrationFrameList:
    """The calibration frames that can be selected by name: the files in `calibration-frames` beside the
    configuration, or without any, those of the program, by name, page by page. Files that cannot be used are
    listed apart, with the reason. Others are sent as a document.
    """
    known = known_calibration_frames(service.config_file)
    page, following = page_of(
        known.items(), _by_name, lambda one: frame_row(*one), limit, cursor, ascending=True
    )
    return CalibrationFrameList(
        calibration_frames=[one for one in page if isinstance(one, CalibrationFrameRow)],
        unusable=[one for one in page if isinstance(one, UnusableFrame)],
        next=following,
    )


@router.post(
    "/captures/{capture_id}/identification",
    **ACCEPTED_ONCE,
    summary="Identify the calibration frame's targets in a capture",
)
def identify_capture(
    capture_id: CaptureId,
    service: ServiceOf,
    request: Request,
    response: Response,
    wanted: IdentificationRequest | None = None,
) -> JobDocument:
    """Identify the targets in a sealed capture of the calibration frame before calibrating: a job, whose
    result lists what each view shows (found, missing, other), and a problem if the assignment is ambiguous.
    """
    service.archive.sealed_path(capture_id)
    wanted = wanted or IdentificationRequest()
    job = service.jobs.submit(
        IdentificationJob(
            subject=capture_id,
            calibration_frame=calibration_frame_document(wanted.calibration_frame, service.config_file),
            turn_deg=wanted.turn_deg,
            marks=tuple(wanted.marks),
        )
    )
    return accepted(job, request, response)


@router.post(
    "/calibrations",
    response_model=JobDocument | CalibrationRow,
    responses={201: {"model": CalibrationRow}, 202: {"model": JobDocument}},
    **ACCEPTED_ONCE,
    summary="Calibrate, or store a calibration",
)
def make_calibration(
    new: CalibrationRequest, service: ServiceOf, request: Request, response: Response
) -> JobDocument | CalibrationRow:
    """Calibrate from sealed captures of the calibration frame, one or one for each of its poses, a job whose
    result names the calibration; or store a complete calibration (201).
    """
    if new.document is not None:
        calibration_id = service.import_calibration(new.document, new.device, new.note)
        response.status_code = status.HTTP_201_CREATED
        response.headers["Location"] = str(request.url_for("get_calibration", calibration_id=calibration_id))
        return service.active.row(calibration_id)
    for capture_id in new.poses:
        service.archive.sealed_path(capture_id)
    first, *further = new.poses
    device = new.device or service.archive.document(first).device
    job = service.jobs.submit(
        CalibrationJob(
            subject=first,
            further=tuple(further),
            calibration_frame=calibration_frame_document(new.calibration_frame, service.config_file),
            options=new.options or CalibrationOptions(),
            device=service.instrument(device).name,
            note=new.note,
            previous=service.instrument(device).setup.documents.get("calibration"),
        )
    )
    return accepted(job, request, response)


@router.get("/calibrations", summary="List calibrations")
def list_calibrations(service: ServiceOf, limit: Limit = 100, cursor: Cursor = None) -> CalibrationList:
    """The calibrations, including those of the configuration, newest first, page by page."""
    heads, row = service.active.listing()
    page, following = page_of(heads, lambda head: head.place, row, limit, cursor)
    return CalibrationList(calibrations=page, next=following)


@router.put("/calibrations/active", summary="Activate a calibration")
def activate_calibration(
    choice: CalibrationChoice, service: ServiceOf, identity: IdentityOf
) -> CalibrationRow:
    """Measure with this calibration from the next field on, and after every restart. 409 while a capture is
    running, and for one whose acceptance failed, unless an admin sets `despite_failure`.
    """
    if choice.despite_failure and not identity.covers(Role.ADMIN):
        raise Refusal(
            status.HTTP_403_FORBIDDEN,
            "forbidden",
            f"only an admin may use a calibration whose acceptance failed, not an {identity.role}",
            "correct the causes and calibrate again, or ask an admin",
        )
    service.active.activate(
        choice.id, service.instrument(choice.device), despite_failure=choice.despite_failure
    )
    return service.active.row(choice.id, choice.device)


@router.put("/calibrations/{calibration_id}/rejection", summary="Reject a calibration")
def reject_calibration(
    calibration_id: CalibrationId, service: ServiceOf, rejection: RejectionRequest | None = None
) -> CalibrationRow:
    """Mark a calibration as not accepted: it stays in the list, with a note. Activating it revokes that. 409
    while a device measures with it.
    """
    service.active.reject(calibration_id, rejection.note if rejection else "")
    return service.active.row(calibration_id)


@router.get(
    "/calibrations/{calibration_id}",
    response_class=Response,
    summary="Download a calibration",
    responses={200: {"model": CalibrationDocument}, **NOT_MODIFIED},
)
def get_calibration(
    calibration_id: CalibrationId, service: ServiceOf, if_none_match: IfNoneMatch = None
) -> Response:
    """The complete calibration as stored: one JSON document."""
    return tagged(service.calibrations.content(calibration_id), "application/json", if_none_match)


@router.get(
    "/calibrations/{calibration_id}/report",
    response_class=Response,
    summary="Get a calibration's report as a page",
    responses={200: {"content": {"text/html": {}}}, 501: {"model": Problem}},
)
@reads
def get_calibration_report(calibration_id: CalibrationId, service: ServiceOf) -> Response:
    """The calibration's report, on how it was made and how good it is: a page to read and sign."""
    page = service.calibrations.page(calibration_id)
    return Response(page, media_type="text/html; charset=utf-8", headers=REPORT_HEADERS)


@router.get(
    "/calibrations/{calibration_id}/report.json",
    response_class=Response,
    summary="Get a calibration's report as JSON",
    responses={200: {"model": CalibrationReport}},
)
@reads
def get_calibration_report_json(calibration_id: CalibrationId, service: ServiceOf) -> Response:
    """The numbers of the report."""
    return Response(service.calibrations.report(calibration_id), media_type="application/json")


def _by_name(frame: tuple[str, object]) -> tuple[str, str]:
    return "", quote(frame[0], safe="").replace("~", "%7E")
