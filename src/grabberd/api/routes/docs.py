"""The API's own page: made of its description, by the daemon itself."""

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse

from grabberd.api.docs.docs_page import POLICY, page

router = APIRouter(tags=["system"])


@router.get("/docs", response_class=HTMLResponse, summary="The API as a page")
def get_docs(request: Request) -> HTMLResponse:
    """This description as a page to read; it needs nothing from any other host."""
    return HTMLResponse(page(request.app.openapi()), headers={"Content-Security-Policy": POLICY})
