"""The diagnostics, for whoever administers the daemon."""

from typing import Annotated

from fastapi import APIRouter, Query, Response

from grabberd.api.routes.dependencies import ServiceOf
from grabberd.service.diagnostics import bundle, daemon_parts

router = APIRouter(tags=["system"])

ZIP = "application/zip"


@router.get(
    "/diagnostics",
    response_class=Response,
    responses={200: {"content": {ZIP: {}}}},
    summary="What a helper has to know",
)
def get_diagnostics(
    service: ServiceOf,
    words: Annotated[bool, Query(description="With labels, notes and the site's name.")] = False,
) -> Response:
    """One ZIP file to send to whoever helps: versions, grabbers, configuration without secrets, devices,
    captures with their ledgers, jobs, the last lines of the log. No pictures, tokens or certificates.
    """
    headers = {
        "Content-Disposition": 'attachment; filename="grabberd-diagnostics.zip"',
        "Cache-Control": "no-store",
    }
    return Response(bundle(daemon_parts(service, words=words), words=words), media_type=ZIP, headers=headers)
