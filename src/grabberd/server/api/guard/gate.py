"""The middleware that admits or refuses every request; plain ASGI, so streams are not buffered."""

import time
from collections.abc import Awaitable, Callable

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from grabberd.archive.access import Identity
from grabberd.documents.enums import Role
from grabberd.server.api.guard.authentication import Authenticator, check_role, least_role
from grabberd.server.api.guard.front import Front, check_host, check_page, check_page_is_named
from grabberd.server.api.guard.limits import Bodies, LimitedBody, check_framing, check_length
from grabberd.server.api.problems import Refusal

RECHECK_S = 10.0
"""Longest time for which a stream continues after its token was removed."""
POLICY_VIOLATION = 1008
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "SAMEORIGIN",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "same-origin",
}
"""Headers that keep pages of other sites from showing or embedding the daemon's responses."""


class Gate:
    """Checks framing, host name, origin, token, role and length, in this order, before any route."""

    def __init__(
        self,
        app: ASGIApp,
        front: Front,
        authenticator: Authenticator,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._app = app
        self._front = front
        self._bodies = Bodies(front.limits)
        self._authenticator = authenticator
        self._now_s = now_s

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serves one request or one WebSocket."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        scope = self._front.proxies.seen_through(scope)
        answer = _Answer(send)
        try:
            await self._serve(scope, receive, answer)
        except Refusal as refusal:
            await answer.refuse(refusal, scope, receive)
        except _AccessEnded:
            await answer.end(scope)

    async def _serve(self, scope: Scope, receive: Receive, answer: "_Answer") -> None:
        least = await self._admit(scope)
        if least is not None:
            answer.watch(_Watch(lambda: self._authenticator.still_is(scope, least), self._now_s))
        # After authentication: strangers must not learn the limit.
        if scope["type"] == "websocket":
            await self._app(scope, receive, answer)
            return
        check_length(scope, self._front.limits)
        body = LimitedBody(receive, self._front.limits, self._bodies)
        try:
            await self._app(scope, body, answer)
        finally:
            body.close()

    async def _admit(self, scope: Scope) -> Role | None:
        """Admits a request and stores who sent it; returns the role that it requires."""
        check_framing(scope)
        check_host(scope, self._front)
        check_page(scope, self._front)
        least = least_role(scope)
        if least is not None:
            identity = await self._identify(scope)
            check_role(identity, least)
            scope.setdefault("state", {})["identity"] = identity
        return least

    async def _identify(self, scope: Scope) -> Identity:
        identity = await self._authenticator.identify(scope)
        if identity.by == "session":
            check_page_is_named(scope)
        return identity


class _AccessEnded(Exception):
    """A token was removed while a response was still being streamed to its holder."""


class _Answer:
    """A `send` that adds the headers and rechecks access during a long response."""

    def __init__(self, send: Send) -> None:
        self._send = send
        self._begun = False
        self._watch: _Watch | None = None

    def watch(self, watch: "_Watch") -> None:
        """Ends the response when the access ends."""
        self._watch = watch

    async def __call__(self, message: Message) -> None:
        """Sends the next message."""
        self._begun = True
        if message["type"] in ("http.response.start", "websocket.http.response.start"):
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)
        elif self._watch is not None:
            await self._watch.check()
        await self._send(message)

    async def refuse(self, refusal: Refusal, scope: Scope, receive: Receive) -> None:
        """Responds with the refusal; if a response has started, the server cuts it off instead."""
        if self._begun:
            return
        if scope["type"] == "websocket" and "websocket.http.response" not in scope.get("extensions", {}):
            await self._send({"type": "websocket.close", "code": POLICY_VIOLATION})
            return
        await refusal.response()(scope, receive, self)

    async def end(self, scope: Scope) -> None:
        """Closes a WebSocket; other responses are cut off by the server."""
        if scope["type"] == "websocket":
            await self._send({"type": "websocket.close", "code": POLICY_VIOLATION})


class _Watch:
    """Rechecks access periodically."""

    def __init__(self, still: Callable[[], Awaitable[bool]], now_s: Callable[[], float]) -> None:
        self._still = still
        self._now_s = now_s
        self._next_s = now_s() + RECHECK_S

    async def check(self) -> None:
        """Rechecks the access if it is due.

        Raises:
            _AccessEnded: the access has ended.
        """
        if self._now_s() < self._next_s:
            return
        self._next_s = self._now_s() + RECHECK_S
        if not await self._still():
            raise _AccessEnded


class _HeadSent(Exception):
    """The headers have been sent, and the body is not wanted."""


class HeadAsGet:
    """Answers HEAD as GET without the body; a stream ends before its first byte."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serves one request; anything but HEAD passes unchanged."""
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self._app(scope, receive, send)
            return

        async def send_head(message: Message) -> None:
            if message["type"] != "http.response.body":
                await send(message)
                return
            await send({"type": "http.response.body", "body": b"", "more_body": False})
            raise _HeadSent

        try:
            await self._app({**scope, "method": "GET"}, receive, send_head)
        except _HeadSent:
            return
