"""Browser sessions: a token, sent once, is traded for a cookie that no page can read."""

from fastapi import APIRouter, Request, Response, status

from grabberd.archive.access import SESSION_LIFE, Identity
from grabberd.documents.access import SessionDocument
from grabberd.server.api.guard.authentication import COOKIE, Credentials, IdentityOf
from grabberd.server.api.guard.front import Front
from grabberd.server.api.rendering import RenderedRoute
from grabberd.server.api.routes.dependencies import PROBLEMS, ServiceOf

router = APIRouter(prefix="/session", tags=["session"], responses=PROBLEMS, route_class=RenderedRoute)


@router.post(
    "",
    status_code=status.HTTP_201_CREATED,
    summary="Open a session",
)
def open_session(
    identity: IdentityOf, service: ServiceOf, request: Request, response: Response
) -> SessionDocument:
    """Trade a bearer token for a session: a cookie that is valid for thirty days, or until the token is
    removed or expires.
    """
    secret = service.access.open_session(identity)
    _set_cookie(response, request, secret, round(SESSION_LIFE.total_seconds()))
    return session_document(identity).model_copy(update={"by": "session"})


@router.get("", summary="Look up your identity and role")
def get_session(identity: IdentityOf) -> SessionDocument:
    """Your identity and role, as the daemon knows them."""
    return session_document(identity)


@router.delete("", status_code=status.HTTP_204_NO_CONTENT, summary="End the session")
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
