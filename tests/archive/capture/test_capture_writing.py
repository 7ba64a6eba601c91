"""A capture file while it is written, sealed, and when the disk is full."""

import sqlite3
import threading

import pytest

from archive.captures import ledger_of, meta, numbers, slot, slots
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.schema import JOURNAL_BYTES
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.guarded_database import JOURNAL
from grabberd.core.ledger import Ledger, LedgerEntry, Outcome
from grabberd.errors import StorageError
from grabberd.files import disk

# --- while it is being written ---


def test_what_is_committed_can_be_read_while_more_is_being_written(part, writer):
    writer.append(slots(10))
    writer.commit()
    writer.append([slot(10)])
    assert numbers(part) == list(range(10))
    writer.commit()
    assert numbers(part) == list(range(11))


def test_the_journal_of_the_last_transaction_has_its_room_on_the_disk_already(part, writer):
    journal = part.with_name(part.name + JOURNAL)
    writer.append(slots(25))
    assert 512 * journal.stat().st_blocks >= JOURNAL_BYTES
    writer.commit()
    assert 512 * journal.stat().st_blocks >= JOURNAL_BYTES


def test_readers_and_the_writer_get_along(part, writer):
    counted = []

    def read():
        while not counted or counted[-1] < 300:
            with CaptureReader(part) as reader:
                counted.append(sum(1 for _ in reader.received()))

    thread = threading.Thread(target=read)
    thread.start()
    for n in range(0, 300, 10):
        writer.append([slot(i) for i in range(n, n + 10)])
        writer.commit()
    thread.join(30)
    assert counted[-1] == 300
    assert counted == sorted(counted)


def test_a_reader_that_was_there_before_goes_on_after_sealing(part, writer):
    writer.append(slots(120))
    writer.commit()
    with CaptureReader(part) as reader:
        fields = reader.received()
        first = next(fields)
        writer.seal(ledger_of(slots(120)), complete=True, ended_because="stopped")
        assert [first.n, *(field.n for field in fields)] == list(range(120))


def test_threads_are_seen_to_by_the_caller_one_at_a_time(writer):
    thread = threading.Thread(target=lambda: (writer.append(slots(3)), writer.commit()))
    thread.start()
    thread.join(10)
    assert numbers(writer.path) == [0, 1, 2]


# --- sealing ---


def test_a_sealed_capture_is_one_file(tmp_path, writer):
    writer.append(slots(5))
    path = writer.seal(ledger_of(slots(5)), complete=True, ended_because="stopped")
    assert [file.name for file in tmp_path.iterdir()] == ["liner.grab"] == [path.name]


def test_sealing_writes_what_has_not_been_committed(writer):
    writer.append(slots(5))
    path = writer.seal(ledger_of(slots(5)), complete=True, ended_because="stopped")
    assert numbers(path) == list(range(5))


def test_fields_that_never_got_into_the_file_are_lost_in_its_ledger(writer):
    writer.append(slots(5))
    path = writer.seal(ledger_of([*slots(8), slot(12, lost=4)]), complete=False, ended_because="disk full")
    with CaptureReader(path) as reader:
        assert reader.ledger.entries == [
            LedgerEntry(5, 3, Outcome.LOST, "not written to disk"),
            LedgerEntry(8, 4, Outcome.LOST, "time gap"),
            LedgerEntry(12, 1, Outcome.LOST, "not written to disk"),
        ]


def test_a_capture_that_is_there_is_not_overwritten(tmp_path, part, writer):
    with pytest.raises(StorageError, match="exists already"):
        CaptureWriter.create(part, meta())
    writer.seal(Ledger(), complete=False, ended_because="stopped")
    with pytest.raises(StorageError, match="exists already"):
        CaptureWriter.create(part, meta())
    assert numbers(tmp_path / "liner.grab") == []


def test_sealing_does_not_overwrite_a_file_that_came_in_between(tmp_path, writer):
    (tmp_path / "liner.grab").write_text("somebody's")
    with pytest.raises(StorageError, match="exists already"):
        writer.seal(Ledger(), complete=False, ended_because="stopped")
    assert (tmp_path / "liner.grab").read_text() == "somebody's"


# --- a full or broken disk ---


def fill_up(writer):
    written = 0
    for n in range(10_000):
        writer.append([slot(n, bits=8)])
        writer.commit()
        written = n + 1
    return written


def test_a_full_disk_is_told_and_what_was_committed_stays(part):
    writer = CaptureWriter.create(part, meta(bits=8), max_pages=200)
    with pytest.raises(StorageError, match="full") as caught:
        fill_up(writer)
    assert "kept" in caught.value.hint
    kept = numbers(part)
    assert len(kept) > 10
    assert kept == list(range(len(kept)))
    writer.close()


def test_a_capture_is_sealed_even_on_a_full_disk(part):
    writer = CaptureWriter.create(part, meta(bits=8), max_pages=200)
    with pytest.raises(StorageError):
        fill_up(writer)
    ledger = Ledger.restore(range(2_000), [])
    path = writer.seal(ledger, complete=False, ended_because="the disk is full")
    with CaptureReader(path) as reader:
        kept = reader.field_count
        assert reader.meta.complete is False
        assert reader.meta.ended_because == "the disk is full"
        assert reader.ledger.entries == [LedgerEntry(kept, 2_000 - kept, Outcome.LOST, "not written to disk")]


def test_a_driver_with_much_to_say_keeps_no_capture_from_being_sealed(writer):
    said = "USB: " + "device descriptor read, error -71; " * 5000
    recorded = [*slots(2), slot(2, Outcome.DAMAGED, said), slot(9, lost=6, lost_reason=said)]
    writer.append(recorded)
    path = writer.seal(ledger_of(recorded), complete=False, ended_because=said)
    with CaptureReader(path) as reader:
        assert reader.meta.ended_because == said
        assert [entry.reason for entry in reader.ledger.entries] == [said, said]


def test_a_folder_that_is_not_there_is_told(tmp_path):
    with pytest.raises(StorageError, match="cannot be written"):
        CaptureWriter.create(tmp_path / "nowhere" / "x.grab.part", meta())


def failing(monkeypatch, beginning):
    """The disk refuses statements of this beginning."""

    class Failing(disk.HeldConnection):
        def execute(self, statement, *values):
            self.refuse(statement)
            return super().execute(statement, *values)

        def executemany(self, statement, *values):
            self.refuse(statement)
            return super().executemany(statement, *values)

        def refuse(self, statement):
            if statement.startswith(beginning):
                raise sqlite3.OperationalError("disk I/O error")

    monkeypatch.setattr(disk, "HeldConnection", Failing)


@pytest.mark.parametrize(
    "beginning", ["PRAGMA journal_mode", "INSERT INTO reserve", "INSERT OR REPLACE INTO meta", "COMMIT"]
)
def test_a_capture_that_cannot_begin_leaves_no_file(tmp_path, monkeypatch, beginning):
    """Nobody would seal it, and the next start would take it for one that a crash has cut off."""
    failing(monkeypatch, beginning)
    with pytest.raises(StorageError):
        CaptureWriter.create(tmp_path / "liner.grab.part", meta())
    assert list(tmp_path.iterdir()) == []
