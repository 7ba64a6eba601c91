"""What an operator sets, and the configuration that it stands on."""

from typing import Any

from fastapi import APIRouter
from pydantic import Field

from grabberd.api.models import Document
from grabberd.api.of_service import PROBLEMS, ServiceOf
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

    device: str | None = Field(None, description="Name of the device; not needed where there is one.")
    threshold: ThresholdConfig | None = Field(description="null: as it is configured.")


@router.get("/settings", response_model=SettingsDocument)
def get_settings(service: ServiceOf) -> object:
    """What is in force: the configuration, or what was set in its place."""
    return service.settings.document()


@router.put("/settings", response_model=SettingsDocument, responses=PROBLEMS)
def put_settings(order: SettingsOrder, service: ServiceOf) -> object:
    """Set how a device's threshold is found; kept over restarts, refused with 409 during a capture."""
    service.settings.set_threshold(service.instrument(order.device), order.threshold)
    return service.settings.document()


@router.get("/config", response_model=dict[str, Any])
def get_config(service: ServiceOf) -> object:
    """The configuration as it was read, without what is secret in it."""
    return service.configuration
