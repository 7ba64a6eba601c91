"""Captures are verified in a process of its own: whatever a file does to it, the others are verified."""

import os

import pytest

from archive.captures import slots, write
from grabberd.archive.capture import verification
from grabberd.archive.capture.verification import verify_files

SABOTAGED = """
import os, signal, time
from grabberd.archive.capture import verification as module
verify = module.verify
module.verify = lambda path: {act} if path.stem == 'c1' else verify(path)
module.main()
"""


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
        ("os.kill(os.getpid(), signal.SIGSEGV)", "ends the reader"),
        ("bytearray(4 << 30)", "MemoryError"),
        ("time.sleep(600)", "takes longer than"),
    ],
)
def test_a_file_that_stops_its_reader_is_damaged(captures, monkeypatch, act, words):
    monkeypatch.setattr(verification, "PROGRAM", SABOTAGED.format(act=act))
    if "sleep" in act:
        monkeypatch.setattr(verification, "_LONGEST_S", 5.0)
    found = list(verify_files(captures[:2]))
    assert words in found[1][1].damages[0]


def test_it_works_behind_everybody_else(captures, monkeypatch):
    look = SABOTAGED.format(act="[os.sched_getscheduler(0), os.nice(0), 0, True, []]")
    monkeypatch.setattr(verification, "PROGRAM", look)
    ((_, found),) = verify_files(captures[1:2])
    assert found[:2] == (os.SCHED_IDLE, 19)
