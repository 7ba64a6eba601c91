"""Bodies and streams: how much, how slowly, how many."""

import asyncio
from contextlib import ExitStack
from pathlib import Path

import pytest
from fastapi import FastAPI, WebSocket
from fastapi.responses import StreamingResponse
from fastapi.testclient import TestClient
from starlette.testclient import WebSocketDenialResponse
from starlette.types import Message

from grabberd.config import HttpLimits
from grabberd.documents.enums import Role
from grabberd.server.api.guard.front import Front
from grabberd.server.api.guard.limits import (
    LARGEST_AT_ONCE,
    MOST_PARTS,
    SHORT_BYTES,
    Bodies,
    LimitedBody,
    OneStream,
    Streams,
)
from grabberd.server.api.problems import Refusal, answer_refusal
from server.api.gates import Gated, is_problem

CAPTURES = "/api/v1/captures"
LIMITS = HttpLimits(body_bytes=1024, body_timeout_s=0.02, streams_per_client=2)


@pytest.fixture
def gated(tmp_path: Path) -> Gated:
    return Gated(tmp_path, front=Front(limits=LIMITS))


@pytest.mark.parametrize("size", [0, 1, 1024])
def test_a_body_of_the_greatest_length_comes_through(gated: Gated, size: int) -> None:
    answer = gated.client().post(CAPTURES, content=b"x" * size, headers=gated.bearer(Role.OPERATOR))
    assert answer.json()["bytes"] == size


def test_a_longer_one_is_refused_by_its_own_word(gated: Gated) -> None:
    answer = gated.client().post(CAPTURES, content=b"x" * 1025, headers=gated.bearer(Role.OPERATOR))
    assert is_problem(answer, 413, "content-too-large")
    assert answer.headers["connection"] == "close"


@pytest.mark.parametrize("path", [CAPTURES, "/healthz"])
def test_a_request_that_frames_its_body_in_two_ways_is_refused_before_anything_else(
    gated: Gated, path: str
) -> None:
    twice = {"Transfer-Encoding": "chunked", "Content-Length": "2"}
    answer = gated.client().post(path, content=b"ab", headers=twice)
    assert is_problem(answer, 400, "ambiguous-length")
    assert answer.headers["connection"] == "close"


def test_one_in_pieces_is_refused_when_it_becomes_too_long(gated: Gated) -> None:
    pieces = (b"x" * 100 for _ in range(20))
    answer = gated.client().post(CAPTURES, content=pieces, headers=gated.bearer(Role.OPERATOR))
    assert is_problem(answer, 413, "content-too-large")


def test_one_that_would_take_many_times_its_length_in_memory_is_refused(tmp_path: Path) -> None:
    gated = Gated(tmp_path, front=Front())
    lists = b"[" + b"[]," * (MOST_PARTS // 2 + 1) + b"0]"
    answer = gated.client().post(CAPTURES, content=lists, headers=gated.bearer(Role.OPERATOR))
    assert is_problem(answer, 413, "content-too-large")


def test_large_bodies_at_once_are_refused_and_short_ones_have_room() -> None:
    limits = HttpLimits(body_bytes=100_000)
    bodies = Bodies(limits)
    room = LARGEST_AT_ONCE * limits.body_bytes
    bodies.add(room, room)
    bodies.add(SHORT_BYTES, SHORT_BYTES)
    with pytest.raises(Refusal) as refused:
        bodies.add(1, SHORT_BYTES + 1)
    assert (refused.value.status_code, refused.value.name) == (503, "too-many-bodies")
    bodies.remove(room + SHORT_BYTES)
    bodies.add(SHORT_BYTES, 2 * SHORT_BYTES)


def test_a_body_is_counted_until_its_request_has_ended(gated: Gated) -> None:
    bodies = find_bodies(gated)
    for size in (0, 100, 4096, 4097):
        gated.client().post(CAPTURES, content=b"x" * size, headers=gated.bearer(Role.OPERATOR))
        assert bodies.count == 0


def find_bodies(gated: Gated) -> Bodies:
    return gated.app._bodies


def test_a_stranger_is_not_told_how_long_it_may_be(gated: Gated) -> None:
    assert gated.client().post(CAPTURES, content=b"x" * 1025).status_code == 401


def test_a_body_that_does_not_come_is_not_waited_for() -> None:
    async def receive() -> Message:
        await asyncio.sleep(60)
        raise AssertionError

    with pytest.raises(Refusal) as caught:
        asyncio.run(LimitedBody(receive, LIMITS, Bodies(LIMITS))())  # type: ignore[arg-type]
    assert (caught.value.status_code, caught.value.name) == (408, "request-timeout")


def test_one_that_drips_is_not_waited_for_either() -> None:
    async def receive() -> Message:
        await asyncio.sleep(0.004)
        return {"type": "http.request", "body": b"x", "more_body": True}

    async def read_on(body: LimitedBody) -> None:
        while True:
            await body()

    with pytest.raises(Refusal, match="408"):
        asyncio.run(read_on(LimitedBody(receive, LIMITS, Bodies(LIMITS))))


def test_after_the_body_a_client_may_be_silent_for_as_long_as_it_likes() -> None:
    async def receive() -> Message:
        if not messages:
            await asyncio.sleep(0.05)
            return {"type": "http.disconnect"}
        return messages.pop()

    async def read() -> Message:
        body = LimitedBody(receive, LIMITS, Bodies(LIMITS))
        await body()
        return await body()

    messages: list[Message] = [{"type": "http.request", "body": b"", "more_body": False}]
    assert asyncio.run(read()) == {"type": "http.disconnect"}


def test_what_comes_too_late_inside_a_route_is_a_problem_too(tmp_path: Path) -> None:
    app = FastAPI()
    app.add_exception_handler(Refusal, answer_refusal)

    @app.post(CAPTURES)
    def order(body: dict[str, int]) -> dict[str, int]:
        return body

    gated = Gated(tmp_path, front=Front(limits=LIMITS), app=app)
    headers = {**gated.bearer(Role.OPERATOR), "Content-Type": "application/json"}
    pieces = (b'{"a": 1,' + b" " * 300 for _ in range(20))
    assert is_problem(
        gated.client().post(CAPTURES, content=pieces, headers=headers), 413, "content-too-large"
    )


def test_a_client_has_so_many_streams_and_no_more() -> None:
    streams = Streams(LIMITS)
    with streams.one("a"), streams.one("a"):
        with pytest.raises(Refusal) as caught, streams.one("a"):
            pass
        assert (caught.value.status_code, caught.value.name) == (429, "too-many-streams")
        with streams.one("b"):
            assert streams.count == 3
    with streams.one("a"):
        assert streams.count == 1


def test_a_stream_that_fails_is_counted_no_more_and_nothing_is_remembered() -> None:
    streams = Streams(LIMITS)
    for n in range(100):
        with pytest.raises(RuntimeError), streams.one(f"client {n}"):
            raise RuntimeError
    assert (streams.count, len(streams._open)) == (0, 0)


def test_a_websocket_counts_until_it_has_ended() -> None:
    app = FastAPI()
    app.state.streams = streams = Streams(LIMITS)

    @app.websocket("/preview")
    async def preview(socket: WebSocket, _: OneStream) -> None:
        await socket.accept()
        await socket.send_json(streams.count)
        await socket.receive_text()

    client = TestClient(app)
    for _ in range(3):
        with client.websocket_connect("/preview") as socket:
            assert socket.receive_json() == 1
            socket.send_text("enough")
    assert streams.count == 0


def test_so_does_an_answer_that_streams() -> None:
    app = FastAPI()
    app.state.streams = streams = Streams(LIMITS)

    @app.get("/events")
    def events(_: OneStream) -> StreamingResponse:
        return StreamingResponse(str(streams.count) for _ in range(2))

    client = TestClient(app)
    for _ in range(3):
        assert client.get("/events").text == "11"
    assert streams.count == 0


def test_one_websocket_too_many_is_refused_with_a_problem(tmp_path: Path) -> None:
    app = FastAPI()
    app.state.streams = Streams(LIMITS)
    app.add_exception_handler(Refusal, answer_refusal)

    @app.websocket("/api/v1/preview")
    async def preview(socket: WebSocket, _: OneStream) -> None:
        await socket.accept()
        await socket.receive_text()

    gated = Gated(tmp_path, front=Front(limits=LIMITS), app=app)
    client, url, own = gated.client(), "ws://localhost/api/v1/preview", gated.bearer(Role.VIEWER)
    with ExitStack() as stack:
        held = [stack.enter_context(client.websocket_connect(url, headers=own)) for _ in range(2)]
        with pytest.raises(WebSocketDenialResponse) as caught:
            stack.enter_context(client.websocket_connect(url, headers=own))
        assert is_problem(caught.value, 429, "too-many-streams")
        for socket in held:
            socket.send_text("enough")
