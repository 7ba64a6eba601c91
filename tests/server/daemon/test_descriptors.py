"""File descriptors: as many as the system allows, and always enough of them for recording."""

import errno
import logging
import resource
import subprocess
import sys

import pytest

from grabberd.server.daemon.descriptors import ENOUGH, OWN, Exhaustion, affordable_connections, raise_limit


@pytest.mark.parametrize(("soft", "hard", "then"), [(100, 300, 300), (300, 300, 300), (100, 10**6, ENOUGH)])
def test_the_limit_is_raised_as_far_as_the_system_allows(
    monkeypatch: pytest.MonkeyPatch, soft: int, hard: int, then: int
) -> None:
    limits = {"now": (soft, hard)}
    monkeypatch.setattr(resource, "getrlimit", lambda _: limits["now"])
    monkeypatch.setattr(resource, "setrlimit", lambda _, pair: limits.update(now=pair))
    assert raise_limit() == then
    assert limits["now"] == (then, hard)


def test_a_limit_that_is_more_than_enough_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _: (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    monkeypatch.setattr(resource, "setrlimit", lambda *_: pytest.fail("nothing is to be set"))
    assert raise_limit() == ENOUGH


def test_a_process_raises_its_own_limit() -> None:
    script = (
        "import resource; resource.setrlimit(resource.RLIMIT_NOFILE, (100, 200))\n"
        "from grabberd.server.daemon.descriptors import raise_limit; print(raise_limit())\n"
        "print(*resource.getrlimit(resource.RLIMIT_NOFILE))"
    )
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["200", "200", "200"]


def test_the_default_limit_of_connections_is_affordable_in_the_units_limit() -> None:
    assert affordable_connections(10_000, ENOUGH) == 10_000
    assert affordable_connections(256, 4096) == 256


def test_fewer_connections_are_served_where_recording_would_have_too_few_descriptors(
    caplog: pytest.LogCaptureFixture,
) -> None:
    affordable = affordable_connections(256, 512)
    assert 4 * affordable + OWN < 512
    assert "LimitNOFILE" in caplog.text
    assert affordable_connections(256, 64) == 1, "somebody has to see what is wrong"


def test_exhaustion_is_counted_and_logged_once_a_minute(caplog: pytest.LogCaptureFixture) -> None:
    now_s = 0.0
    exhaustion = Exhaustion(lambda: now_s)
    for _ in range(10_000):
        assert exhaustion.explains(OSError(errno.EMFILE, "Too many open files"))
        now_s += 0.012
    assert exhaustion.count == 10_000
    assert len(caplog.records) == 2
    assert {record.levelno for record in caplog.records} == {logging.ERROR}
    assert "ulimit -n" in caplog.text
    assert caplog.records[0].exc_info is None


@pytest.mark.parametrize("error", [OSError(errno.ENOENT, "gone"), ValueError("EMFILE"), None])
def test_nothing_else_is_explained_by_it(error: Exception | None) -> None:
    exhaustion = Exhaustion()
    assert not exhaustion.explains(error)
    assert exhaustion.count == 0
