"""Parameters and responses shared by several routes, pagination, and POST requests that may be repeated.

One that is repeated with its Idempotency-Key gets the response of the first.
"""

import asyncio
import contextlib
import hashlib
import json
import logging
import re
from collections.abc import Awaitable, Callable, Coroutine, Iterable
from datetime import datetime, timedelta
from typing import Annotated, Any, TypeVar
from weakref import WeakValueDictionary

from fastapi import Depends, Header, Path, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException

from grabberd.archive.catalogue.capture_list import LARGEST_PAGE
from grabberd.archive.state.state_database import KeptAnswer
from grabberd.documents.document import Document
from grabberd.documents.jobs import JobDocument
from grabberd.documents.problems import Problem
from grabberd.errors import GrabberdError, StorageError
from grabberd.runtime import UtcClock, iso_utc
from grabberd.server.api.problems import Refusal
from grabberd.server.api.responses import RenderedRoute, Responses
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


log = logging.getLogger(__name__)

KEPT = timedelta(days=1)
HEADER = "Idempotency-Key"
PATTERN = r"^[!-~]{1,128}$"
_KEY = re.compile(PATTERN.removeprefix("^").removesuffix("$"))


class KeptSince:
    """Age limit of stored keys, unaffected when the clock is set forward.

    Keys must outlive repetitions of their requests, and a computer without a battery-backed clock may learn
    the time of day long after it has started.
    """

    def __init__(self, clock: UtcClock) -> None:
        self._clock = clock
        self._utc, self._ns = clock.utc_now(), clock.now_ns()

    def __call__(self) -> datetime:
        """The oldest time, by the wall clock, of keys that are kept."""
        now_ns = self._clock.now_ns()
        passed = timedelta(microseconds=(now_ns - self._ns) / 1e3)
        self._utc, self._ns = min(self._utc + passed, self._clock.utc_now()), now_ns
        return self._utc - KEPT


Locks = WeakValueDictionary[str, asyncio.Lock]
Handler = Callable[[Request], Awaitable[Response]]


async def _declare(
    _: Annotated[
        str | None,
        Header(
            alias=HEADER,
            pattern=PATTERN,
            description="A key chosen by the client, e.g. a UUID. For a day, a request repeated with its "
            "key takes effect only once and gets the same response; a refused request can be repeated.",
        ),
    ] = None,
) -> None:
    """Declares the header in the API description, and rejects invalid keys."""


TAKES_KEY = Depends(_declare)
"""Dependency of every route that takes a key."""
ACCEPTED_ONCE: dict[str, Any] = {"status_code": 202, "dependencies": [TAKES_KEY]}
"""Options of a route that takes a key and starts something that continues after its response."""


class OnceRoute(RenderedRoute):
    """A route whose POST requests may carry a key."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The handler, preceded by the look-up of a stored response."""
        handle = super().get_route_handler()

        async def once(request: Request) -> Response:
            key = request.headers.get(HEADER, "")
            if request.method != "POST" or not _KEY.fullmatch(key):
                return await handle(request)
            own = _key_of(request, key)
            locks: Locks = request.app.state.once
            # The dictionary is weak: a lock goes with the last request that uses it.
            async with locks.setdefault(own, asyncio.Lock()):
                return await _answer(request, own, handle)

        return once


async def _answer(request: Request, key: str, handle: Handler) -> Response:
    service: Service = request.app.state.service
    kept, now = service.idempotency, service.clock.utc_now()
    digest = _digest(await request.body())
    since: KeptSince = request.app.state.kept_since
    known = await run_in_threadpool(kept.begin, key, digest, iso_utc(now), iso_utc(since()))
    if known is not None:
        return _again(known, digest)
    try:
        response = await handle(request)
    except (GrabberdError, RequestValidationError, HTTPException, Refusal):
        # It had no effect. After any other exception that is uncertain, and the key stays unanswered.
        await run_in_threadpool(kept.forget, key)
        raise
    answer = KeptAnswer(digest, response.status_code, response.headers.get("location"), bytes(response.body))
    try:
        await run_in_threadpool(kept.finish, key, answer)
    except StorageError as error:  # the request has taken effect, so the client must get its response
        log.warning("a response cannot be stored for its %s: %s; %s", HEADER, error.message, error.hint)
    return response


def _again(known: KeptAnswer, digest: bytes) -> Response:
    """The stored response to the first request.

    Raises:
        Refusal: 422, the request differs from the first; 409, it is unknown whether the first took effect.
    """
    if known.digest != digest:
        raise Refusal(
            422,
            "idempotency-key-reused",
            f"this {HEADER} was used for a different request within a day",
            "make a new key for every request; reuse a key only to repeat its request",
        )
    if known.status is None:
        raise Refusal(
            409,
            "outcome-unknown",
            f"the daemon stopped before it responded to the request with this {HEADER}",
            "check if it took effect, e.g. GET /api/v1/captures; to send it again, make a new key",
        )
    location = {"Location": known.location} if known.location else {}
    headers = {"Idempotent-Replayed": "true", **location}
    return Response(known.body, known.status, headers, "application/json")


def _key_of(request: Request, key: str) -> str:
    """The key within its scope: keys are separate for each token and path."""
    identity = getattr(request.state, "identity", None)
    return f"{identity.token if identity else None} {request.method} {request.url.path} {key}"


def _digest(body: bytes) -> bytes:
    """A digest of the body, independent of its JSON formatting."""
    with contextlib.suppress(ValueError, RecursionError):
        body = json.dumps(json.loads(body), sort_keys=True).encode()
    return hashlib.sha256(body).digest()
