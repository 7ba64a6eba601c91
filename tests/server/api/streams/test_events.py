"""Server-sent events on a real socket: the whole state first, then what changes."""

import asyncio
import http.client
import socket
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from merge_patch import merged

from grabberd.config import HttpLimits
from grabberd.documents.enums import DeviceState
from grabberd.server.api.streams.feeds import EVERY_S, KEEP_ALIVE, EventFeed
from server.api.conftest import service_in
from server.api.streams import Served, events, served

PATIENCE_S = 20.0


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    service = service_in(tmp_path_factory.mktemp("events"), pace="real")
    with served(service, HttpLimits(streams_per_client=4, write_timeout_s=0.5)) as one:
        yield one


def feed_of(folder: Path, **options: float) -> EventFeed:
    """Over a service that has not been started: nothing changes by itself."""
    service = service_in(folder)
    (folder / "captures").mkdir()
    return EventFeed(service, every_s=0.0, **options)


def test_the_whole_state_comes_first(daemon: Served) -> None:
    with events(daemon.address) as client:
        assert client.headers["content-type"].startswith("text/event-stream")
        assert client.headers["cache-control"] == "no-store"
        first = client.next()
    assert first.event == "state"
    assert first.data["devices"]["simulated"]["ring"]["slots"] == 32


def test_then_the_changes_alone_from_which_the_state_is_known(daemon: Served) -> None:
    with events(daemon.address) as client:
        state, received = client.next().data, 0
        for _ in range(4):
            change = client.next()
            assert change.event == "change"
            assert "name" not in change.data.get("devices", {}).get("simulated", {})
            state = merged(state, change.data)
            now = state["devices"]["simulated"]["fields"]["received"]
            assert now >= received
            received = now
    assert set(state) == set(service_state(daemon))


def service_state(daemon: Served) -> dict[str, Any]:
    return daemon.service.state().model_dump()


def test_changes_come_five_times_a_second_at_most(daemon: Served) -> None:
    with events(daemon.address) as client:
        client.next()
        client.next()
        start_s = time.monotonic()
        for _ in range(4):
            client.next()
        assert time.monotonic() - start_s > 3 * EVERY_S  # what was on its way may have come at once


def test_who_comes_back_is_told_the_changes_since(daemon: Served) -> None:
    with events(daemon.address) as client:
        last = client.next()
    with events(daemon.address, last.id) as client:
        again = client.next()
    assert again.event == "change"
    assert again.id != last.id


@pytest.mark.parametrize("last_id", ["of-before", "", "0", "ffffffff-1", "x" * 80, "0-²"])
def test_who_has_seen_something_else_is_told_the_whole_state(daemon: Served, last_id: str) -> None:
    with closing(http.client.HTTPConnection(*daemon.address, timeout=PATIENCE_S)) as connection:
        connection.request("GET", "/api/v1/events", headers={"Last-Event-ID": last_id.encode("utf-8")})
        with closing(connection.getresponse()) as answer:
            lines = [answer.readline() for _ in range(4)]
    assert b"event: state\n" in lines


def test_a_client_that_never_reads_is_dropped_and_costs_nobody_else(
    daemon: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert not streams_after(daemon)
    monkeypatch.setattr(daemon.app.state.feeds, "events", flood(daemon))
    streams = daemon.app.state.streams
    with closing(socket.create_connection(daemon.address)) as deaf, events(daemon.address) as client:
        client.next()
        deaf.sendall(b"GET /api/v1/events HTTP/1.1\r\nHost: localhost\r\n\r\n")
        until_s = time.monotonic() + PATIENCE_S
        while streams.count < 2:
            client.next()
        while streams.count > 1:
            client.next()
            assert time.monotonic() < until_s
        client.next()
    assert not streams_after(daemon)


def flood(daemon: Served) -> EventFeed:
    """Far more than the sockets' buffers take."""
    numbers, state = iter(range(1_000_000)), daemon.service.state()
    feed = EventFeed(daemon.service, every_s=0.001)
    feed._service = SimpleNamespace(  # type: ignore[assignment]
        state=lambda: state.model_copy(update={"version": f"{next(numbers)} " * 100_000})
    )
    return feed


def streams_after(daemon: Served) -> int:
    """How many streams there still are when those of before have gone."""
    until_s = time.monotonic() + PATIENCE_S
    while daemon.app.state.streams.count and time.monotonic() < until_s:
        with closing(http.client.HTTPConnection(*daemon.address)) as connection:
            connection.request("GET", "/healthz")
            connection.getresponse().read()
    return int(daemon.app.state.streams.count)


def test_one_stream_too_many_is_refused(daemon: Served) -> None:
    address = daemon.address
    assert not streams_after(daemon)
    with events(address) as a, events(address) as b, events(address) as c, events(address) as d:
        for client in (a, b, c, d):
            client.next()
        with events(address) as one_too_many:
            assert one_too_many.status == 429


def test_head_answers_and_streams_nothing(daemon: Served) -> None:
    with closing(http.client.HTTPConnection(*daemon.address, timeout=PATIENCE_S)) as connection:
        connection.request("HEAD", "/api/v1/events")
        answer = connection.getresponse()
        assert answer.status == 200
        assert answer.headers["content-type"].startswith("text/event-stream")
        assert answer.read() == b""
    assert not streams_after(daemon)


def test_streams_end_when_the_daemon_stops(tmp_path: Path) -> None:
    with served(service_in(tmp_path, pace="real")) as daemon, events(daemon.address) as client:
        client.next()
        assert daemon.stop()
        for event in client:  # comes to an end
            assert event.event == "change"


def test_while_nothing_changes_a_comment_keeps_the_connection(tmp_path: Path) -> None:
    feed = feed_of(tmp_path, keep_alive_s=0.05)
    state = feed._service.state()
    feed._service.state = lambda: state  # type: ignore[method-assign]

    async def read() -> list[str]:
        source = feed.events(None)
        texts = [await anext(source) for _ in range(4)]
        await source.aclose()  # type: ignore[attr-defined]
        return texts

    texts = asyncio.run(read())
    assert texts[0].startswith("retry: ")
    assert next(text for text in texts[1:] if text != KEEP_ALIVE).startswith("id: ")
    assert KEEP_ALIVE in texts[1:]


def test_a_change_of_state_is_an_event(tmp_path: Path) -> None:
    feed = feed_of(tmp_path)
    board = feed._service.instrument(None).board

    async def read() -> tuple[str, str]:
        source = feed.events(None)
        _, first = await anext(source), await anext(source)
        board.enter(DeviceState.OPENING)
        second = await anext(source)
        while '"state":"opening"' not in second:
            second = await anext(source)
        await source.aclose()  # type: ignore[attr-defined]
        return first, second

    first, second = asyncio.run(read())
    assert '"state":"absent"' in first
    assert "event: change" in second
    assert '"slots"' not in second
