"""What a person sees who starts the daemon at a terminal."""

import os
import pty
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from unittest import mock

import pytest

from grabberd.cli import serve

ADDRESS = "http://127.0.0.1:8050"


def words(is_default: bool = True, *lacking: str) -> str:
    with mock.patch.object(serve, "is_installed", lambda module: module not in lacking):
        return serve.first_words(ADDRESS, Path("/c/fake.yaml"), is_default, Path("/s/captures"))


def test_they_say_where_everything_is() -> None:
    said = words()
    assert said.splitlines()[-1] == f"Open {ADDRESS}"
    for one in (f"{ADDRESS}/docs", "/c/fake.yaml (the simulated grabber", "/s/captures"):
        assert one in said
    assert "not installed" not in said


def test_a_configuration_of_ones_own_is_not_called_simulated() -> None:
    assert "simulated" not in words(False)


def test_what_is_not_installed_is_named_with_its_command() -> None:
    said = words(True, "matplotlib", "h5py")
    assert "figures in reports, points as HDF5: pip install 'grabberd[report,hdf5]'" in said


@pytest.mark.slow
def test_they_come_at_a_terminal_and_not_in_a_journal(tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", "from grabberd.cli import main; main()", "serve", "--port", "0"],
        stderr=theirs,
        stdout=subprocess.DEVNULL,
        env={**os.environ, "STATE_DIRECTORY": str(tmp_path)},
    )
    os.close(theirs)
    said, until = "", time.monotonic() + 60
    try:
        while "Open http" not in said and time.monotonic() < until:
            said += os.read(ours, 4096).decode()
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(30)
        os.close(ours)
    assert re.search(r"\nOpen http://127\.0\.0\.1:\d", said)
    assert str(tmp_path / "captures") in said
