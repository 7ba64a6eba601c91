"""Heavy reads have threads of their own, a queue with an end, a time, and end when their client leaves."""

import asyncio
import http.client
import json
import select
import socket
import sqlite3
import threading
import time
from collections.abc import Awaitable, Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
from running import PATIENCE_S
from starlette.types import Message

from grabberd.archive.capture.schema import reading_errors
from grabberd.archive.guarded_database import GuardedConnection
from grabberd.config import HttpLimits
from grabberd.errors import ReadingGivenUp
from grabberd.files.reading import check_patience
from grabberd.server.api.contents import WAITING_A_THREAD
from grabberd.server.api.problems import Refusal
from grabberd.server.api.readings import Readings
from server.api.conftest import sealed_in, service_in
from server.api.gates import Ticks
from server.api.streams import Served, served

ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT max(i) FROM n"
LONG = HttpLimits(reads=2, read_timeout_s=3600)


class Endless:
    """Reads that go on until somebody gives them up; `running` counts those that have begun and not ended."""

    def __init__(self) -> None:
        self.running = 0
        self.begun = 0
        self._changed = threading.Condition()

    def __call__(self, *_: object) -> Any:
        self._count(1)
        try:
            with (
                closing(sqlite3.connect(":memory:", factory=GuardedConnection)) as connection,
                reading_errors(Path(__file__)),
            ):
                return connection.execute(ENDLESS).fetchone()
        finally:
            self._count(-1)

    def wait_for(self, running: int) -> bool:
        with self._changed:
            return self._changed.wait_for(lambda: self.running == running, PATIENCE_S)

    def _count(self, change: int) -> None:
        with self._changed:
            self.running += change
            self.begun += change > 0
            self._changed.notify_all()


async def staying() -> Message:
    """A client that stays."""
    await asyncio.Event().wait()
    raise AssertionError


def run(work: Callable[[], Awaitable[Any]]) -> Any:
    async def all_of_it() -> Any:
        return await work()

    return asyncio.run(all_of_it())


def test_what_is_read_is_answered() -> None:
    readings = Readings(HttpLimits())
    assert run(lambda: readings.answer(lambda: 7, staying)) == 7
    assert readings.count == 0


def test_an_endless_statement_ends_with_its_time() -> None:
    readings = Readings(HttpLimits(read_timeout_s=0.05))
    with pytest.raises(ReadingGivenUp, match="too long"):
        run(lambda: readings.answer(Endless(), staying))
    assert readings.count == 0


def test_what_has_waited_too_long_for_a_thread_is_not_begun() -> None:
    clock = Ticks()
    readings = Readings(HttpLimits(reads=1, read_timeout_s=30), clock)
    endless, begun = Endless(), []

    async def both() -> list[Any]:
        reads = (endless, lambda: begun.append(1))
        answers = [asyncio.create_task(readings.answer(read, staying)) for read in reads]
        await asyncio.to_thread(endless.wait_for, 1)
        clock.now_s += 30
        return await asyncio.gather(*answers, return_exceptions=True)

    assert [type(one) for one in run(both)] == [ReadingGivenUp, ReadingGivenUp]
    assert begun == []


def test_a_client_that_leaves_ends_its_read() -> None:
    readings, endless = Readings(LONG), Endless()

    async def leaves() -> Message:
        await asyncio.to_thread(endless.wait_for, 1)
        return {"type": "http.disconnect"}

    with pytest.raises(ReadingGivenUp):
        run(lambda: readings.answer(endless, leaves))
    assert endless.running == 0


def test_no_more_wait_than_there_is_room_for() -> None:
    readings, endless = Readings(LONG), Endless()
    room = LONG.reads * (1 + WAITING_A_THREAD)

    async def too_many() -> str:
        reads = [asyncio.create_task(readings.answer(endless, staying)) for _ in range(room)]
        await asyncio.to_thread(endless.wait_for, LONG.reads)
        with pytest.raises(Refusal) as refused:
            await readings.answer(endless, staying)
        assert refused.value.status_code == 503
        assert refused.value.headers is not None
        for read in reads:
            read.cancel()
        await asyncio.gather(*reads, return_exceptions=True)
        return refused.value.headers["Retry-After"]

    assert run(too_many) == "2"
    assert (readings.count, endless.running) == (0, 0)


def test_a_download_takes_a_thread_only_while_a_piece_is_made() -> None:
    readings = Readings(HttpLimits(reads=1))

    async def side_by_side() -> list[int]:
        slow = readings.pieces(piece for piece in (1, 2))
        first = [await anext(slow)]
        others = [one async for one in readings.pieces(piece for piece in (3, 4))]
        return [*first, *others, *[one async for one in slow]]

    assert run(side_by_side) == [1, 3, 4, 2]


def test_a_piece_that_does_not_come_ends_its_download() -> None:
    readings = Readings(HttpLimits(read_timeout_s=0.05))

    def stuck() -> Iterator[int]:
        yield 1
        while True:
            check_patience()
            time.sleep(0.001)

    async def all_pieces() -> None:
        async for _ in readings.pieces(stuck()):  # type: ignore[arg-type]
            pass

    with pytest.raises(ReadingGivenUp):
        run(all_pieces)


def test_closing_gives_up_all_of_them() -> None:
    readings, endless = Readings(LONG), Endless()

    async def closed() -> list[Any]:
        reads = [asyncio.create_task(readings.answer(endless, staying)) for _ in range(2)]
        await asyncio.to_thread(endless.wait_for, 2)
        readings.close()
        return await asyncio.gather(*reads, return_exceptions=True)

    assert [type(one) for one in run(closed)] == [ReadingGivenUp] * 2


@pytest.fixture
def besieged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Served, str, Endless]]:
    """A daemon in which listing captures takes for ever, a capture, and its reads."""
    endless = Endless()
    monkeypatch.setattr("grabberd.server.api.routes.captures.page_of_captures", endless)
    with served(service_in(tmp_path, pace="real"), LONG) as daemon:
        status, document = ask(daemon, "POST", "/api/v1/captures", {"fields": 5})
        assert status == 202
        sealed_in(daemon.service)
        yield daemon, document["id"], endless


def ask(daemon: Served, method: str, path: str, document: Any = None) -> tuple[int, Any]:
    with closing(http.client.HTTPConnection(*daemon.address, timeout=PATIENCE_S)) as connection:
        body = None if document is None else json.dumps(document)
        connection.request(method, path, body, {"Content-Type": "application/json"})
        answer = connection.getresponse()
        return answer.status, json.load(answer)


@contextmanager
def readers(daemon: Served, path: str, count: int) -> Iterator[list[socket.socket]]:
    with ExitStack() as stack:
        clients = [
            stack.enter_context(socket.create_connection(daemon.address, timeout=PATIENCE_S))
            for _ in range(count)
        ]
        for client in clients:
            client.sendall(f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
        yield clients


def test_endless_reads_keep_nobody_from_health_state_and_stop(besieged: tuple[Served, str, Endless]) -> None:
    daemon, capture_id, endless = besieged
    status, running = ask(daemon, "POST", "/api/v1/captures", {"fields": 100_000})
    assert status == 202
    with readers(daemon, "/api/v1/captures", 45) as clients:
        assert endless.wait_for(LONG.reads)
        refused = 45 - LONG.reads * (1 + WAITING_A_THREAD)
        told = [client for client in clients if client in hearing(clients, refused)]
        assert len(told) == refused
        assert all(client.recv(65536).startswith(b"HTTP/1.1 503") for client in told)
        assert ask(daemon, "GET", "/healthz")[0] == 200
        assert ask(daemon, "GET", "/readyz")[0] in (200, 503)
        assert ask(daemon, "GET", "/api/v1/state")[0] == 200
        assert ask(daemon, "POST", f"/api/v1/captures/{running['id']}/stop")[0] == 202
        sealed_in(daemon.service)
        # All of that was answered while the reads went on.
        assert endless.running == endless.begun == LONG.reads
    assert endless.wait_for(0)
    until = time.monotonic() + PATIENCE_S
    while daemon.app.state.readings.count:
        assert time.monotonic() < until
        time.sleep(0.01)
    assert ask(daemon, "GET", f"/api/v1/captures/{capture_id}")[0] == 200


def hearing(clients: list[socket.socket], count: int) -> list[socket.socket]:
    """The clients that have been answered, as soon as they are so many."""
    until = time.monotonic() + PATIENCE_S
    while len(heard := select.select(clients, [], [], 0.05)[0]) < count:
        assert time.monotonic() < until
    return heard


def test_the_daemon_ends_while_endless_reads_run(besieged: tuple[Served, str, Endless]) -> None:
    daemon, _, endless = besieged
    with readers(daemon, "/api/v1/captures", 5):
        assert endless.wait_for(LONG.reads)
        assert daemon.stop()
    assert endless.running == 0
