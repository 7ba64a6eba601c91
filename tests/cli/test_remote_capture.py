"""Captures through a running daemon, as a person types them: with a length, armed, triggered, disarmed."""

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from running import PATIENCE_S
from typer.testing import CliRunner, Result

from grabberd.archive.capture.reader import CaptureReader
from grabberd.cli.app import app
from grabberd.errors import Conflict, GrabberdError
from server.api.daemons import Daemon, serving


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    with serving(tmp_path_factory.mktemp("daemon"), pace="real") as running:
        yield running


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


def wait_until_the_ring_holds(daemon: Daemon, slots: int) -> None:
    """It has been filling for so long."""
    with daemon.service.instrument(None).pipeline.ring.reader() as reader:
        for _ in range(slots):
            assert reader.take(PATIENCE_S) is not None


def begun(*words: object) -> "subprocess.Popen[str]":
    """A command that waits, once it has said that its capture is armed."""
    command = [sys.executable, "-c", "from grabberd.cli import main; main()", *map(str, words)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    for line in process.stderr:
        if line.startswith("armed: "):
            return process
    raise AssertionError(process.wait())


def test_a_capture_of_some_length_comes_home(daemon: Daemon, tmp_path: Path) -> None:
    wait_until_the_ring_holds(daemon, 4)
    out = tmp_path / "liner.grab"
    result = run("capture", "--url", daemon.url, "--fields", 10, "--pre-trigger", 4, "--out", out, "--json")
    document = json.loads(result.stdout)
    assert document["fields"] == 10
    with CaptureReader(out) as reader:
        before = document["pre_trigger_fields"]
        never_came = sum(one.count for one in reader.ledger.entries if one.first_n < before)
        assert before == 4 + never_came


@pytest.mark.slow
def test_an_armed_one_waits_for_its_trigger_and_has_what_was_before_it(
    daemon: Daemon, tmp_path: Path
) -> None:
    out = tmp_path / "slip.grab"
    order = ("capture", "--armed", "--url", daemon.url, "--out", out, "--json")
    process = begun(*order, "--pre-trigger", 8, "--duration-s", 0.3)
    triggered = run("trigger", "--url", daemon.url, "--json")
    assert json.loads(triggered.stdout)["state"] in ("recording", "sealing", "sealed")
    output, _ = process.communicate(timeout=2 * PATIENCE_S)
    assert json.loads(output)["pre_trigger_fields"] >= 8
    with CaptureReader(out) as reader:
        before_n = 8 + sum(
            one.count for one in reader.ledger.entries
        )  # slots, whatever was lost between them
        assert 8 + 15 <= reader.ledger.total <= before_n + 15


@pytest.mark.slow
def test_turning_away_disarms_it_and_leaves_nothing(daemon: Daemon, tmp_path: Path) -> None:
    process = begun("capture", "--armed", "--url", daemon.url, "--out", tmp_path / "slip.grab")
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=2 * PATIENCE_S)
    assert process.returncode == 1
    assert "before it was triggered" in errors
    assert daemon.service.instrument(None).captures.armed is None
    assert list(tmp_path.iterdir()) == []


def test_a_trigger_without_an_armed_capture_says_how_to_arm_one(daemon: Daemon) -> None:
    result = run("trigger", "--url", daemon.url)
    assert isinstance(result.exception, Conflict)
    assert "grabberd capture --armed" in result.exception.hint
    unknown = run("trigger", "20200101T000000000Z-none", "--url", daemon.url)
    assert isinstance(unknown.exception, GrabberdError)
    assert "no capture" in unknown.exception.message


def test_an_armed_capture_without_a_daemon_says_how_to_start_one(tmp_path: Path) -> None:
    result = run("capture", "--armed", "--url", "http://127.0.0.1:9", "--out", tmp_path / "a.grab")
    assert isinstance(result.exception, GrabberdError)
    assert "grabberd serve" in result.exception.hint


def test_lengths_of_both_kinds_are_refused(tmp_path: Path) -> None:
    for more in ((), ("--armed",)):
        words = ("capture", "--fields", 5, "--duration-s", 1, "--out", tmp_path / "a.grab", *more)
        assert run(*words).exit_code == 2
