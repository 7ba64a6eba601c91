"""State and health."""

from fastapi import APIRouter

from grabberd import __version__
from grabberd.api.routes.dependencies import ServiceOf
from grabberd.api.routes.state_models import HealthDocument, StateDocument

router = APIRouter(tags=["system"])


@router.get("/api/v1/state", response_model=StateDocument, summary="Everything that a glance needs")
def get_state(service: ServiceOf) -> object:
    """Everything that a glance needs: devices, ring, newest points, storage."""
    return service.state()


@router.get("/healthz", response_model=HealthDocument, summary="Whether it serves")
def get_health() -> object:
    """The daemon serves, whatever its devices do."""
    return {"version": __version__}
