"""Several captures at once: analyse."""

from fastapi import APIRouter, status

from grabberd.archive.catalogue.capture_list import for_each
from grabberd.documents.captures import BatchDocument, CaptureSelection
from grabberd.server.api.idempotency import TAKES_KEY, OnceRoute
from grabberd.server.api.routes.dependencies import PROBLEMS, ServiceOf
from grabberd_liner.analyses.documents import AnalysisRequest
from grabberd_liner.analyses.routes import queue_analysis

router = APIRouter(prefix="/captures", tags=["captures"], responses=PROBLEMS, route_class=OnceRoute)
_WITH_PROFILES = AnalysisRequest(profiles=True)


@router.post(
    "/analysis",
    status_code=status.HTTP_202_ACCEPTED,
    dependencies=[TAKES_KEY],
    summary="Analyse several captures",
)
def analyse_captures(selection: CaptureSelection, service: ServiceOf) -> BatchDocument:
    """Queue an analysis of each of up to a hundred captures, with the inputs that the profiles of its labels
    give.
    """
    return for_each(selection.captures, lambda one: queue_analysis(service, one, _WITH_PROFILES).id)
