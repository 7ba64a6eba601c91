"""Devices: state, newest points and curves, object model, illumination, check of a calibration, readiness."""

from typing import Annotated

from fastapi import APIRouter, Query, Request, Response, status

from grabberd.archive.calibrations.calibration_catalog import calibration_frame_document
from grabberd.documents.devices import (
    DeviceDocument,
    DeviceList,
    FaultDocument,
    LackDocument,
    LightDocument,
    ObjectDocument,
    ReadyDocument,
)
from grabberd.documents.jobs import JobDocument
from grabberd.documents.points_frame import LiveCurves, NewestPoints
from grabberd.documents.problems import NotReadyProblem
from grabberd.documents.requests import CheckRequest
from grabberd.instrument.live.field_streams import curves_document, light_document, object_document
from grabberd.instrument.live.health import device_health, lacks_of
from grabberd.server.api.problems import problem
from grabberd.server.api.responses import NOT_MODIFIED, IfNoneMatch, RenderedRoute
from grabberd.server.api.routes.dependencies import PROBLEMS, DeviceName, ServiceOf, SnapshotsOf, accepted
from grabberd.server.daemon.jobs import CheckJob

KEPT_S = 300

router = APIRouter(prefix="/devices", tags=["devices"], route_class=RenderedRoute)


@router.get("", summary="List devices")
def list_devices(service: ServiceOf) -> DeviceList:
    """Present state of all devices."""
    return DeviceList(devices=[service.device_document(one) for one in service.instruments.values()])


@router.get("/{name}", responses=PROBLEMS, summary="Look up a device")
def get_device(name: DeviceName, service: ServiceOf) -> DeviceDocument:
    """Present state of one device."""
    return service.device_document(service.instrument(name))


@router.get(
    "/{name}/points",
    response_class=Response,
    responses={**PROBLEMS, 200: {"model": NewestPoints}, **NOT_MODIFIED},
    summary="Get the newest points",
)
async def get_newest_points(
    name: DeviceName, service: ServiceOf, snapshots: SnapshotsOf, if_none_match: IfNoneMatch = None
) -> Response:
    """The points of the newest measured field with their standard deviations. 409 before the first one."""
    snapshot = await snapshots.points[service.instrument(name).name].get()
    return snapshot.response(if_none_match)


@router.get("/{name}/curves", responses=PROBLEMS, summary="Get the last minutes, field by field")
def get_curves(
    name: DeviceName,
    service: ServiceOf,
    last_s: Annotated[float, Query(gt=0, le=KEPT_S, description="How far back.")] = 60.0,
) -> LiveCurves:
    """Targets, points, residual, latency and widths of every measured field of the last minutes, and the
    vacuum; `/curves/stream` continues them. Five minutes are kept, whether or not anybody is connected.
    """
    span_ns = int(last_s * 1e9)
    return curves_document(service.instrument(name), service.loggers, service.clock, span_ns)


@router.get("/{name}/object", responses=PROBLEMS, summary="Get the object model")
def get_object(name: DeviceName, service: ServiceOf) -> ObjectDocument:
    """The object model that the device measures with: nominal coordinates, row and column of each target."""
    return object_document(service.instrument(name))


check_router = APIRouter(tags=["devices"], route_class=RenderedRoute)


@check_router.get("/api/v1/devices/{name}/light", responses=PROBLEMS, summary="Get the illumination")
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


@check_router.post(
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
            calibration_frame_document(options.calibration_frame, service.config_file),
            in_place=options.in_place,
            seconds=options.duration_s,
        )
    )
    return accepted(job, request, response)


@check_router.get(
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
