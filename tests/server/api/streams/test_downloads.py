"""A capture is taken home whole, or the client knows that it is not."""

import http.client
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing
from pathlib import Path
from types import MappingProxyType

import pytest
from capturing import capture
from running import PATIENCE_S, configuration

from archive.another_process import COMMIT, COUNT, LOCKED, another_process
from archive.captures import points
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.runs import append_run
from grabberd.config import default_config_file
from grabberd.instrument.setup import set_up
from grabberd.server.daemon.service import Service
from server.api.streams import Served, served

LARGE = 3000
"""Fields with a hundred points each: more than the sockets of both sides hold."""


@pytest.fixture(scope="module")
def taken(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Served, Path]]:
    """A daemon, and a capture of twenty megabytes with free pages in it, as its reserve leaves them."""
    folder = tmp_path_factory.mktemp("whole")
    service = Service(set_up(configuration({"pace": "free"}), default_config_file()), folder)
    with served(service) as daemon:
        path = capture(service, fields=4)
        add_run(path, LARGE)
        with closing(sqlite3.connect(path)) as database, database:
            database.execute("DELETE FROM points WHERE run = 2 AND last_n < 200")
        yield daemon, path


def add_run(path: Path, count: int) -> None:
    append_run(path, "measure", "2026-03-02T00:00:00Z", "0", {}, ((n, points(n, 100)) for n in range(count)))


def asked(
    daemon: Served, path: Path, headers: Mapping[str, str] = MappingProxyType({})
) -> tuple[http.client.HTTPConnection, http.client.HTTPResponse]:
    connection = http.client.HTTPConnection(*daemon.address, timeout=PATIENCE_S)
    connection.request("GET", f"/api/v1/captures/{path.stem}/file", headers=dict(headers))
    return connection, connection.getresponse()


@pytest.mark.parametrize("which", [{}, {"Range": "bytes=7-"}, {"Range": "bytes=0-9,100-199"}])
def test_it_costs_nobody_who_reads_the_file_meanwhile_the_lock(
    taken: tuple[Served, Path], which: dict[str, str]
) -> None:
    daemon, path = taken
    with CaptureReader(path) as reader:
        reader._connection.execute("BEGIN")
        reader._connection.execute(COUNT).fetchone()
        connection, response = asked(daemon, path, which)
        with closing(connection):
            content = response.read()
        assert another_process(path, COMMIT) == LOCKED
    if "0-9" not in str(which):
        assert content == path.read_bytes()[7 * bool(which) :]


def test_a_run_that_is_added_meanwhile_breaks_the_answer_off(taken: tuple[Served, Path]) -> None:
    daemon, path = taken
    connection, response = asked(daemon, path)
    size = path.stat().st_size
    with closing(connection):
        first = response.read(100_000)
        add_run(path, 10)
        assert path.stat().st_size == size, "a larger one would show by its length alone"
        with pytest.raises(http.client.IncompleteRead) as caught:
            response.read()
    assert len(first) + len(caught.value.partial) < size


def test_asked_again_it_is_whole(taken: tuple[Served, Path], tmp_path: Path) -> None:
    daemon, path = taken
    add_run(path, 10)
    connection, response = asked(daemon, path)
    with closing(connection):
        body = response.read()
    assert body == path.read_bytes()
    copy = tmp_path / "copy.grab"
    copy.write_bytes(body)
    with closing(sqlite3.connect(copy)) as database:
        assert database.execute("PRAGMA integrity_check").fetchone() == ("ok",)


def test_a_commit_in_progress_is_waited_for(taken: tuple[Served, Path]) -> None:
    daemon, path = taken
    with closing(sqlite3.connect(path, isolation_level=None)) as database:
        database.execute("BEGIN EXCLUSIVE")
        connection = http.client.HTTPConnection(*daemon.address, timeout=0.5)
        with closing(connection):
            connection.request("GET", f"/api/v1/captures/{path.stem}/file")
            with pytest.raises(TimeoutError):
                connection.getresponse()
        database.execute("ROLLBACK")
    connection, response = asked(daemon, path)
    with closing(connection):
        assert response.read() == path.read_bytes()
