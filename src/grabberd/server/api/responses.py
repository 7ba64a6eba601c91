"""Responses: documents rendered as JSON in the thread that made them, and conditional responses by ETag."""

import hashlib
import inspect
from collections.abc import Callable
from functools import wraps
from typing import Annotated, Any

from fastapi import Header, Response, status
from fastapi.routing import APIRoute
from pydantic import BaseModel

JSON = "application/json"


def rendered(found: Any) -> Any:
    """The response with a document; anything else unchanged."""
    if isinstance(found, BaseModel):
        return Response(found.model_dump_json(by_alias=True), media_type=JSON)
    return found


class RenderedRoute(APIRoute):
    """A route whose GET requests are validated and rendered once, in one thread.

    FastAPI would validate the document again in a second thread, and would render the JSON in the event loop,
    blocking all other requests: a field's points are hundreds of numbers.
    """

    def __init__(self, path: str, endpoint: Callable[..., Any], **options: Any) -> None:
        only_gets = set(options.get("methods") or ()) == {"GET"}
        if only_gets and not inspect.iscoroutinefunction(endpoint):
            endpoint = _rendering(endpoint)
        super().__init__(path, endpoint, **options)


def _rendering(endpoint: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(endpoint)
    def render(*args: Any, **parameters: Any) -> Any:
        return rendered(endpoint(*args, **parameters))

    return render


Responses = dict[int | str, dict[str, Any]]
"""Descriptions of a route's responses, by status, as FastAPI takes them."""
IfNoneMatch = Annotated[str | None, Header(description="ETag of the client's copy; 304 if it is current.")]

NOT_MODIFIED: Responses = {304: {"description": "The client's copy is current."}}
IMMUTABLE = "private, max-age=31536000, immutable"
"""Cache-Control of content that never changes."""
REVALIDATE = "private, no-cache"
"""Cache-Control of content that is cached, but revalidated with its ETag."""


def etag_of(content: bytes) -> str:
    """ETag of some content."""
    return f'"{hashlib.sha256(content).hexdigest()}"'


def is_known(etag: str, if_none_match: str | None) -> bool:
    """True if the client has it, according to RFC 9110 13.1.2."""
    known = [tag.strip().removeprefix("W/") for tag in (if_none_match or "").split(",")]
    return etag in known or "*" in known


def tagged(
    content: bytes,
    media_type: str,
    if_none_match: str | None,
    cache: str = REVALIDATE,
    etag: str | None = None,
) -> Response:
    """The content with its ETag, which may be known already, or 304 if the client has it."""
    own = {"ETag": etag or etag_of(content), "Cache-Control": cache}
    if is_known(own["ETag"], if_none_match):
        return Response(status_code=status.HTTP_304_NOT_MODIFIED, headers=own)
    return Response(content, media_type=media_type, headers=own)
