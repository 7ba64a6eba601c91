"""Long lists, page by page."""

from collections.abc import Callable, Sequence
from typing import Annotated, TypeVar

from fastapi import Query

T = TypeVar("T")

Limit = Annotated[int, Query(ge=1, le=500, description="So many at most.")]
Cursor = Annotated[
    str | None,
    Query(pattern=r"^[!-}]{0,40}~[0-9A-Za-z_.-]{1,200}$", description="`next` of the page before."),
]
"""When something was made, and its id: what comes or goes meanwhile shifts no page."""


def cursor_of(created_utc: str, own_id: str) -> str:
    """Of the last one of a page."""
    return f"{created_utc}~{own_id}"


def place_of(cursor: str) -> tuple[str, str]:
    """When that was made, and its id."""
    created_utc, _, own_id = cursor.partition("~")
    return created_utc, own_id


def page_of(
    rows: Sequence[T], place: Callable[[T], tuple[str, str]], limit: int, cursor: str | None
) -> tuple[list[T], str | None]:
    """A page of rows, those with the greatest place first, and the next page's cursor."""
    after = None if cursor is None else place_of(cursor)
    ordered = sorted(rows, key=place, reverse=True)
    left = [row for row in ordered if after is None or place(row) < after]
    more = len(left) > limit
    return left[:limit], cursor_of(*place(left[limit - 1])) if more else None
