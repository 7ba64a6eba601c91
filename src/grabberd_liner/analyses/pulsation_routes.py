"""Latest pulsation rate of the liner before a device."""

from fastapi import APIRouter

from grabberd.server.api.readings import reads
from grabberd.server.api.responses import RenderedRoute
from grabberd.server.api.routes.dependencies import PROBLEMS, DeviceName, ServiceOf
from grabberd_liner.analyses.documents import PulsationDocument
from grabberd_liner.analyses.store import pulsation_document
from grabberd_liner.part import liner_of

router = APIRouter(prefix="/devices", tags=["devices"], route_class=RenderedRoute)


@router.get("/{name}/pulsation", responses=PROBLEMS, summary="Get the latest pulsation rate")
@reads
def get_pulsation(name: DeviceName, service: ServiceOf) -> PulsationDocument:
    """Pulsations per minute, from the analysis of the device's newest analysed capture."""
    return pulsation_document(liner_of(service).analyses, service.instrument(name).name)
