"""Whatever a file does to its reader, it costs the file's own entry alone."""

import os
import signal  # noqa: F401 - of what the process is told to do
import sys
import time  # noqa: F401

import pytest

from archive.captures import slots, write
from grabberd.archive.state import index_entries
from grabberd.archive.state.index_entries import read_entries
from grabberd.errors import StorageError

LONG_S = 60.0
pytestmark = pytest.mark.usefixtures("importable")


@pytest.fixture
def captures(tmp_path):
    return [write(tmp_path, slots(2), name=f"c{number}", id=f"c{number}") for number in range(4)]


def crash(path, longest_s):
    """Reads an entry in the process, but for the file c1, with which it does what the environment says."""
    with pytest.MonkeyPatch.context() as patch:
        if path.stem == "c1":
            patch.setattr(index_entries, "sealed_entry", lambda _: eval(os.environ["ACT"]))
        return index_entries.read_entry(path, longest_s)


def sabotaged(monkeypatch, act):
    """Has the reading process do something else with the file c1."""
    monkeypatch.setenv("ACT", act)
    monkeypatch.setattr(index_entries, "READ", "archive.state.test_entry_process:crash")


def test_entries_come_in_the_order_of_the_files(captures):
    readings = list(read_entries(captures))
    assert [reading.path for reading in readings] == captures
    assert [reading.entry.id for reading in readings] == ["c0", "c1", "c2", "c3"]
    assert not any(reading.is_damage for reading in readings)


@pytest.mark.parametrize(
    ("act", "words"),
    [
        ("signal.raise_signal(signal.SIGSEGV)", "ends the reader"),
        ("os._exit(0)", "ends the reader"),
        ("bytearray(4 << 30)", "MemoryError"),
        ("1 / 0", "ZeroDivisionError"),
    ],
)
def test_a_file_that_ends_its_reader_is_damaged_and_the_others_are_read(captures, monkeypatch, act, words):
    sabotaged(monkeypatch, act)
    readings = list(read_entries(captures, LONG_S))
    assert [reading.entry.state for reading in readings] == ["sealed", "damaged", "sealed", "sealed"]
    assert words in readings[1].entry.reason
    assert not readings[1].is_damage, "it stays where it is"


def test_a_file_that_holds_up_its_reader_is_given_up(captures, monkeypatch):
    sabotaged(monkeypatch, "time.sleep(600)")
    (reading,) = read_entries(captures[1:2], 0.5)
    assert "takes longer than 0.5 s" in reading.entry.reason


def test_damage_is_told_from_what_may_pass(captures):
    captures[1].write_bytes(b"garbage")
    captures[2].unlink()
    captures[2].symlink_to(captures[0])
    readings = list(read_entries(captures))
    assert [reading.is_damage for reading in readings] == [False, True, True, False]


def test_a_name_of_any_bytes_can_be_asked_for(captures, tmp_path):
    path = tmp_path / os.fsdecode(b"\xff\n.grab")
    captures[0].rename(path)
    (reading,) = read_entries([path])
    assert reading.path == path
    assert "it names the file" in reading.entry.reason


def test_a_reader_that_cannot_be_started_blames_no_file(captures, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(StorageError, match="does not start"):
        list(read_entries(captures))


def test_nothing_to_read_starts_nothing(monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    assert list(read_entries([])) == []
