"""Parameters and responses shared by several routes, and pagination."""

from collections.abc import Callable, Iterable
from typing import Annotated, TypeVar

from fastapi import Depends, Path, Query, Request, Response

from grabberd.archive.catalogue.capture_list import LARGEST_PAGE
from grabberd.documents.document import Document
from grabberd.documents.jobs import JobDocument
from grabberd.documents.problems import Problem
from grabberd.server.api.responses import Responses
from grabberd.server.api.snapshots import Snapshots
from grabberd.server.daemon.service import Service


async def _service(request: Request) -> Service:
    # Async although it awaits nothing: FastAPI calls other dependencies in threads.
    return request.app.state.service


ServiceOf = Annotated[Service, Depends(_service)]


async def _snapshots(request: Request) -> Snapshots:
    return request.app.state.snapshots


SnapshotsOf = Annotated[Snapshots, Depends(_snapshots)]

CaptureId = Annotated[str, Path(pattern=r"^[0-9A-Za-z_-]{1,80}$", description="Id of the capture.")]
DeviceName = Annotated[str, Path(max_length=32, description="Name of the device.")]

PROBLEMS: Responses = {
    code: {"model": Problem, "content": {"application/problem+json": {}}}
    for code in (404, 409, 422, 503, 507)
}
BUSY: Responses = {503: PROBLEMS[503]}
"""For heavy reads without other problems."""
OF_A_FILE: Responses = {**PROBLEMS, 410: PROBLEMS[404]}
"""For routes that open a capture's file, which may be damaged."""
REPORT_HEADERS = {"Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; img-src data:"}
"""A report loads nothing: its styles and pictures are embedded."""


def accepted(job: JobDocument, request: Request, response: Response) -> JobDocument:
    """The response to a request that queued a job: the job, with its URL in Location."""
    response.headers["Location"] = str(request.url_for("get_job", job_id=job.id))
    return job


T = TypeVar("T")
Row = TypeVar("Row", bound=Document)

Limit = Annotated[int, Query(ge=1, le=500, description="Maximum number of results.")]
Cursor = Annotated[
    str | None,
    Query(pattern=r"^[!-}]{0,40}~[0-9A-Za-z_.%-]{1,800}$", description="`next` of the previous page."),
]
"""Creation time and id of the previous page's last entry: unlike page numbers, these stay valid when entries
are added or removed."""


def by_number(number: int) -> tuple[str, str]:
    """Place of an entry in a list of numbers, which grow."""
    return "", str(number).zfill(16)


def page_of(
    known: Iterable[T],
    position: Callable[[T], tuple[str, str]],
    row: Callable[[T], Row | None],
    limit: int,
    cursor: str | None,
    *,
    ascending: bool = False,
) -> tuple[list[Row], str | None]:
    """A page of rows in descending order of position, and the next page's cursor.

    It ends before its limit if it has 4 MB.

    Args:
        known: What is known of all entries without reading them.
        position: The place of an entry.
        row: Reads an entry; None if it does not belong to the list. Those of the page alone are read.
        limit: Maximum number of rows.
        cursor: `next` of the page before.
        ascending: True for ascending order.
    """
    after = None if cursor is None else tuple(cursor.split("~", 1))
    page: list[Row] = []
    last, size = "", 0
    for entry in sorted(known, key=position, reverse=not ascending):
        place = position(entry)
        if after is not None and (place <= after if ascending else place >= after):
            continue
        if (one := row(entry)) is None:
            continue
        size += len(one.model_dump_json())
        if page and (len(page) == limit or size > LARGEST_PAGE):
            return page, last
        page.append(one)
        last = "~".join(place)
    return page, None
