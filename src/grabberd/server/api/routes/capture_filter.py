"""Query parameters that select captures and their order."""

from collections.abc import Iterable
from dataclasses import replace
from datetime import UTC, datetime
from typing import Annotated
from urllib.parse import quote, unquote
from zoneinfo import ZoneInfo

from fastapi import Depends, Query
from pydantic import AfterValidator, StringConstraints

from grabberd.archive.catalogue.capture_query import CaptureQuery, Order, Position
from grabberd.clock import iso_utc
from grabberd.documents.document import ListedVerdict
from grabberd.errors import InputError


def _in_utc(moment: datetime) -> datetime:
    """A time in UTC; a time without a zone is taken as UTC."""
    try:
        return moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)
    except OverflowError:
        raise ValueError("in UTC, this time is outside the years 1 to 9999") from None


Moment = Annotated[datetime, AfterValidator(_in_utc)]
Named = Annotated[str, StringConstraints(pattern=r"^[^=\n]{1,200}=[^\n]{1,200}$")]
ListCursor = Annotated[
    str | None,
    Query(pattern=r"^[!-}]{0,800}~[0-9A-Za-z_.%-]{1,200}$", description="`next` of the previous page."),
]
Zone = Annotated[
    str, Query(pattern=r"^[0-9A-Za-z_+/-]{1,64}$", description="Time zone of days and names, as Europe/Oslo.")
]


async def _time_and_words(
    device: Annotated[str | None, Query(max_length=200, description="Only captures of this device.")] = None,
    since: Annotated[Moment | None, Query(description="Only captures that started then or later.")] = None,
    until: Annotated[Moment | None, Query(description="Only captures that started before.")] = None,
    search: Annotated[
        str | None,
        Query(
            max_length=200,
            description="Only captures with all of these words in note or labels, or as the id's begin.",
        ),
    ] = None,
    sort: Annotated[
        str,
        Query(
            max_length=210,
            pattern=r"^-?(time|length|losses|size|label\.[^\n]+)$",
            description="time, length, losses, size or label.NAME; with a minus before it from the greatest "
            "down. What is not known of a capture comes last.",
        ),
    ] = "-time",
) -> CaptureQuery:
    # Async although it awaits nothing: FastAPI calls other dependencies in threads.
    return CaptureQuery(
        device=device,
        since_utc=None if since is None else iso_utc(since),
        until_utc=None if until is None else iso_utc(until),
        search=search,
        order=Order.of(sort),
    )


async def _filter(
    matching: Annotated[CaptureQuery, Depends(_time_and_words)],
    pinned: Annotated[bool | None, Query(description="Only pinned captures, or only unpinned ones.")] = None,
    analysed: Annotated[
        bool | None, Query(description="Only captures that have an analysis, or only those without.")
    ] = None,
    measured: Annotated[
        bool | None, Query(description="Only captures that have points, or only those without.")
    ] = None,
    verdict: Annotated[
        list[ListedVerdict] | None, Query(max_length=3, description="Only with one of these verdicts.")
    ] = None,
    calibration: Annotated[
        list[str] | None,
        Query(max_length=50, description="Only those whose newest run was made with one of these."),
    ] = None,
    label: Annotated[
        list[Named] | None,
        Query(
            max_length=50,
            description="NAME=VALUE: only captures with that label; of several with one name any will do.",
        ),
    ] = None,
) -> CaptureQuery:
    return replace(
        matching,
        pinned=pinned,
        analysed=analysed,
        measured=measured,
        verdicts=tuple(verdict or ()),
        calibrations=tuple(calibration or ()),
        labels=_labels(label or ()),
    )


Filter = Annotated[CaptureQuery, Depends(_filter)]


def position_in(order: Order, cursor: str | None) -> Position | None:
    """The position of a cursor; None without one.

    Raises:
        InputError: It is the cursor of a list in another order.
    """
    if cursor is None:
        return None
    key, _, own_id = cursor.rpartition("~")
    return order.position(unquote(key), unquote(own_id))


def cursor_at(position: Position | None) -> str | None:
    """The cursor of the page after a position; None if there is none."""
    if position is None:
        return None
    key = quote(str(position.key), safe=":").replace("~", "%7E")
    return f"{key}~{quote(position.id, safe='').replace('~', '%7E')}"


def zone_of(name: str) -> ZoneInfo:
    """A time zone by its name.

    Raises:
        InputError: The name is unknown.
    """
    try:
        return ZoneInfo(name)
    except (ValueError, OSError, KeyError):
        raise InputError(f"there is no time zone {name!r}", "name one such as Europe/Oslo, or UTC") from None


def _labels(named: Iterable[str]) -> dict[str, tuple[str, ...]]:
    labels: dict[str, tuple[str, ...]] = {}
    for one in named:
        name, _, value = one.partition("=")
        labels[name] = (*labels.get(name, ()), value)
    return labels
