"""A browser's session: it shows its token once, and keeps a cookie that no page can read."""

from dataclasses import asdict
from typing import Literal

from fastapi import APIRouter, Request, Response, status
from pydantic import Field

from grabberd.api.guard.authentication import COOKIE, Credentials, IdentityOf
from grabberd.api.guard.front import Front
from grabberd.api.routes.dependencies import PROBLEMS, ServiceOf
from grabberd.api.routes.models import Document, shown
from grabberd.service.access import SESSION_LIFE
from grabberd.service.roles import Role

router = APIRouter(prefix="/session", tags=["session"], responses=PROBLEMS)


class SessionDocument(Document):
    """Who asks, and what they may; at the machine itself there need be no token."""

    model_config = shown({"role": "operator", "by": "session", "token": "tablet-north", "expires_utc": None})

    role: Role
    by: Literal["token", "session", "socket", "machine"]
    token: str | None = Field(description="Name of the token.")
    expires_utc: str | None = Field(description="The token is good until then; None: until it is removed.")


@router.post(
    "",
    status_code=status.HTTP_201_CREATED,
    response_model=SessionDocument,
    summary="Trade a token for a session",
)
def open_session(identity: IdentityOf, service: ServiceOf, request: Request, response: Response) -> object:
    """Trade a bearer token for a session: a cookie for thirty days, or until the token is removed
    or expires.
    """
    secret = service.access.open_session(identity)
    _set_cookie(response, request, secret, round(SESSION_LIFE.total_seconds()))
    return {**asdict(identity), "by": "session"}


@router.get("", response_model=SessionDocument, summary="Who you are")
def get_session(identity: IdentityOf) -> object:
    """Who you are to the daemon, and what you may."""
    return asdict(identity)


@router.delete("", status_code=status.HTTP_204_NO_CONTENT, summary="End the session")
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
