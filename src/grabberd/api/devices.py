"""The devices at this moment, and whether they can measure."""

from typing import Annotated, Literal

from fastapi import APIRouter, Path
from fastapi.responses import Response

from grabberd.api.models import DeviceDocument, Document
from grabberd.api.of_service import PROBLEMS, ServiceOf
from grabberd.api.problems import Problem, problem
from grabberd.service.readiness import Lack, lacks_of
from grabberd.service.service import Service

router = APIRouter(tags=["devices"])

DeviceName = Annotated[str, Path(max_length=32, description="Name of the device.")]


class DeviceList(Document):
    """The devices, as they stand in the configuration."""

    devices: list[DeviceDocument]


class LackDocument(Document):
    """What keeps a device from measuring."""

    device: str
    lacks: Literal["device", "signal", "calibration"]
    message: str
    hint: str


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
    return problem(503, "not-ready", detail, hint, {"lacks": [lack._asdict() for lack in lacks]})
