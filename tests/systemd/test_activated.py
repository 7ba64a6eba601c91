"""The daemon under its unit's filters, without a network, on a socket that it did not open."""

import shutil
import signal
import sys
from collections.abc import Iterator
from ctypes.util import find_library
from pathlib import Path

import pytest

from grabberd.config import shipped_configs
from systemd.activated import Daemon, activated, without_network

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        sys.platform != "linux" or not find_library("seccomp"), reason="libseccomp is missing"
    ),
    pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="systemd-analyze is missing"),
]


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    with activated(tmp_path_factory.mktemp("daemon"), shipped_configs() / "fake.yaml", watchdog_s=2.0) as one:
        one.hear("READY=1")
        one.hear("STATUS=simulated is ready")
        yield one


def test_it_serves_a_socket_that_was_handed_over(daemon: Daemon) -> None:
    assert daemon.ask("/healthz")


@pytest.mark.skipif(not without_network(), reason="this machine lets nobody take a network away")
def test_it_has_no_network(daemon: Daemon) -> None:
    lines = Path(f"/proc/{daemon.process.pid}/net/dev").read_text().splitlines()[2:]
    assert [line.split(":")[0].strip() for line in lines] == ["lo"]


def test_the_filters_are_in_force(daemon: Daemon) -> None:
    status = Path(f"/proc/{daemon.process.pid}/status").read_text()
    assert "NoNewPrivs:\t1" in status
    assert "Seccomp:\t2" in status


def test_it_is_fed_and_says_how_it_fares(daemon: Daemon) -> None:
    assert daemon.hear("WATCHDOG=1")
    assert daemon.hear("WATCHDOG=1")
    assert any(words.startswith("STATUS=simulated is ") for words in daemon.heard)


def test_it_captures_and_its_niced_process_carries_jobs_out(daemon: Daemon) -> None:
    capture = daemon.ask("/api/v1/captures", {"fields": 16})["id"]
    daemon.wait_for(f"/api/v1/captures/{capture}", "state", "sealed")
    job = daemon.ask(f"/api/v1/captures/{capture}/measure", {})["id"]
    assert daemon.wait_for(f"/api/v1/jobs/{job}", "state", "done", "failed")["state"] == "done"


def test_it_ends_when_it_is_told_and_says_so(daemon: Daemon) -> None:
    daemon.process.send_signal(signal.SIGTERM)
    daemon.hear("STOPPING=1")
    assert daemon.process.wait(30) in (0, -signal.SIGTERM)


def test_a_wrong_configuration_is_told_by_the_exit_code(tmp_path: Path) -> None:
    (tmp_path / "wrong.yaml").write_text("devices: {}\n")
    with activated(tmp_path, tmp_path / "wrong.yaml") as one:
        assert one.process.wait(30) == 78
