"""Idempotent POST requests: one repeated with its Idempotency-Key gets the response of the first."""

import asyncio
import contextlib
import hashlib
import json
import logging
import re
from collections.abc import Awaitable, Callable, Coroutine
from datetime import datetime, timedelta
from typing import Annotated, Any
from weakref import WeakValueDictionary

from fastapi import Depends, Header, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException

from grabberd.archive.state.state_database import KeptAnswer
from grabberd.errors import GrabberdError, StorageError
from grabberd.runtime import UtcClock, iso_utc
from grabberd.server.api.problems import Refusal
from grabberd.server.api.responses import RenderedRoute
from grabberd.server.daemon.service import Service

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
