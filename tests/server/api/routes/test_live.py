"""The newest field for the eye, as a picture and as a stream of small messages."""

import json
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from fastapi.testclient import TestClient
from starlette.testclient import WebSocketDenialResponse
from websockets.exceptions import ConnectionClosedError
from websockets.sync.client import ClientConnection, connect

from grabberd.config import HttpLimits
from grabberd.instrument.live.preview import HEADER, MAGIC, View
from grabberd.server.api import create_app
from grabberd.server.api.streams import preview
from grabberd.server.api.streams.broadcast import Broadcast
from grabberd.server.api.streams.preview import WINDOW
from server.api.conftest import service_in
from server.api.gates import is_problem
from server.api.streams import Served, served

PREVIEW = "/api/v1/preview"
PATIENCE_S = 20.0
MOST_BEFORE = 10
"""More pictures than may be on their way when a client asks for others."""


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    service = service_in(tmp_path_factory.mktemp("preview"), pace="real")
    with served(service, HttpLimits(streams_per_client=3, write_timeout_s=0.3)) as one:
        yield one


def connected(daemon: Served, **options: Any) -> ClientConnection:
    host, port = daemon.address
    return connect(f"ws://{host}:{port}{PREVIEW}", close_timeout=1, **options)


def number_of(message: str | bytes) -> int:
    assert isinstance(message, bytes)
    assert message[:4] == MAGIC
    return int(HEADER.unpack_from(message)[3])


def test_the_newest_field_is_a_picture_of_its_own_lines(paced: TestClient) -> None:
    answer = paced.get("/api/v1/preview.png")
    assert (answer.status_code, answer.headers["content-type"]) == (200, "image/png")
    assert answer.headers["cache-control"] == "no-store"
    luma = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_UNCHANGED)
    assert (luma.shape, luma.dtype) == ((288, 720), np.uint8)
    assert luma.max() > 100


def test_its_device_may_be_named_and_has_to_be_there(paced: TestClient) -> None:
    assert paced.get("/api/v1/preview.png", params={"device": "simulated"}).status_code == 200
    assert is_problem(paced.get("/api/v1/preview.png", params={"device": "other"}), 404, "not-found")


def test_where_no_field_comes_there_is_no_picture(tmp_path: Path) -> None:
    service = service_in(tmp_path)
    service.access.open()
    client = TestClient(create_app(service), "http://localhost")
    assert is_problem(client.get("/api/v1/preview.png"), 409, "not-ready")


def test_messages_come_twelve_a_second_at_most_and_only_the_newest(daemon: Served) -> None:
    with connected(daemon) as client:
        client.recv(PATIENCE_S)
        client.recv(PATIENCE_S)
        start_s = time.monotonic()
        numbers = [number_of(client.recv(PATIENCE_S)) for _ in range(6)]
        assert time.monotonic() - start_s > 5 / 12  # what was on its way may have come at once
    assert numbers == sorted(set(numbers))


def test_they_are_deflated_once_for_all_not_once_for_each(daemon: Served) -> None:
    with connected(daemon) as one, connected(daemon) as other:
        assert one.response is not None
        assert "Sec-WebSocket-Extensions" not in one.response.headers
        ones = {client.recv(PATIENCE_S) for client in (one, other) for _ in range(4)}
    assert len(ones) < 8


def asked(client: ClientConnection, **ask: object) -> bytes:
    """The first picture after a client has asked; those that were on their way are taken."""
    client.send(json.dumps({"ask": ask}))
    for _ in range(MOST_BEFORE):
        message = client.recv(PATIENCE_S)
        assert isinstance(message, bytes)
        client.send('{"taken": 1}')
        if HEADER.unpack_from(message)[20] == (ask.get("picture") != "bits") and message[:4] == MAGIC:
            return message
    raise AssertionError("what was asked for never came")


def shape_of(message: bytes) -> tuple[int, ...]:
    """x0, y0, columns and rows of its picture."""
    header = HEADER.unpack_from(message)
    return header[16], header[8], header[6], header[7]


def test_a_client_that_asks_for_a_part_in_grey_gets_just_that(daemon: Served) -> None:
    with connected(daemon) as client:
        x0, y0, columns, rows = shape_of(asked(client, part={"x": 80, "y": 40, "columns": 96, "lines": 64}))
    assert (x0, columns) == (80, 96)
    assert (y0, rows) in ((40, 32), (39, 33))  # of the upper or of the lower field


def test_a_small_screen_gets_no_more_than_it_can_show(daemon: Served) -> None:
    with connected(daemon) as client:
        assert shape_of(asked(client, width_px=390))[2:] == (720, 288)
        assert shape_of(asked(client, width_px=180))[2:] == (180, 144)


def test_the_bits_that_are_measured_can_be_asked_for(daemon: Served) -> None:
    with connected(daemon) as client:
        assert shape_of(asked(client, picture="bits"))[2:] == (720, 576)


def test_a_client_may_want_fewer_pictures_a_second(daemon: Served) -> None:
    with connected(daemon) as client:
        asked(client, rate_hz=4)
        start_s = time.monotonic()
        for _ in range(3):
            client.recv(PATIENCE_S)
            client.send('{"taken": 1}')
        assert time.monotonic() - start_s > 2.5 * 0.9 / 4  # one may have been on its way


def test_no_more_is_sent_than_is_taken_and_then_the_newest(daemon: Served) -> None:
    with connected(daemon) as client, connected(daemon) as other:
        asked(client)
        newest = number_of(asked(other))
        on_their_way = [number_of(client.recv(PATIENCE_S)) for _ in range(WINDOW - 1)]
        with suppress(TimeoutError):
            while len(on_their_way) <= WINDOW:
                on_their_way.append(number_of(client.recv(0.1)))
        assert len(on_their_way) <= WINDOW
        for _ in range(3):
            other.send('{"taken": 1}')
            newest = number_of(other.recv(PATIENCE_S))
        client.send(json.dumps({"taken": WINDOW}))
        assert number_of(client.recv(PATIENCE_S)) > newest - 2


def test_the_light_comes_with_the_pictures_as_text(daemon: Served) -> None:
    with connected(daemon) as client:
        client.send('{"ask": {"light": true}}')
        while isinstance(message := client.recv(PATIENCE_S), bytes):
            client.send('{"taken": 1}')
    assert set(json.loads(message)["views"]) == {"left", "right"}


@pytest.mark.parametrize(
    ("said", "reason"),
    [
        ("capture!", "Invalid JSON"),
        ('{"ask": {"picture": "colour"}}', "ask.picture: Input should be 'grey' or 'bits'"),
        ('{"ask": {"part": {"x": -1, "y": 0, "columns": 8, "lines": 8}}}', "ask.part.x"),
        ('{"taken": "all"}', "taken"),
        ('{"stop": true}', "stop: Extra inputs are not permitted"),
        (b"\x00\xff", "Invalid JSON"),
    ],
)
def test_a_client_that_says_what_cannot_be_understood_is_told_why(
    daemon: Served, said: str | bytes, reason: str
) -> None:
    with connected(daemon) as client:
        client.send(said)
        with pytest.raises(ConnectionClosedError) as caught:
            list(client)
    assert caught.value.rcvd is not None
    assert caught.value.rcvd.code == 1008
    assert reason in caught.value.rcvd.reason


def test_a_client_that_leaves_is_counted_no_more(daemon: Served) -> None:
    with connected(daemon) as client:
        client.recv(PATIENCE_S)
    assert none_left(daemon)


def none_left(daemon: Served) -> bool:
    until_s = time.monotonic() + PATIENCE_S
    while daemon.app.state.streams.count and time.monotonic() < until_s:
        time.sleep(0.001)
    return not daemon.app.state.streams.count


def test_one_that_never_reads_is_dropped_and_costs_nobody_else(
    daemon: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Flood:
        async def of(self, _: View) -> bytes:
            return bytes(500_000)

    class Floods(Broadcast[Flood]):
        def __init__(self) -> None:
            super().__init__(Flood, 0.001)

    monkeypatch.setattr(daemon.app.state.feeds, "of", lambda _: SimpleNamespace(preview=floods))
    monkeypatch.setattr(preview, "UNASKED_EVERY_S", 0.0)
    floods = Floods()
    with connected(daemon, max_queue=1, ping_interval=None) as _:
        with connected(daemon, max_size=None) as client:
            until_s = time.monotonic() + PATIENCE_S
            while daemon.app.state.streams.count > 1:
                client.recv(PATIENCE_S)
                assert time.monotonic() < until_s
            client.recv(PATIENCE_S)
        assert none_left(daemon)


def test_a_device_that_there_is_not_is_refused_before_the_socket_opens(paced: TestClient) -> None:
    with (
        pytest.raises(WebSocketDenialResponse) as caught,
        paced.websocket_connect(f"{PREVIEW}?device=other", headers={"Host": "localhost"}),
    ):
        pass
    assert is_problem(caught.value, 404, "not-found")


def test_one_stream_too_many_is_refused(daemon: Served) -> None:
    assert none_left(daemon)
    with ExitStack() as stack:
        for _ in range(3):
            stack.enter_context(connected(daemon)).recv(PATIENCE_S)
        with pytest.raises(Exception, match="429"):
            connected(daemon)


def test_the_stream_ends_when_the_daemon_stops(tmp_path: Path) -> None:
    with served(service_in(tmp_path, pace="real")) as daemon, connected(daemon) as client:
        client.recv(PATIENCE_S)
        assert daemon.stop()
        with pytest.raises(ConnectionClosedError, match="1012"):
            list(client)  # what was on its way, and then the end
