"""Captures: start, arm, trigger, stop, list by query, look up, annotate, delete, re-measure.

Also several at once, and groups: captures of several devices that start at the same moment.
"""

from collections.abc import Generator, Iterable
from dataclasses import replace
from datetime import UTC, datetime
from typing import Annotated, Any, cast
from urllib.parse import quote, unquote
from zoneinfo import ZoneInfo

from fastapi import APIRouter, Depends, Path, Query, Request, Response, status
from fastapi.responses import StreamingResponse
from pydantic import AfterValidator, StringConstraints

from grabberd.archive.catalogue.capture_list import captures_csv, each_capture, for_each, list_document
from grabberd.archive.catalogue.capture_list import list_captures as page_of_captures
from grabberd.archive.catalogue.capture_query import CaptureQuery, Order, Position
from grabberd.archive.catalogue.capture_zip import captures_zip
from grabberd.archive.measure_setups import INCLUDE_DAMAGED
from grabberd.documents.captures import (
    MOST_AT_ONCE,
    BatchDocument,
    CaptureDocument,
    CaptureGroup,
    CaptureList,
    CaptureSelection,
    CapturesPatch,
)
from grabberd.documents.document import ListedVerdict
from grabberd.documents.jobs import JobDocument
from grabberd.documents.requests import (
    CaptureName,
    CapturePatch,
    MeasurementRequest,
    NewCapture,
    NewCaptureGroup,
)
from grabberd.errors import InputError, NotFound
from grabberd.library.jobs.measurement import MeasurementJob
from grabberd.runtime import iso_utc
from grabberd.server.api.readings import reads
from grabberd.server.api.responses import RenderedRoute
from grabberd.server.api.routes.dependencies import (
    ACCEPTED_ONCE,
    PROBLEMS,
    CaptureId,
    Limit,
    OnceRoute,
    ServiceOf,
    accepted,
)
from grabberd.server.api.streams.downloads import Download, download


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


router = APIRouter(prefix="/captures", tags=["captures"], responses=PROBLEMS, route_class=OnceRoute)


TableLimit = Annotated[int, Query(ge=1, le=10_000, description="Maximum number of rows.")]


@router.post("", **ACCEPTED_ONCE, summary="Start or arm a capture")
def start_capture(
    new: NewCapture, service: ServiceOf, request: Request, response: Response
) -> CaptureDocument:
    """Start a capture, or arm one that waits for its trigger. 409 with the id of the other capture while one
    is running or armed.
    """
    start = service.capture_control.arm if new.armed else service.capture_control.start
    capture = start(new.device, new)
    response.headers["Location"] = str(request.url_for("get_capture", capture_id=capture.id))
    return capture


@router.get("", summary="List captures")
@reads
def list_captures(
    service: ServiceOf,
    matching: Filter,
    limit: Limit = 100,
    cursor: ListCursor = None,
    facets: Annotated[bool, Query(description="Count the values of what captures have in common.")] = False,
    zone: Zone = "UTC",
) -> CaptureList:
    """Captures, newest first unless sorted otherwise, page by page. Captures added or deleted meanwhile do
    not shift the pages. A page ends before its limit if it has 4 MB.
    """
    days_in = zone_of(zone) if facets else None
    query = replace(matching, limit=limit, after=position_in(matching.order, cursor))
    return list_document(page_of_captures(service.archive, query, days_in), cursor_at)


@router.get(
    ".csv",
    response_class=Response,
    summary="List captures as CSV",
    responses={200: {"content": {"text/csv": {}}}},
)
@reads
def list_captures_as_csv(service: ServiceOf, matching: Filter, limit: TableLimit = 1000) -> Response:
    """Captures, newest first unless sorted otherwise, one row each: verdicts, labels, and the main quantities
    of the latest analysis with their standard deviations.
    """
    text = captures_csv(each_capture(service.archive, replace(matching, limit=limit)))
    headers = {"Content-Disposition": 'attachment; filename="captures.csv"'}
    return Response(text, media_type="text/csv; charset=utf-8", headers=headers)


@router.get("/{capture_id}", summary="Look up a capture")
@reads
def get_capture(capture_id: CaptureId, service: ServiceOf) -> CaptureDocument:
    """One capture with the beginning of its ledger."""
    return service.archive.document(capture_id)


@router.patch("/{capture_id}", summary="Pin or annotate a capture")
def patch_capture(capture_id: CaptureId, patch: CapturePatch, service: ServiceOf) -> CaptureDocument:
    """Change the note, the labels, the marks or the pin. They are stored separately from the file, which is
    not modified.
    """
    service.annotations.annotate(
        capture_id, pinned=patch.pinned, note=patch.note, labels=patch.labels, marks=patch.marks
    )
    return service.archive.document(capture_id)


@router.delete(
    "/{capture_id}",
    status_code=status.HTTP_204_NO_CONTENT,
    response_class=Response,
    summary="Delete a capture",
)
def delete_capture(capture_id: CaptureId, service: ServiceOf) -> None:
    """Delete a capture and its file permanently. 409 while it is armed, running, pinned or used by a job."""
    service.annotations.delete(capture_id)


@router.post("/{capture_id}/trigger", **ACCEPTED_ONCE, summary="Trigger an armed capture")
def trigger_capture(capture_id: CaptureId, service: ServiceOf) -> CaptureDocument:
    """Start recording an armed capture, including its pre-trigger fields, and all others of its
    group with it. 409 if it is not armed.
    """
    service.capture_control.trigger(capture_id)
    return service.archive.document(capture_id)


@router.post("/{capture_id}/stop", status_code=status.HTTP_202_ACCEPTED, summary="Stop a capture")
def stop_capture(capture_id: CaptureId, service: ServiceOf) -> CaptureDocument:
    """Stop a running capture and seal its file. Nothing remains of an armed capture."""
    before = service.archive.document(capture_id)
    service.capture_control.stop(capture_id)
    return before.disarmed if before.state == "armed" else service.archive.document(capture_id)


@router.post("/{capture_id}/measure", **ACCEPTED_ONCE, summary="Re-measure a capture")
def measure_capture(
    capture_id: CaptureId,
    service: ServiceOf,
    request: Request,
    response: Response,
    options: MeasurementRequest | None = None,
) -> JobDocument:
    """Re-measure a sealed capture with the device's present calibration: a job that adds a run.

    Damaged fields are left out unless requested, fields without a signal always.
    """
    service.archive.sealed_path(capture_id)
    setup = service.instrument(service.archive.document(capture_id).device).setup
    made_with = dict(setup.made_with)
    if options is not None and options.include_damaged:
        made_with["settings"] = {**made_with["settings"], INCLUDE_DAMAGED: True}
    job = service.jobs.submit(MeasurementJob(subject=capture_id, made_with=made_with))
    return accepted(job, request, response)


@router.patch("", summary="Pin or annotate several captures")
def patch_captures(patch: CapturesPatch, service: ServiceOf) -> BatchDocument:
    """Change notes, labels or pins of up to a hundred captures; those that fail are named with the reason."""

    def annotate(capture_id: str) -> None:
        service.annotations.annotate(capture_id, pinned=patch.pinned, note=patch.note, labels=patch.labels)

    return for_each(patch.captures, annotate)


@router.post("/deletion", summary="Delete several captures")
def delete_captures(selection: CaptureSelection, service: ServiceOf) -> BatchDocument:
    """Delete up to a hundred captures and their files permanently. Those that are armed, running, pinned or
    used by a job stay, and are named with the reason.
    """
    return for_each(selection.captures, service.annotations.delete)


# A separate router: an extension inserts the routes of analyses before it.
zip_router = APIRouter(prefix="/captures", tags=["captures"], responses=PROBLEMS, route_class=RenderedRoute)


@zip_router.get(
    ".zip",
    response_class=StreamingResponse,
    summary="Download several captures",
    responses={200: {"content": {"application/zip": {}}}},
)
@reads
def get_captures_zip(
    service: ServiceOf,
    capture: Annotated[
        list[CaptureName],
        Query(min_length=1, max_length=MOST_AT_ONCE, description="Id of a capture; can be given repeatedly."),
    ],
    zone: Zone = "UTC",
) -> Download:
    """The files of up to a hundred captures in one ZIP file, named by time and labels, with a table of all.
    It is created while it is sent. Files that could not be sent completely are listed in `MISSING.txt`
    inside.
    """
    pieces = captures_zip(service.archive, capture, zone_of(zone))
    return download(cast("Generator[Any, None, None]", pieces), "application/zip", "captures.zip")


group_router = APIRouter(
    prefix="/capture-groups", tags=["captures"], responses=PROBLEMS, route_class=OnceRoute
)

GroupId = Annotated[str, Path(pattern=r"^[0-9A-Za-z_-]{1,80}$", description="Id of the group.")]


@group_router.post("", **ACCEPTED_ONCE, summary="Start or arm a group of captures")
def start_capture_group(
    new: NewCaptureGroup, service: ServiceOf, request: Request, response: Response
) -> CaptureGroup:
    """Start a capture of each device at the same moment, or arm them for a common trigger. Either all of them
    start or none: 409 lists in `refusals` which devices cannot start and why, with the id of a running
    capture.
    """
    names = list(service.instruments) if new.devices == "all" else list(dict.fromkeys(new.devices))
    _check_labels(new, names)
    control = service.capture_control
    requests = {name: new.of_device(name) for name in names}
    start = control.arm_group if new.armed else control.start_group
    group_id = start(requests)
    response.headers["Location"] = str(request.url_for("get_capture_group", group_id=group_id))
    return control.group_document(group_id)


@group_router.get("/{group_id}", summary="Look up a group of captures")
@reads
def get_capture_group(group_id: GroupId, service: ServiceOf) -> CaptureGroup:
    """The captures of a group, each with its ledger, and the common moment of their start."""
    return service.capture_control.group_document(group_id)


@group_router.post("/{group_id}/trigger", **ACCEPTED_ONCE, summary="Trigger an armed group")
def trigger_capture_group(group_id: GroupId, service: ServiceOf) -> CaptureGroup:
    """Start recording all armed captures of a group at the same moment. 409 if they are not armed."""
    service.capture_control.trigger_group(group_id)
    return service.capture_control.group_document(group_id)


@group_router.post(
    "/{group_id}/stop", status_code=status.HTTP_202_ACCEPTED, summary="Stop a group of captures"
)
def stop_capture_group(group_id: GroupId, service: ServiceOf) -> CaptureGroup:
    """Stop the running captures of a group at the same moment. Nothing remains of armed captures."""
    before = service.capture_control.group_document(group_id)
    service.capture_control.stop_group(group_id)
    if all(capture.state == "armed" for capture in before.captures):
        return before.model_copy(update={"captures": [capture.disarmed for capture in before.captures]})
    return service.capture_control.group_document(group_id)


def _check_labels(new: NewCaptureGroup, names: list[str]) -> None:
    """Refuses labels of devices that are not part of the group.

    Raises:
        NotFound: Some labels belong to no capture of the group.
    """
    others = [name for name in new.labels_of if name not in names]
    if others:
        raise NotFound(
            f"labels_of names {', '.join(others)}, but no capture of that name is requested",
            f"the devices are: {', '.join(names)}",
        )
