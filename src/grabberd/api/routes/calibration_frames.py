"""Calibration frames: those that are known, and which of their targets a capture shows."""

from fastapi import APIRouter, Request, Response, status
from pydantic import Field

from grabberd.api.idempotency import TAKES_KEY, OnceRoute
from grabberd.api.routes.captures import CaptureId
from grabberd.api.routes.dependencies import PROBLEMS, ServiceOf, job_document
from grabberd.api.routes.models import Document, JobDocument, shown
from grabberd.api.routes.named_types import JsonObject
from grabberd.service.calibrations.calibration_frames import (
    calibration_frame_document,
    calibration_frame_rows,
)
from grabberd.service.jobs.identification import IdentificationJob

router = APIRouter(tags=["calibrations"], responses=PROBLEMS, route_class=OnceRoute)


class CalibrationFrameRow(Document):
    """A calibration frame that comes with the program."""

    name: str
    targets: int
    target_diameter_mm: float
    size_mm: list[float] = Field(description="From the first to the last target's centre, long side first.")


class CalibrationFrameList(Document):
    """The calibration frames that come with the program, by name."""

    calibration_frames: list[CalibrationFrameRow]


class IdentificationOrder(Document):
    """Which calibration frame is looked for."""

    model_config = shown({"calibration_frame": "paper-108"})

    calibration_frame: str | JsonObject | None = Field(
        None, description="Its name or its document; not needed where there is one."
    )


@router.get("/calibration-frames", response_model=CalibrationFrameList, summary="List the calibration frames")
def list_calibration_frames() -> object:
    """The calibration frames that can be named; any other one is given as a document."""
    return {"calibration_frames": calibration_frame_rows()}


@router.post(
    "/captures/{capture_id}/identification",
    status_code=status.HTTP_202_ACCEPTED,
    response_model=JobDocument,
    dependencies=[TAKES_KEY],
    summary="Find the calibration frame's targets in a capture",
)
def identify_capture(
    capture_id: CaptureId,
    service: ServiceOf,
    request: Request,
    response: Response,
    order: IdentificationOrder | None = None,
) -> object:
    """Find which target is which in a sealed capture of the calibration frame, before it is calibrated: a
    job, whose result has what each view shows (found, missing, other), and a problem where that is not clear.
    """
    path = service.archive.sealed_path(capture_id)
    frame = calibration_frame_document(order.calibration_frame if order else None)
    job = service.jobs.submit(IdentificationJob(subject=capture_id, path=path, calibration_frame=frame))
    response.headers["Location"] = str(request.url_for("get_job", job_id=job.id))
    return job_document(job)
