"""Devices: illumination, check of a calibration, readiness."""

from typing import Annotated

from fastapi import APIRouter, Query, Request, Response, status

from grabberd.documents.devices import LackDocument, LightDocument, ReadyDocument
from grabberd.documents.faults import FaultDocument
from grabberd.documents.jobs import JobDocument
from grabberd.documents.problems import NotReadyProblem
from grabberd.documents.requests import CheckRequest
from grabberd.instrument.live.health import device_health, lacks_of
from grabberd.instrument.live.newest_field import light_document
from grabberd.server.api.problems import problem
from grabberd.server.api.rendering import RenderedRoute
from grabberd.server.api.routes.dependencies import PROBLEMS, DeviceName, ServiceOf, accepted
from grabberd.server.daemon.check_job import CheckJob

router = APIRouter(tags=["devices"], route_class=RenderedRoute)


@router.get("/api/v1/devices/{name}/light", responses=PROBLEMS, summary="Get the illumination")
def get_light(
    name: DeviceName,
    service: ServiceOf,
    threshold: Annotated[
        int | None,
        Query(ge=0, le=254, description="Threshold for counting targets; default: the one in force."),
    ] = None,
) -> LightDocument:
    """Illumination of the newest field, to adjust lamp and lens: histogram, number and mean size of the
    targets in each view. Updated at most five times a second.
    """
    return light_document(service.instrument(name), threshold)


@router.post(
    "/api/v1/devices/{name}/check",
    status_code=status.HTTP_202_ACCEPTED,
    responses=PROBLEMS,
    summary="Check a calibration with the calibration frame",
)
def check_device(
    name: DeviceName,
    service: ServiceOf,
    request: Request,
    response: Response,
    check: CheckRequest | None = None,
) -> JobDocument:
    """Capture the calibration frame for ten seconds and compare it with its certificate: a job, whose result
    has a verdict (fits, doubtful, recalibrate), its reasons and what to do.
    """
    options = check or CheckRequest()
    job = service.jobs.submit(
        CheckJob.start(
            service.capture_control,
            service.instrument(name),
            options.calibration_frame,
            in_place=options.in_place,
            seconds=options.duration_s,
        )
    )
    return accepted(job, request, response)


@router.get(
    "/readyz",
    response_model=ReadyDocument,
    summary="Check that every device measures as it should",
    responses={503: {"model": NotReadyProblem, "content": {"application/problem+json": {}}}},
)
def get_readiness(service: ServiceOf) -> ReadyDocument | Response:
    """Check that every device measures as it should: that it streams at its rate, loses no fields, has a
    signal, a calibration that fits, and room on the disk. 503 lists what does not. `faults` lists problems of
    the daemon itself, which do not keep it from measuring.
    """
    around = service.surroundings()
    lacks = [
        LackDocument(device=name, **lack.model_dump())
        for name, instrument in service.instruments.items()
        for lack in lacks_of(device_health(instrument, around).parts)
    ]
    faults = list(around.faults)
    return _not_ready(lacks, faults) if lacks else ReadyDocument(faults=faults)


def _not_ready(lacks: list[LackDocument], faults: list[FaultDocument]) -> Response:
    detail = "; ".join(f"{lack.device}: {lack.message}" for lack in lacks)
    hint = "; ".join(dict.fromkeys(lack.hint for lack in lacks))
    return problem(503, "not-ready", detail, hint, NotReadyProblem, lacks=lacks, faults=faults)
