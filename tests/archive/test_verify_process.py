"""Captures are verified in a process of its own: whatever a file does to it, the others are verified."""

import os
import signal  # noqa: F401 - of what the process is told to do
import time  # noqa: F401

import pytest

from archive.captures import slots, write
from grabberd.archive.capture import verification
from grabberd.archive.capture.verification import verify_files

pytestmark = pytest.mark.usefixtures("importable")


def crash(path):
    """Verifies a file in the process, but for c1, with which it does what the environment says."""
    with pytest.MonkeyPatch.context() as patch:
        if path.stem == "c1":
            patch.setattr(verification, "verify", lambda _: eval(os.environ["ACT"]))
        return verification.check_file(path)


def sabotaged(monkeypatch, act):
    monkeypatch.setenv("ACT", act)
    monkeypatch.setattr(verification, "CHECK", "archive.test_verify_process:crash")


@pytest.fixture
def captures(tmp_path):
    return [write(tmp_path, slots(2), name=f"c{number}", id=f"c{number}") for number in range(3)]


def test_each_file_is_verified(captures):
    captures[1].write_bytes(b"garbage")
    found = dict(verify_files(captures))
    assert list(found) == captures
    assert found[captures[0]] == (2, 0, 0, True, [])
    assert "cannot be read as a capture" in found[captures[1]].damages[0]
    assert found[captures[2]].damages == []


@pytest.mark.parametrize(
    ("act", "words"),
    [
        ("signal.raise_signal(signal.SIGSEGV)", "ends the reader"),
        ("bytearray(4 << 30)", "MemoryError"),
        ("time.sleep(600)", "takes longer than"),
    ],
)
def test_a_file_that_stops_its_reader_is_damaged(captures, monkeypatch, act, words):
    sabotaged(monkeypatch, act)
    if "sleep" in act:
        monkeypatch.setattr(verification, "_LONGEST_S", 5.0)
    found = list(verify_files(captures[:2]))
    assert words in found[1][1].damages[0]


def test_it_works_behind_everybody_else(captures, monkeypatch):
    sabotaged(monkeypatch, "[os.sched_getscheduler(0), os.nice(0), 0, True, []]")
    ((_, found),) = verify_files(captures[1:2])
    assert found[:2] == (os.SCHED_IDLE, 19)
