"""A capture whose file cannot be sealed is tried again, with all that was known of it, until it is."""

import logging
import sqlite3
from pathlib import Path

import pytest
from recording_rig import PATIENCE_S, Rig
from slots import slot

from grabberd.archive.capture import writer
from grabberd.archive.capture.reader import CaptureReader
from grabberd.errors import Cause, StorageError
from grabberd.fault_board import FaultBoard
from grabberd.instrument.capture.recording import Recording
from grabberd.instrument.capture_end import LONGEST_NS, UnsealedCaptures

FULL = StorageError("one.grab.part cannot be written: unable to open database file", "close clients")


class Unsealed:
    """A capture of five fields that could not be sealed, and what tries it again."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.patch, self.folder = monkeypatch, folder
        self.rig = Rig(folder, 5, 100, measured=False)
        self.sealed: list[Recording] = []
        self.given_up: list[Recording] = []
        self.away: StorageError | None = None
        self.faults = FaultBoard(self.rig.clock)
        self.unsealed = UnsealedCaptures(
            self._check, self.sealed.append, self.given_up.append, self.faults, self.rig.clock
        )
        self.patch.setattr(writer, "publish", self._refuse)
        self.rig.recording.start()
        self.rig.put(*(slot(n) for n in range(5)))
        assert self.recording.sealed.wait(PATIENCE_S)
        self.unsealed.add(self.recording)

    @property
    def recording(self) -> Recording:
        return self.rig.recording

    def _refuse(self, _: Path) -> Path:
        raise FULL

    def _check(self) -> None:
        if self.away is not None:
            raise self.away

    def retry(self, times: int = 1, after_s: float = LONGEST_NS / 1e9) -> None:
        for _ in range(times):
            self.rig.clock.advance(after_s)
            self.unsealed.retry()


@pytest.fixture
def one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Unsealed:
    return Unsealed(tmp_path, monkeypatch)


def test_it_is_a_fault_that_names_the_capture_and_why(one: Unsealed) -> None:
    assert not one.recording.is_sealed
    (fault,) = one.faults.now
    assert fault.cause_code is Cause.CAPTURE_UNSEALED
    assert "one" in fault.message
    assert "unable to open" in fault.message


def test_it_is_sealed_as_complete_when_nothing_but_the_seal_had_failed(one: Unsealed) -> None:
    assert one.recording.verdict == "incomplete"
    one.patch.undo()
    one.retry()
    assert one.sealed == [one.recording]
    assert one.recording.is_sealed
    assert one.recording.complete
    assert one.unsealed.captures == ()
    assert one.faults.now == []
    with CaptureReader(one.folder / "one.grab") as reader:
        assert reader.meta.complete
        assert reader.ledger.received == 5
        assert reader.meta.ended_because == "length reached"
    assert [path.name for path in one.folder.glob("one*")] == ["one.grab"]


def test_until_then_it_is_counted_and_the_log_has_one_line(
    one: Unsealed, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    one.retry(200)
    assert one.unsealed.attempts == 201
    assert caplog.records == []
    (fault,) = one.faults.now
    assert "201 attempts have failed" in fault.message


def test_the_attempts_come_ever_more_seldom(one: Unsealed) -> None:
    one.retry(3600, after_s=1.0)
    assert 60 <= one.unsealed.attempts <= 66
    one.patch.undo()
    one.retry()
    assert one.recording.is_sealed


def test_while_the_folder_is_gone_nothing_is_tried(one: Unsealed) -> None:
    one.away = StorageError("the folder of captures is gone", "mount it", Cause.CAPTURES_MISSING)
    one.retry(10)
    assert one.unsealed.attempts == 1
    one.patch.undo()
    one.away = None
    one.retry()
    assert one.recording.is_sealed


def test_a_capture_that_lost_fields_stays_incomplete(one: Unsealed) -> None:
    one.recording._storage_failure = StorageError("disk full", "make room")
    one.patch.undo()
    one.retry()
    assert one.recording.is_sealed
    assert not one.recording.complete


def test_one_whose_new_name_alone_is_not_on_the_disk_yet_is_sealed(one: Unsealed) -> None:
    (one.folder / "one.grab.part").rename(one.folder / "one.grab")
    one.patch.undo()
    one.retry()
    assert one.recording.path == one.folder / "one.grab"
    assert one.recording.is_sealed


@pytest.mark.parametrize("damaged", [False, True])
def test_a_file_that_was_deleted_or_damaged_is_given_up(
    one: Unsealed, damaged: bool, caplog: pytest.LogCaptureFixture
) -> None:
    part = one.folder / "one.grab.part"
    if damaged:
        part.write_bytes(b"garbage " * 1000)
    else:
        part.unlink()
    one.patch.undo()
    one.retry()
    assert one.unsealed.captures == ()
    assert one.sealed == []
    assert one.given_up == [one.recording]
    assert one.faults.now == []
    assert "given up" in caplog.text
    assert part.exists() == damaged


def test_the_real_thing_a_disk_that_refuses_the_sealing_transaction(one: Unsealed) -> None:
    one.patch.undo()
    holder = sqlite3.connect(one.folder / "one.grab.part", isolation_level=None)
    holder.execute("BEGIN EXCLUSIVE")
    connect = sqlite3.connect
    with one.patch.context() as patch:
        patch.setattr(sqlite3, "connect", lambda *given, **how: connect(*given, **{**how, "timeout": 0.0}))
        one.retry()
    assert one.unsealed.attempts == 2
    holder.close()
    one.retry()
    assert one.recording.is_sealed
