"""What a crash left is sealed as far as it goes, or set aside; nothing is deleted."""

import shutil
import sqlite3
from datetime import datetime, timedelta

import pytest

from grabberd.acquisition import Ledger, LedgerEntry, Outcome
from grabberd.errors import LaterVersion, StorageError
from grabberd.storage import CaptureReader, CaptureWriter, recover
from grabberd.storage.capture.crash_recovery import set_aside
from storage.captures import MADE_WITH, META, ledger_of, meta, points, slot, slots, write

CUT = "the program ended while it was recording"


@pytest.fixture
def part(tmp_path):
    """A capture as it is on disk in the middle of a transaction, with its hot journal."""
    folder = tmp_path / "before"
    folder.mkdir()
    writer = CaptureWriter.create(folder / "liner.grab.part", meta(bits=8))
    writer.begin_run(1, "live", META.created_utc, "0.1.0", MADE_WITH)
    writer.append([*slots(30, bits=8), slot(33, lost=3, bits=8)])
    for n in range(20):
        writer.append_points(1, n, points(n))
    writer.commit()
    writer._connection.execute("PRAGMA cache_size = 1")  # writes into the file before the commit
    writer.append([slot(n, bits=8) for n in range(34, 90)])
    for file in folder.iterdir():
        shutil.copy(file, tmp_path)
    writer.close()
    return tmp_path / "liner.grab.part"


def test_an_unfinished_commit_is_rolled_back(part):
    assert part.with_name("liner.grab.part-journal").stat().st_size > 0
    with CaptureReader(recover(part)) as reader:
        assert [field.numbered.n for field in reader.fields()] == [*range(30), 33]


def test_it_is_sealed_as_incomplete_with_the_reason_and_what_bounds_the_rest(part):
    path = recover(part, datetime.fromisoformat(META.created_utc) + timedelta(seconds=2))
    assert path.name == "liner.grab"
    with CaptureReader(path) as reader:
        assert (reader.meta.state, reader.meta.complete) == ("sealed", False)
        assert reader.meta.ended_because == CUT
        assert reader.ledger.entries == [
            LedgerEntry(30, 3, Outcome.LOST, "time gap"),
            LedgerEntry(34, 1, Outcome.LOST, f"{CUT}; unknown, at most 66"),
        ]


@pytest.mark.parametrize(("ordered", "missing"), [(40, 8), (33, 1)])
def test_what_was_ordered_tells_what_is_missing_at_its_end(tmp_path, ordered, missing):
    path = cut_after(tmp_path, slots(32), ordered)
    with CaptureReader(path) as reader:
        assert reader.ledger.entries == [LedgerEntry(32, missing, Outcome.LOST, CUT)]
        assert (reader.meta.complete, reader.meta.ended_because) == (False, CUT)


def test_where_the_clock_was_set_back_nothing_bounds_what_is_missing(part):
    with CaptureReader(recover(part, datetime.fromisoformat(META.created_utc))) as reader:
        assert reader.ledger.entries[-1] == LedgerEntry(34, 1, Outcome.LOST, f"{CUT}; unknown")


@pytest.mark.parametrize("order", ["200", {"fields": "200"}, [1], {"length": 3}])
def test_an_order_that_makes_no_sense_sets_the_file_aside(tmp_path, order):
    writer = CaptureWriter.create(tmp_path / "c.grab.part", meta(extra={"order": order}))
    writer.append(slots(3))
    writer.commit()
    writer.close()
    assert recover(tmp_path / "c.grab.part").parent.name == "damaged"


def test_a_capture_that_had_its_length_is_complete_although_it_was_not_sealed(tmp_path):
    with CaptureReader(cut_after(tmp_path, slots(32), 32)) as reader:
        assert reader.ledger.entries == []
        assert reader.meta.complete
        assert reader.meta.ended_because == "the program ended before it was sealed"


def test_a_capture_that_was_cut_before_its_first_field_lacks_all_that_was_ordered(tmp_path):
    with CaptureReader(cut_after(tmp_path, [], 32)) as reader:
        assert reader.ledger.entries == [LedgerEntry(0, 32, Outcome.LOST, CUT)]
        assert not reader.meta.complete


def cut_after(tmp_path, committed, ordered):
    """A capture of given length, recovered after a crash."""
    writer = CaptureWriter.create(tmp_path / "c.grab.part", meta(extra={"order": {"fields": ordered}}))
    writer.append(committed)
    writer.commit()
    writer.close()
    return recover(tmp_path / "c.grab.part")


def test_its_points_are_kept_and_the_run_is_marked(part):
    with CaptureReader(recover(part)) as reader:
        assert [n for n, _ in reader.points(1)] == list(range(20))
        assert (reader.runs[0].state, reader.runs[0].reason) == ("failed", CUT)


def test_nothing_but_the_capture_is_left(part):
    recover(part)
    assert sorted(file.name for file in part.parent.iterdir() if file.is_file()) == ["liner.grab"]


def test_a_capture_whose_name_alone_was_missing_stays_complete(tmp_path):
    sealed = write(tmp_path, slots(5))
    part = sealed.rename(tmp_path / "liner.grab.part")
    with CaptureReader(recover(part)) as reader:
        assert reader.meta.complete
        assert reader.ledger == ledger_of(slots(5))


def test_a_capture_without_a_field_is_sealed_too(tmp_path):
    CaptureWriter.create(tmp_path / "x.grab.part", meta()).close()
    a_second_later = datetime.fromisoformat(META.created_utc) + timedelta(seconds=1)
    with CaptureReader(recover(tmp_path / "x.grab.part", a_second_later)) as reader:
        assert reader.ledger.entries == [LedgerEntry(0, 1, Outcome.LOST, f"{CUT}; unknown, at most 50")]


@pytest.mark.parametrize("content", [b"", b"garbage " * 500])
def test_a_file_that_cannot_be_read_is_set_aside_with_the_reason(tmp_path, content):
    part = tmp_path / "x.grab.part"
    part.write_bytes(content)
    aside = recover(part)
    assert aside == tmp_path / "damaged" / "x.grab.part"
    assert aside.read_bytes() == content
    assert "capture" in (tmp_path / "damaged" / "x.grab.part.txt").read_text()
    assert not part.exists()


def test_a_journal_goes_aside_with_its_file(tmp_path):
    part, journal = tmp_path / "x.grab.part", tmp_path / "x.grab.part-journal"
    part.write_bytes(b"garbage " * 500)
    journal.write_bytes(b"half a transaction")
    aside = set_aside(part, "why")
    assert aside.with_name("x.grab.part-journal").read_bytes() == b"half a transaction"
    assert not journal.exists()


def test_a_file_that_breaks_while_it_is_sealed_is_set_aside(part):
    connection = sqlite3.connect(part)
    page = connection.execute("SELECT rootpage FROM sqlite_schema WHERE name = 'reserve'").fetchone()[0]
    size = connection.execute("PRAGMA page_size").fetchone()[0]
    connection.close()
    with part.open("r+b") as file:
        file.seek((page - 1) * size)
        file.write(b"\xff" * size)
    assert recover(part).parent.name == "damaged"


def test_a_later_versions_file_is_left_alone(tmp_path):
    CaptureWriter.create(tmp_path / "x.grab.part", meta()).close()
    connection = sqlite3.connect(tmp_path / "x.grab.part")
    connection.execute("PRAGMA user_version = 99")
    connection.close()
    with pytest.raises(LaterVersion, match="version 99"):
        recover(tmp_path / "x.grab.part")
    assert (tmp_path / "x.grab.part").exists()


def test_a_second_damaged_file_of_that_name_does_not_overwrite_the_first(tmp_path):
    for content in (b"first " * 300, b"second " * 300):
        (tmp_path / "x.grab.part").write_bytes(content)
        recover(tmp_path / "x.grab.part")
    kept = {file.read_bytes() for file in (tmp_path / "damaged").iterdir() if file.suffix != ".txt"}
    assert kept == {b"first " * 300, b"second " * 300}


def test_a_sealed_capture_of_that_name_is_not_overwritten(tmp_path):
    write(tmp_path, slots(5))
    CaptureWriter.create(tmp_path / "other.grab.part", meta()).close()
    part = (tmp_path / "other.grab.part").rename(tmp_path / "liner.grab.part")
    with pytest.raises(StorageError, match="exists already"):
        recover(part)
    with CaptureReader(tmp_path / "liner.grab") as reader:
        assert reader.field_count == 5


def test_a_ledger_that_was_entered_field_by_field_is_not_counted_twice(tmp_path):
    writer = CaptureWriter.create(tmp_path / "x.grab.part", meta())
    taken = [slot(0), slot(1, Outcome.DAMAGED, "repeated"), slot(2, Outcome.NO_SIGNAL, "no signal"), slot(3)]
    writer.append(taken)
    writer.commit()
    writer.close()
    with CaptureReader(recover(tmp_path / "x.grab.part")) as reader:
        expected = Ledger.restore([0, 3], ledger_of(taken).entries)
        assert reader.ledger.entries[:-1] == expected.entries
