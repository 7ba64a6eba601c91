"""A browser's session: it shows its token once, and keeps a cookie that no page can read."""

from typing import Literal

from fastapi import APIRouter, Request, Response, status

from grabberd.api.auth import COOKIE, Credentials, IdentityOf
from grabberd.api.front import Front
from grabberd.api.models import Document
from grabberd.api.of_service import PROBLEMS, ServiceOf
from grabberd.service.access import SESSION_LIFE
from grabberd.service.roles import Role

router = APIRouter(prefix="/session", tags=["session"], responses=PROBLEMS)


class SessionDocument(Document):
    """Who asks, and what they may; at the machine itself there need be no token."""

    role: Role
    by: Literal["token", "session", "socket"]
    token: str | None


@router.post("", status_code=status.HTTP_201_CREATED, response_model=SessionDocument)
def open_session(identity: IdentityOf, service: ServiceOf, request: Request, response: Response) -> object:
    """Trade a bearer token for a session: a cookie for thirty days, or until the token is removed."""
    secret = service.access.open_session(identity)
    _set_cookie(response, request, secret, round(SESSION_LIFE.total_seconds()))
    return {"role": identity.role, "by": "session", "token": identity.token}


@router.get("", response_model=SessionDocument)
def get_session(identity: IdentityOf) -> object:
    """Who you are to the daemon, and what you may."""
    return {"role": identity.role, "by": identity.by, "token": identity.token}


@router.delete("", status_code=status.HTTP_204_NO_CONTENT)
def close_session(service: ServiceOf, request: Request, response: Response) -> None:
    """End the session of this browser."""
    if secret := Credentials.of(request.scope).session:
        service.access.close_session(secret)
    _set_cookie(response, request, "", 0)


def _set_cookie(response: Response, request: Request, secret: str, max_age_s: int) -> None:
    front: Front = request.app.state.front
    response.set_cookie(
        COOKIE, secret, max_age_s, path="/", secure=front.tls, httponly=True, samesite="strict"
    )
