"""What a client has already is not sent again."""

import hashlib
from collections.abc import Mapping
from typing import Annotated, Any

from fastapi import Header, Response, status

IfNoneMatch = Annotated[str | None, Header(description="ETag of what you have: 304 where it is the same.")]

NOT_MODIFIED: dict[int | str, dict[str, Any]] = {304: {"description": "It is the one you have."}}
IMMUTABLE = "private, max-age=31536000, immutable"
"""Never asked for again."""
ASK_AGAIN = "private, no-cache"
"""Kept, but asked for with its ETag."""


def etag_of(content: bytes) -> str:
    """Of these bytes."""
    return f'"{hashlib.sha256(content).hexdigest()}"'


def is_known(etag: str, if_none_match: str | None) -> bool:
    """Whether the client has it, after RFC 9110 13.1.2."""
    known = [tag.strip().removeprefix("W/") for tag in (if_none_match or "").split(",")]
    return etag in known or "*" in known


def tagged(
    content: bytes,
    media_type: str,
    if_none_match: str | None,
    cache: str = ASK_AGAIN,
    headers: Mapping[str, str] | None = None,
) -> Response:
    """The content with its ETag, or 304."""
    own = {**(headers or {}), "ETag": etag_of(content), "Cache-Control": cache}
    if is_known(own["ETag"], if_none_match):
        return Response(status_code=status.HTTP_304_NOT_MODIFIED, headers=own)
    return Response(content, media_type=media_type, headers=own)
