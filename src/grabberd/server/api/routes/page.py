"""The operator's page, browser sessions, and the documentation.

The page is public, but shows the daemon's state only to clients with access: a token, sent once, is traded
for a cookie that no script can read. The documentation contains nothing of that state and is public, too.
"""

from typing import Annotated

from fastapi import APIRouter, Header, Request, Response, status
from fastapi.responses import RedirectResponse
from starlette.concurrency import run_in_threadpool

from grabberd import __version__
from grabberd.archive.access import SESSION_LIFE, Identity
from grabberd.documents.document import JsonObject
from grabberd.documents.state import SessionDocument
from grabberd.errors import NotFound
from grabberd.runtime import iso_utc
from grabberd.server.api.guard.authentication import COOKIE, Authenticator, Credentials, IdentityOf
from grabberd.server.api.guard.front import Front
from grabberd.server.api.problems import Refusal
from grabberd.server.api.responses import RenderedRoute, is_known
from grabberd.server.api.routes.dependencies import PROBLEMS, ServiceOf
from grabberd.server.daemon.service import Service
from grabberd.server.web import POLICY, Files, Site, StaticFile, language_of, render

session_router = APIRouter(prefix="/session", tags=["session"], responses=PROBLEMS, route_class=RenderedRoute)


@session_router.post("", status_code=status.HTTP_201_CREATED, summary="Open a session")
def open_session(
    identity: IdentityOf, service: ServiceOf, request: Request, response: Response
) -> SessionDocument:
    """Trade a bearer token for a session: a cookie that is valid for thirty days, or until the token is
    removed or expires.
    """
    secret = service.access.open_session(identity)
    _set_cookie(response, request, secret, round(SESSION_LIFE.total_seconds()))
    return session_document(identity).model_copy(update={"by": "session"})


@session_router.get("", summary="Look up your identity and role")
def get_session(identity: IdentityOf) -> SessionDocument:
    """Your identity and role, as the daemon knows them."""
    return session_document(identity)


@session_router.delete("", status_code=status.HTTP_204_NO_CONTENT, summary="End the session")
def close_session(service: ServiceOf, request: Request, response: Response) -> None:
    """End this browser's session."""
    if secret := Credentials.of(request.scope).session:
        service.access.close_session(secret)
    _set_cookie(response, request, "", 0)


def session_document(identity: Identity) -> SessionDocument:
    """An identity as a document."""
    return SessionDocument.model_validate(identity, from_attributes=True)


def _set_cookie(response: Response, request: Request, secret: str, max_age_s: int) -> None:
    front: Front = request.app.state.front
    secure = front.tls or request.url.scheme == "https"  # a proxy may have the certificate
    response.set_cookie(COOKIE, secret, max_age_s, path="/", secure=secure, httponly=True, samesite="strict")


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
    return sent(StaticFile(HTML, content), own | headers, accept_encoding)


@router.get("/static/{version}/{path:path}")
async def get_static(
    version: str,
    path: str,
    request: Request,
    accept_encoding: Annotated[str, Header()] = "",
    if_none_match: Annotated[str, Header()] = "",
) -> Response:
    """One of the page's files; the URL of an earlier version returns the present file, without caching.

    The files are in memory and a page requests fifty at once, so they are served without threads.

    Raises:
        NotFound: The page has no such file.
    """
    files: Files = request.app.state.files
    if (edition := files.edition) is None:
        edition = await run_in_threadpool(files.newest)
    found = edition.files.get(path)
    if found is None:
        raise NotFound(f"the page has no file {path!r}", "reload the page")
    kept = FOREVER if version == edition.version else "no-cache"
    headers = {"ETag": found.etag, "Cache-Control": kept, "Vary": "Accept-Encoding"}
    return sent(found, headers, accept_encoding, if_none_match)


def sent(
    file: StaticFile, headers: dict[str, str], accept_encoding: str, if_none_match: str | None = None
) -> Response:
    """The response with a file, compressed if the client accepts that; 304 if the client has it."""
    if if_none_match is not None and is_known(file.etag, if_none_match):
        return Response(status_code=304, headers=headers)
    if "gzip" not in accept_encoding:
        return Response(file.content, media_type=file.media_type, headers=headers)
    headers = {**headers, "Content-Encoding": "gzip"}
    return Response(file.compressed, media_type=file.media_type, headers=headers)


async def _who_asks(request: Request) -> tuple[Identity | None, dict[str, str]]:
    """The client's identity, if known, and headers that delete an invalid cookie."""
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


API = "/api/v1/docs"


@router.get("/docs")
async def get_site(request: Request) -> Response:
    """The documentation's first page, or the API description if no documentation is installed."""
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
        NotFound: There is no such file.
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
    return sent(found.file, headers, accept_encoding, if_none_match)
