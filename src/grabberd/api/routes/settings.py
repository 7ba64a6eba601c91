"""What an operator sets, and the configuration that it stands on."""

from fastapi import APIRouter
from pydantic import Field

from grabberd.api.routes.dependencies import PROBLEMS, ServiceOf
from grabberd.api.routes.models import Document, shown
from grabberd.api.routes.named_types import JsonObject
from grabberd.config import ThresholdConfig

router = APIRouter(tags=["settings"])


class DeviceSettings(Document):
    """What is in force for a device."""

    threshold: ThresholdConfig
    as_configured: bool = Field(description="Nothing else was set.")


class SettingsDocument(Document):
    """What is in force, device by device."""

    devices: dict[str, DeviceSettings]


class SettingsOrder(Document):
    """What is to be in force for a device from now on."""

    model_config = shown({"threshold": {"kind": "fixed", "value": 96}})

    device: str | None = Field(None, description="Name of the device; not needed where there is one.")
    threshold: ThresholdConfig | None = Field(description="null: as it is configured.")


@router.get("/settings", response_model=SettingsDocument, summary="What is set")
def get_settings(service: ServiceOf) -> object:
    """What is in force: the configuration, or what was set in its place."""
    return service.settings.document()


@router.put("/settings", response_model=SettingsDocument, responses=PROBLEMS, summary="Set the threshold")
def put_settings(order: SettingsOrder, service: ServiceOf) -> object:
    """Set how a device's threshold is found; kept over restarts, refused with 409 during a capture."""
    service.settings.set_threshold(service.instrument(order.device), order.threshold)
    return service.settings.document()


@router.get("/config", response_model=JsonObject, summary="The configuration")
def get_config(service: ServiceOf) -> object:
    """The configuration as it was read, without what is secret in it."""
    return service.configuration
