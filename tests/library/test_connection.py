"""A running daemon as a Python program has it."""

from collections.abc import Iterator

import pytest
from running import PATIENCE_S

import grabberd
from grabberd.errors import GrabberdError, NotReady
from server.api.daemons import Daemon, serving


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    with serving(tmp_path_factory.mktemp("daemon"), pace="real") as running:
        yield running


@pytest.fixture
def connection(daemon: Daemon) -> grabberd.Connection:
    return grabberd.connect(daemon.url)


def test_a_capture_is_started_waited_for_and_opened(connection: grabberd.Connection) -> None:
    started = connection.start(fields=10, labels={"cow": "112", "liner": "A"}, note="slipped")
    ended = started.wait(PATIENCE_S)
    assert (ended.state, ended.labels) == ("sealed", {"cow": "112", "liner": "A"})
    with ended.open() as capture:
        assert (capture.id, len(capture.fields), capture.meta.note) == (ended.id, 10, "slipped")


def test_captures_are_found_by_their_labels(connection: grabberd.Connection) -> None:
    one = connection.start(fields=5, labels={"cow": "7"}).wait(PATIENCE_S)
    one.label(cow="8", teat="front left")
    assert [found.id for found in connection.captures(cow="8")] == [one.id]
    assert connection.capture(one.id).labels == {"cow": "8", "teat": "front left"}
    assert list(connection.captures(cow="7")) == []


def test_captures_of_several_pages_come_as_one_list(
    connection: grabberd.Connection, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = [connection.start(fields=2, labels={"day": "long"}).wait(PATIENCE_S).id for _ in range(3)]
    monkeypatch.setattr("grabberd.client.daemon.LONGEST_PAGE", 2)
    assert [one.id for one in connection.captures(day="long")] == made[::-1]


def test_a_capture_without_a_length_is_stopped(connection: grabberd.Connection) -> None:
    running = connection.start()
    with pytest.raises(NotReady, match=r"is recording after 0\.2 s"):
        running.wait(0.2)
    assert running.stop().wait(PATIENCE_S).state == "sealed"


def test_points_come_as_they_are_measured(connection: grabberd.Connection) -> None:
    stream = connection.stream()
    first, second = next(stream), next(stream)
    assert second.frame.n > first.frame.n
    assert first.frame.xyz_mm.shape == (len(first.frame.target), 3)


def test_the_state_has_the_verdict_on_health(connection: grabberd.Connection, daemon: Daemon) -> None:
    (device,) = connection.state["devices"].values()
    assert device["health"]


def test_refusals_are_the_daemons_own_words(connection: grabberd.Connection) -> None:
    with pytest.raises(GrabberdError, match="fields") as caught:
        connection.start(fields=-1)
    assert caught.value.hint
    with pytest.raises(NotReady, match="no daemon answers"):
        _ = grabberd.connect("http://127.0.0.1:9").state
