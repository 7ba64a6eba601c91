"""The newest field for the eye, as a picture and as a stream of small messages."""

import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from fastapi.testclient import TestClient
from starlette.testclient import WebSocketDenialResponse
from websockets.exceptions import ConnectionClosedError
from websockets.sync.client import ClientConnection, connect

from api.conftest import service_in
from api.gates import is_problem
from api.streams import Served, served
from grabberd.api import create_app
from grabberd.api.streams.broadcast import Broadcast
from grabberd.config import HttpLimits
from grabberd.service.live.preview import HEADER, MAGIC

PREVIEW = "/api/v1/preview"
PATIENCE_S = 20.0


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


def test_a_client_that_says_something_is_not_heard(daemon: Served) -> None:
    with connected(daemon) as client:
        client.send("capture!")
        assert number_of(client.recv(PATIENCE_S)) >= 0


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
    numbers = iter(range(1_000_000))
    floods: Broadcast[bytes] = Broadcast(lambda: next(numbers).to_bytes(4, "big") + bytes(500_000), 0.001)
    monkeypatch.setattr(daemon.app.state.feeds, "preview", lambda _: floods)
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
