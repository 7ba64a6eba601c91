"""Checks of a device's calibration with the calibration frame."""

from typing import Annotated

from fastapi import APIRouter, Path, Request, Response, status
from pydantic import Field

from grabberd.api.routes.dependencies import PROBLEMS, ServiceOf, job_document
from grabberd.api.routes.models import Document, JobDocument, shown
from grabberd.api.routes.named_types import JsonObject
from grabberd.service.jobs.check import SECONDS, CheckJob

router = APIRouter(tags=["devices"], responses=PROBLEMS)

DeviceName = Annotated[str, Path(max_length=32, description="Name of the device.")]


class CheckOrder(Document):
    """A check as it is asked for; all of it may be left out."""

    model_config = shown({"duration_s": 10, "in_place": True})

    calibration_frame: str | JsonObject | None = Field(
        None,
        description="Name of a calibration frame that comes with the program, or its document; "
        "not needed where there is one.",
    )
    in_place: bool = Field(
        False,
        description="The calibration frame stands exactly where it stood at the calibration; then a camera "
        "that has moved as a whole is seen too.",
    )
    duration_s: float = Field(SECONDS, ge=0.2, le=60, description="Length of its capture in seconds.")


@router.post(
    "/devices/{name}/check",
    status_code=status.HTTP_202_ACCEPTED,
    response_model=JobDocument,
    summary="Check a calibration with the calibration frame",
)
def check_device(
    name: DeviceName,
    service: ServiceOf,
    request: Request,
    response: Response,
    order: CheckOrder | None = None,
) -> object:
    """Capture the calibration frame for ten seconds and compare it with its certificate: a job, whose result
    has a verdict (fits, doubtful, recalibrate), its reasons and what to do.
    """
    asked = order or CheckOrder()
    job = service.jobs.submit(
        CheckJob.start(
            service.capture_control,
            service.archive,
            service.instrument(name),
            asked.calibration_frame,
            in_place=asked.in_place,
            seconds=asked.duration_s,
        )
    )
    response.headers["Location"] = str(request.url_for("get_job", job_id=job.id))
    return job_document(job)
