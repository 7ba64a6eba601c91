"""`grabberd reprocess`: exit codes, what is printed, and Ctrl-C."""

import json
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from grabberd.cli.app import app
from grabberd.errors import InputError
from support.reprocessing import CALIBRATION, OBJECT, archive, files, only_finished, table

HOW = ("--calibration", str(CALIBRATION), "--object", str(OBJECT))


@pytest.fixture(scope="module")
def captures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("captures")
    archive(folder, 2)
    return folder


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["reprocess", *map(str, words), *HOW, "--workers", "1"])


def test_two_captures_are_measured_then_passed_over(captures: Path, tmp_path: Path) -> None:
    first = run(captures, "--out", tmp_path / "out")
    assert first.exit_code == 0, first.output
    assert "2 measured, 0 already done, 0 failed" in first.output
    assert len(table(tmp_path / "out")["capture"].unique()) == 2
    again = run(captures, "--out", tmp_path / "out", "--json")
    document = json.loads(again.stdout)
    assert (document["measured"], document["unchanged"], document["refused"]) == (0, 2, [])


def test_a_bad_file_is_listed_at_the_end_and_makes_the_exit_code_one(captures: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.grab"
    bad.write_text("no capture")
    (tmp_path / "live.grab.part").touch()
    result = run(captures, tmp_path, "--out", tmp_path / "out")
    assert result.exit_code == 1
    assert "2 measured, 0 already done, 1 failed" in result.output
    assert f"failed: {bad}" in result.output
    assert "hint:" in result.output
    assert "skipped:" in result.output


def test_sources_that_are_not_there_and_workers_of_a_cluster_are_refused(tmp_path: Path) -> None:
    assert isinstance(run(tmp_path / "none", "--out", tmp_path / "out").exception, InputError)
    assert run(tmp_path, "--out", tmp_path / "out", "--scheduler", "tcp://127.0.0.1:1").exit_code == 2


@pytest.mark.slow
def test_an_interrupt_ends_it_orderly_and_the_same_command_goes_on(tmp_path: Path) -> None:
    archive(tmp_path / "captures", 12, 30)
    script = "from grabberd.cli import main; main()"
    words = ["reprocess", str(tmp_path / "captures"), *HOW, "--out", str(tmp_path / "out"), "--workers", "1"]
    with subprocess.Popen(
        [sys.executable, "-c", script, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as running:
        while running.poll() is None and not files(tmp_path / "out"):
            with suppress(subprocess.TimeoutExpired):
                running.wait(0.1)
        running.send_signal(signal.SIGINT)
        output, complaints = running.communicate(timeout=120)
    assert running.returncode == 130, complaints
    assert "measured" in output
    assert "to continue" in complaints
    assert "Traceback" not in complaints
    done = len(files(tmp_path / "out"))
    assert 1 <= done < 12
    assert only_finished(tmp_path / "out")
