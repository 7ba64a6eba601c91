"""Long lists, page by page."""

from collections.abc import Callable, Sequence
from typing import Annotated, TypeVar

from fastapi import Query

T = TypeVar("T")

Limit = Annotated[int, Query(ge=1, le=500, description="Maximum number of results.")]
Cursor = Annotated[
    str | None,
    Query(pattern=r"^[!-}]{0,40}~[0-9A-Za-z_.-]{1,200}$", description="`next` of the previous page."),
]
"""Creation time and id of the previous page's last entry, so that entries that come or go do not shift the
pages, as they would if pages were counted."""


def cursor_of(created_utc: str, own_id: str) -> str:
    """Cursor of the page that follows an entry."""
    return f"{created_utc}~{own_id}"


def position_of(cursor: str) -> tuple[str, str]:
    """Creation time and id in a cursor."""
    created_utc, _, own_id = cursor.partition("~")
    return created_utc, own_id


def page_of(
    rows: Sequence[T], position: Callable[[T], tuple[str, str]], limit: int, cursor: str | None
) -> tuple[list[T], str | None]:
    """A page of rows, the greatest position first, and the next page's cursor."""
    after = None if cursor is None else position_of(cursor)
    descending = sorted(rows, key=position, reverse=True)
    left = [row for row in descending if after is None or position(row) < after]
    more = len(left) > limit
    return left[:limit], cursor_of(*position(left[limit - 1])) if more else None
