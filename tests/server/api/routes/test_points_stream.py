"""Every field's points over a WebSocket, read by the project's own client."""

import json
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from itertools import islice, pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from fastapi.testclient import TestClient
from running import PATIENCE_S
from starlette.testclient import WebSocketDenialResponse
from websockets.exceptions import ConnectionClosedError, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from grabberd.client.daemon import Daemon
from grabberd.client.points_stream import StreamedPoints, follow_points
from grabberd.config import HttpLimits
from grabberd.documents.enums import Role
from grabberd.documents.points_frame import PROTOCOL, decoded
from grabberd.errors import GrabberdError, NotReady
from grabberd.server.api.streams.broadcast import Broadcast
from grabberd.server.api.streams.feeds import PointsMessage
from server.api.conftest import service_in
from server.api.gates import is_problem
from server.api.streams import Served, served

STREAM = "/api/v1/points/stream"


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    service = service_in(tmp_path_factory.mktemp("points"), pace="real")
    with served(service, HttpLimits(streams_per_client=3, write_timeout_s=0.3)) as one:
        yield one


def url_of(daemon: Served, scheme: str = "http") -> str:
    return f"{scheme}://{daemon.address[0]}:{daemon.address[1]}"


def connected(daemon: Served, **options: Any) -> ClientConnection:
    return connect(url_of(daemon, "ws") + STREAM, close_timeout=1, **options)


def first(daemon: Served, count: int, **options: Any) -> list[StreamedPoints]:
    with closing(follow_points(Daemon(url_of(daemon)), **options)) as fields:  # type: ignore[type-var]
        return list(islice(fields, count))


def none_left(daemon: Served) -> bool:
    until_s = time.monotonic() + PATIENCE_S
    while daemon.app.state.streams.count and time.monotonic() < until_s:
        time.sleep(0.001)
    return not daemon.app.state.streams.count


def test_every_field_comes_in_order_with_what_it_was_measured_with(daemon: Served) -> None:
    fields = first(daemon, 25)
    assert all(
        one.frame.sequence + 1 + other.skipped == other.frame.sequence for one, other in pairwise(fields)
    )
    assert all(one.frame.n < other.frame.n for one, other in pairwise(fields))
    assert all(one.frame.time_ns < one.frame.published_ns for one in fields)
    [description] = {one.description for one in fields}
    setup = daemon.service.instrument(None).setup
    assert description.calibration_id == setup.documents["calibration"]["id"]
    assert description.device == "simulated"
    assert max(len(one.frame.target) for one in fields) > 50


def test_the_description_comes_first_and_once(daemon: Served) -> None:
    with connected(daemon) as client:
        described = json.loads(client.recv(PATIENCE_S))
        assert described["type"] == "description"
        for _ in range(5):
            message = client.recv(PATIENCE_S)
            assert isinstance(message, bytes)
            assert decoded(message).description == described["number"]


def test_it_comes_again_when_another_calibration_is_activated(tmp_path: Path) -> None:
    with (
        served(service_in(tmp_path, pace="real")) as daemon,
        closing(  # type: ignore[type-var]
            follow_points(Daemon(url_of(daemon)))
        ) as fields,
    ):
        before = next(fields).description
        instrument = daemon.service.instrument(None)
        another = {**instrument.setup.documents["calibration"], "id": "another"}
        instrument.use(instrument.setup.with_calibration(another))
        until_s = time.monotonic() + PATIENCE_S
        while (now := next(fields).description).number == before.number:
            assert time.monotonic() < until_s
        assert (now.number, now.calibration_id) == (before.number + 1, "another")


def test_the_subprotocol_is_taken_by_who_knows_it(daemon: Served) -> None:
    with connected(daemon, subprotocols=["other", PROTOCOL]) as client:
        assert client.subprotocol == PROTOCOL
    with connected(daemon) as client:
        assert client.subprotocol is None


def test_a_device_that_there_is_not_is_refused(daemon: Served, paced: TestClient) -> None:
    with pytest.raises(GrabberdError, match="no device") as caught:
        first(daemon, 1, device="other")
    assert caught.value.hint
    with (
        pytest.raises(WebSocketDenialResponse) as denied,
        paced.websocket_connect(f"{STREAM}?device=other", headers={"Host": "localhost"}),
    ):
        pass
    assert is_problem(denied.value, 404, "not-found")


def test_one_stream_too_many_is_refused(daemon: Served) -> None:
    assert none_left(daemon)
    with ExitStack() as stack:
        for _ in range(3):
            stack.enter_context(connected(daemon)).recv(PATIENCE_S)
        with pytest.raises(GrabberdError, match="3 live streams"):
            first(daemon, 1)
    assert none_left(daemon)


def test_a_page_of_another_site_is_refused(daemon: Served) -> None:
    with pytest.raises(InvalidStatus, match="403"):
        connected(daemon, additional_headers={"Origin": "http://evil.example"})


def test_it_takes_a_token_where_there_are_any(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with served(service_in(tmp_path, pace="real")) as daemon:
        secret = daemon.service.access.add("robot", Role.VIEWER)
        with pytest.raises(GrabberdError, match="token"):
            first(daemon, 1)
        monkeypatch.setenv("GRABBERD_TOKEN", secret)
        assert first(daemon, 1)


def test_one_that_never_reads_is_dropped_and_costs_nobody_else(
    daemon: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert none_left(daemon)
    flood = PointsMessage(1, "{}", bytes(500_000))
    floods: Broadcast[PointsMessage] = Broadcast(lambda: flood, 0.001)
    monkeypatch.setattr(daemon.app.state.feeds, "of", lambda _: SimpleNamespace(points=floods))
    with connected(daemon, max_queue=1, ping_interval=None) as _:
        with connected(daemon, max_size=None) as client:
            until_s = time.monotonic() + PATIENCE_S
            while daemon.app.state.streams.count > 1:
                client.recv(PATIENCE_S)
                assert time.monotonic() < until_s
            client.recv(PATIENCE_S)
        assert none_left(daemon)


def test_it_ends_when_the_daemon_stops(tmp_path: Path) -> None:
    with served(service_in(tmp_path, pace="real")) as daemon:
        with connected(daemon) as client:
            client.recv(PATIENCE_S)
            assert daemon.stop()
            with pytest.raises(ConnectionClosedError, match="1012"):
                list(client)
        with pytest.raises(NotReady, match="no daemon answers"):
            first(daemon, 1)


def test_the_client_says_when_nothing_is_measured(tmp_path: Path) -> None:
    with served(service_in(tmp_path, pace="real")) as daemon:
        instrument = daemon.service.instrument(None)
        instrument.use(instrument.setup.with_calibration(None))
        with pytest.raises(NotReady, match="no field"):
            first(daemon, 10, patience_s=0.5)
