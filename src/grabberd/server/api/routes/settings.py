"""Settings that an operator can change, and the configuration they are based on."""

from fastapi import APIRouter

from grabberd.documents.named_types import JsonObject
from grabberd.documents.requests import SettingsRequest
from grabberd.documents.settings import SettingsDocument
from grabberd.server.api.rendering import RenderedRoute
from grabberd.server.api.routes.dependencies import PROBLEMS, ServiceOf

router = APIRouter(tags=["settings"], route_class=RenderedRoute)


@router.get("/settings", summary="Get the settings")
def get_settings(service: ServiceOf) -> SettingsDocument:
    """The active settings: those of the configuration, or those set in their place."""
    return service.settings.document()


@router.put("/settings", responses=PROBLEMS, summary="Set the threshold")
def put_settings(new: SettingsRequest, service: ServiceOf) -> SettingsDocument:
    """Set how a device's threshold is determined. The setting survives restarts; 409 during a capture."""
    service.settings.set_threshold(service.instrument(new.device), new.threshold)
    return service.settings.document()


@router.get("/config", response_model=JsonObject, summary="Get the configuration")
def get_config(service: ServiceOf) -> object:
    """The configuration as it was read, without secrets."""
    return service.configuration
