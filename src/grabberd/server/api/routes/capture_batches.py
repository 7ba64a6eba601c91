"""Several captures at once: annotate and delete."""

from fastapi import APIRouter

from grabberd.archive.catalogue.batches import for_each
from grabberd.documents.capture_library import BatchDocument, CaptureSelection, CapturesPatch
from grabberd.server.api.idempotency import OnceRoute
from grabberd.server.api.routes.dependencies import PROBLEMS, ServiceOf

router = APIRouter(prefix="/captures", tags=["captures"], responses=PROBLEMS, route_class=OnceRoute)


@router.patch("", summary="Pin or annotate several captures")
def patch_captures(patch: CapturesPatch, service: ServiceOf) -> BatchDocument:
    """Change notes, labels or pins of up to a hundred captures; those that fail are named with the reason."""

    def annotate(capture_id: str) -> None:
        service.annotations.annotate(capture_id, pinned=patch.pinned, note=patch.note, labels=patch.labels)

    return for_each(patch.captures, annotate)


@router.post("/deletion", summary="Delete several captures")
def delete_captures(selection: CaptureSelection, service: ServiceOf) -> BatchDocument:
    """Delete up to a hundred captures and their files permanently. Those that are armed, running, pinned or
    used by a job stay, and are named with the reason.
    """
    return for_each(selection.captures, service.annotations.delete)
