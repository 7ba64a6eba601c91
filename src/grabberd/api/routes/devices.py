"""The devices at this moment, and whether they can measure."""

from typing import Annotated, Literal

from fastapi import APIRouter, Path, Query
from fastapi.responses import Response
from pydantic import Field

from grabberd.api.problems import Problem, problem
from grabberd.api.routes.capture_models import PointColumns
from grabberd.api.routes.dependencies import PROBLEMS, ServiceOf
from grabberd.api.routes.models import Document
from grabberd.api.routes.named_types import LackKind
from grabberd.api.routes.state_models import DeviceDocument
from grabberd.errors import Cause
from grabberd.service.live.device_document import lack_document
from grabberd.service.live.illumination import light_document
from grabberd.service.live.live_document import newest_points, object_document
from grabberd.service.live.pulsation_rate import pulsation_document
from grabberd.service.readiness import Lack, lacks_of
from grabberd.service.service import Service

router = APIRouter(tags=["devices"])

DeviceName = Annotated[str, Path(max_length=32, description="Name of the device.")]


class DeviceList(Document):
    """The devices, as they stand in the configuration."""

    devices: list[DeviceDocument]


class NewestPoints(PointColumns):
    """The points of the newest measured field: the same target in the same place of every list."""

    device: str
    n: int
    utc: str = Field(description="Middle of its exposure.")


class ObjectDocument(Document):
    """An object model: the same target in the same place of every list."""

    name: str
    target_diameter_mm: float
    sigma_mm: float = Field(description="Standard deviation of the nominal places.")
    target: list[int]
    x_mm: list[float]
    y_mm: list[float]
    z_mm: list[float]
    row: list[int]
    column: list[int]


class ViewLightDocument(Document):
    """How one view is lit."""

    histogram: list[int] = Field(description="How many pixels have each grey value, 0 to 255.")
    targets: int = Field(description="How many targets it shows whole, at the threshold.")
    diameter_px: float | None = Field(description="Their mean diameter, frame pixels.")
    background: int = Field(description="Median grey value of what is no target.")
    brightest: int = Field(description="One pixel in a thousand is brighter.")
    clipped: float = Field(description="Share of the targets' pixels that are as white as the camera gets.")


class LightDocument(Document):
    """How the newest field is lit, view by view."""

    threshold: int
    views: dict[str, ViewLightDocument]


class PulsationDocument(Document):
    """How fast the liner before a device pulsated last; nothing but None where that is not known."""

    rate_per_min: float | None = Field(description="Pulsations a minute.")
    capture: str | None = Field(description="The newest analysed capture of the device: it was found there.")
    analysis: int | None = Field(description="The number of its analysis.")


class LackDocument(Document):
    """What keeps a device from measuring."""

    device: str
    lacks: LackKind
    message: str
    hint: str
    cause_code: Cause | None = Field(description="The same in a word.")


class ReadyDocument(Document):
    """Every device measures."""

    status: Literal["ready"] = "ready"


class NotReadyProblem(Problem):
    """Some device cannot measure."""

    lacks: list[LackDocument]


@router.get("/api/v1/devices", response_model=DeviceList, summary="List devices")
def list_devices(service: ServiceOf) -> object:
    """All devices at this moment."""
    return {"devices": [service.device_document(one) for one in service.instruments.values()]}


@router.get(
    "/api/v1/devices/{name}", response_model=DeviceDocument, responses=PROBLEMS, summary="Look at a device"
)
def get_device(name: DeviceName, service: ServiceOf) -> object:
    """One device."""
    return service.device_document(service.instrument(name))


@router.get(
    "/api/v1/devices/{name}/points",
    response_model=NewestPoints,
    responses=PROBLEMS,
    summary="The newest points",
)
def get_newest_points(name: DeviceName, service: ServiceOf) -> object:
    """The points of the newest measured field, with their standard deviations; 409 before the first."""
    return newest_points(service.instrument(name), service.clock)


@router.get(
    "/api/v1/devices/{name}/object",
    response_model=ObjectDocument,
    responses=PROBLEMS,
    summary="The object that is measured",
)
def get_object(name: DeviceName, service: ServiceOf) -> object:
    """The object model that the device measures with: every target's nominal place, row and column."""
    return object_document(service.instrument(name))


@router.get(
    "/api/v1/devices/{name}/pulsation",
    response_model=PulsationDocument,
    responses=PROBLEMS,
    summary="The pulsation that was measured last",
)
def get_pulsation(name: DeviceName, service: ServiceOf) -> object:
    """Pulsations a minute, as the analysis of the device's newest analysed capture found them."""
    return pulsation_document(service.analyses, service.instrument(name).name)


@router.get(
    "/api/v1/devices/{name}/light",
    response_model=LightDocument,
    responses=PROBLEMS,
    summary="How the picture is lit",
)
def get_light(
    name: DeviceName,
    service: ServiceOf,
    threshold: Annotated[
        int | None, Query(ge=0, le=254, description="Targets at this one; default: the one in force.")
    ] = None,
) -> object:
    """How the newest field is lit: for each view its histogram, its targets' number and mean size; what lamp
    and lens are set by. A new field five times a second at most.
    """
    return light_document(service.instrument(name), threshold)


@router.get(
    "/readyz",
    response_model=ReadyDocument,
    summary="Whether it can measure",
    responses={503: {"model": NotReadyProblem, "content": {"application/problem+json": {}}}},
)
def get_readiness(service: ServiceOf) -> object:
    """Whether every device streams, has a signal and can measure; 503 with what they lack."""
    lacks = _lacks(service)
    return _not_ready(lacks) if lacks else {}


def _lacks(service: Service) -> list[Lack]:
    return [lack for instrument in service.instruments.values() for lack in lacks_of(instrument)]


def _not_ready(lacks: list[Lack]) -> Response:
    detail = "; ".join(f"{lack.device}: {lack.message}" for lack in lacks)
    hint = "; ".join(dict.fromkeys(lack.hint for lack in lacks))
    return problem(
        503,
        "not-ready",
        detail,
        hint,
        {"lacks": [{"device": lack.device, **lack_document(lack)} for lack in lacks]},
    )
