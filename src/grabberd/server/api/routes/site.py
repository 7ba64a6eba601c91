"""The documentation: open to everybody, as it says nothing of the daemon's own state."""

from typing import Annotated

from fastapi import APIRouter, Header, Request, Response
from fastapi.responses import RedirectResponse
from starlette.concurrency import run_in_threadpool

from grabberd.errors import NotFound
from grabberd.server.api.etags import is_known
from grabberd.server.api.routes.page import whole
from grabberd.server.web import Site

API = "/api/v1/docs"
router = APIRouter(tags=["system"], include_in_schema=False)


@router.get("/docs")
async def get_site(request: Request) -> Response:
    """The documentation's first page, or the description of the API where an installation has none."""
    site: Site = request.app.state.site
    return RedirectResponse("/docs/" if await run_in_threadpool(lambda: site.is_built) else API, 307)


@router.get("/docs/{path:path}")
async def get_site_page(
    path: str,
    request: Request,
    accept_encoding: Annotated[str, Header()] = "",
    if_none_match: Annotated[str, Header()] = "",
) -> Response:
    """A page or another file of the documentation.

    Raises:
        NotFound: There is none at this address.
    """
    site: Site = request.app.state.site
    if await run_in_threadpool(site.is_folder, path):
        return RedirectResponse(f"/docs/{path}/", 307)
    found = await run_in_threadpool(site.find, path)
    if found is None:
        hint = (
            "its first page is /docs/" if site.is_built else "this installation has none: make site builds it"
        )
        raise NotFound(f"the documentation has no page {path!r}", hint)
    headers = {"ETag": found.file.etag, "Cache-Control": "no-cache", "Vary": "Accept-Encoding"}
    if found.policy:
        headers["Content-Security-Policy"] = found.policy
    if is_known(found.file.etag, if_none_match):
        return Response(status_code=304, headers=headers)
    return whole(found.file, headers, "gzip" in accept_encoding)
