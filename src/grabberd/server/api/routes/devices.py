"""Devices: state, newest points and curves, object model."""

from typing import Annotated

from fastapi import APIRouter, Query, Response

from grabberd.documents.devices import DeviceDocument, DeviceList, ObjectDocument
from grabberd.documents.live_curves import LiveCurves
from grabberd.documents.points import NewestPoints
from grabberd.instrument.live.curves import curves_document
from grabberd.instrument.live.live_document import object_document
from grabberd.server.api.etags import NOT_MODIFIED, IfNoneMatch
from grabberd.server.api.rendering import RenderedRoute
from grabberd.server.api.routes.dependencies import PROBLEMS, DeviceName, ServiceOf, SnapshotsOf

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
