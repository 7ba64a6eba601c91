"""The operator's page: public, but it shows the daemon's state only to clients with access."""

from typing import Annotated

from fastapi import APIRouter, Header, Request, Response
from starlette.concurrency import run_in_threadpool

from grabberd import __version__
from grabberd.archive.access import Identity
from grabberd.clock import iso_utc
from grabberd.documents.named_types import JsonObject
from grabberd.errors import NotFound
from grabberd.server.api.etags import is_known
from grabberd.server.api.guard.authentication import Authenticator
from grabberd.server.api.guard.refusals import Refusal
from grabberd.server.api.rendering import RenderedRoute
from grabberd.server.api.routes.sessions import session_document
from grabberd.server.daemon.service import Service
from grabberd.server.web import POLICY, Files, StaticFile, language_of, render

FOREVER = "public, max-age=31536000, immutable"
"""Allowed because the address contains the version."""
HTML = "text/html; charset=utf-8"

router = APIRouter(tags=["system"], include_in_schema=False, route_class=RenderedRoute)


@router.get("/")
async def get_page(
    request: Request,
    accept_language: Annotated[str, Header()] = "",
    accept_encoding: Annotated[str, Header()] = "",
) -> Response:
    """The page, with the present state embedded in it."""
    identity, headers = await _who_asks(request)
    first = await run_in_threadpool(_first, request.app.state.service, identity)
    files: Files = request.app.state.files
    edition = await run_in_threadpool(files.newest)
    content = render(edition, language_of(accept_language), first).encode()
    own = {
        "Content-Security-Policy": POLICY,
        "Cache-Control": "no-store",
        "Vary": "Cookie, Accept-Encoding, Accept-Language",
    }
    return whole(StaticFile(HTML, content), own | headers, "gzip" in accept_encoding)


@router.get("/static/{version}/{path:path}")
async def get_static(
    version: str,
    path: str,
    request: Request,
    accept_encoding: Annotated[str, Header()] = "",
    if_none_match: Annotated[str, Header()] = "",
) -> Response:
    """One of the page's files; an address of an earlier version gets the present file, without caching.

    The files are in memory and a page requests fifty at once, so they are served without a thread for each.

    Raises:
        NotFound: the page has no file of that name.
    """
    files: Files = request.app.state.files
    edition = files.edition if files.is_read else await run_in_threadpool(files.newest)
    found = edition.files.get(path)
    if found is None:
        raise NotFound(f"the page has no file {path!r}", "reload the page")
    kept = FOREVER if version == edition.version else "no-cache"
    headers = {"ETag": found.etag, "Cache-Control": kept, "Vary": "Accept-Encoding"}
    if is_known(found.etag, if_none_match):
        return Response(status_code=304, headers=headers)
    return whole(found, headers, "gzip" in accept_encoding)


def whole(found: StaticFile, headers: dict[str, str], compressed: bool) -> Response:
    """A file as an answer, compressed for a client that takes it so."""
    if not compressed:
        return Response(found.content, media_type=found.media_type, headers=headers)
    return Response(
        found.compressed, media_type=found.media_type, headers={**headers, "Content-Encoding": "gzip"}
    )


async def _who_asks(request: Request) -> tuple[Identity | None, dict[str, str]]:
    """The client, if the daemon knows it, and headers that delete an invalid cookie."""
    authenticator: Authenticator = request.app.state.authenticator
    try:
        return await authenticator.identify(request.scope), {}
    except Refusal as refusal:
        kept = {name: words for name, words in (refusal.headers or {}).items() if name == "Set-Cookie"}
        return None, kept


def _first(service: Service, identity: Identity | None) -> JsonObject:
    """The data that the page shows before its first request."""
    seen = {"version": __version__, "now_utc": iso_utc(service.clock.utc_now())}
    if identity is None:
        return {**seen, "session": None, "state": None}
    session = session_document(identity).model_dump(mode="json")
    return {**seen, "session": session, "state": service.state().model_dump(mode="json")}
