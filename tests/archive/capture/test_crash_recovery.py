"""What a crash left is sealed as far as it goes, or set aside; nothing is deleted."""

import json
import shutil
import sqlite3
from contextlib import closing
from datetime import datetime, timedelta

import pytest

from archive.captures import MADE_WITH, META, PERIOD_NS, START_NS, ledger_of, meta, points, slot, slots, write
from grabberd.archive.capture.crash_recovery import recover, set_aside
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.core.ledger import Ledger, LedgerEntry, Outcome
from grabberd.errors import LaterVersion, StorageError
from grabberd.runtime import Now

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
    path = recover(part, now_s(2))
    assert path.name == "liner.grab"
    with CaptureReader(path) as reader:
        assert (reader.meta.state, reader.meta.complete) == ("sealed", False)
        assert reader.meta.ended_because == CUT
        assert reader.ledger.entries == [
            LedgerEntry(30, 3, Outcome.LOST, "time gap"),
            LedgerEntry(34, 1, Outcome.LOST, f"{CUT}; unknown, at most 67"),
        ]


@pytest.mark.parametrize(("ordered", "missing"), [(40, 8), (33, 1)])
def test_what_was_ordered_tells_what_is_missing_at_its_end(tmp_path, ordered, missing):
    path = cut_after(tmp_path, slots(32), ordered)
    with CaptureReader(path) as reader:
        assert reader.ledger.entries == [LedgerEntry(32, missing, Outcome.LOST, CUT)]
        assert (reader.meta.complete, reader.meta.ended_because) == (False, CUT)


@pytest.mark.parametrize("set_by", [timedelta(days=-1), timedelta(seconds=-1), timedelta(days=1)])
def test_setting_the_wall_clock_does_not_change_what_bounds_the_rest(part, set_by):
    assert tail(part, now_s(2, set_by=set_by)) == f"{CUT}; unknown, at most 67"


def test_after_a_restart_of_the_computer_the_wall_clock_bounds_the_rest_unless_it_was_set_back(part):
    reason = tail(part, now_s(2, boot_id="another", booted_s=1.5))
    assert reason == f"{CUT}; unknown, at most 67 unless the clock was set back"


@pytest.mark.parametrize("wall_s", [-3600, -1, 0.5])
def test_a_wall_clock_that_was_clearly_set_back_bounds_nothing(part, wall_s):
    now = Now(START_NS, datetime.fromisoformat(META.created_utc) + timedelta(seconds=wall_s), "another")
    assert tail(part, now) == f"{CUT}; unknown"


def test_a_monotonic_clock_before_the_last_field_bounds_nothing(part):
    assert tail(part, now_s(0.3)) == f"{CUT}; unknown", "such as of a virtual machine that was put back"


@pytest.mark.parametrize("boot_id", ["", None])
def test_without_the_computers_boot_id_the_monotonic_clock_is_not_believed(tmp_path, boot_id):
    changes = {} if boot_id is None else {"boot_id": boot_id}
    path = unfinished(tmp_path, slots(34), meta(**changes))
    reason = tail(path, Now(START_NS + 2 * 10**9, datetime.fromisoformat(META.created_utc), ""))
    assert reason == f"{CUT}; unknown"


def test_nothing_bounds_what_is_missing_of_a_recording_that_is_read_at_its_readers_pace(tmp_path):
    stream = {**META.device["stream"], "waits_for_reader": True}
    path = unfinished(tmp_path, slots(34), meta(device={**META.device, "stream": stream}))
    assert tail(path, now_s(2)) == f"{CUT}; unknown"


def test_a_camera_a_little_faster_than_nominal_does_not_exceed_the_bound(tmp_path):
    hour, fast = 3600 * 50, 1.0001
    late = slot(hour)
    numbered = late.numbered._replace(time_ns=round(START_NS + hour * PERIOD_NS / fast))
    path = unfinished(tmp_path, [slot(0), late._replace(numbered=numbered)], meta())
    came = 100  # in two seconds after the last field on disk
    reason = tail(path, now_s(3600 / fast + came * 0.02 / fast))
    assert int(reason.rpartition(" ")[2]) in (came, came + 1)


def now_s(since_start_s, *, boot_id=META.boot_id, set_by=timedelta(0), booted_s=None):
    """That long after the capture's start, by a computer whose wall clock may have been set meanwhile."""
    utc = datetime.fromisoformat(META.created_utc) + timedelta(seconds=since_start_s) + set_by
    ns = START_NS + round(since_start_s * 1e9) if booted_s is None else round(booted_s * 1e9)
    return Now(ns, utc, boot_id)


def tail(part, now):
    """What the ledger says of the fields after the last one on disk."""
    with CaptureReader(recover(part, now)) as reader:
        last = reader.ledger.entries[-1]
        assert (last.count, last.outcome) == (1, Outcome.LOST)
        return last.reason


@pytest.mark.parametrize("order", ["200", {"fields": "200"}, [1], {"length": 3}])
def test_an_order_that_makes_no_sense_sets_the_file_aside(tmp_path, order):
    part = tmp_path / "c.grab.part"
    writer = CaptureWriter.create(part, meta())
    writer.append(slots(3))
    writer.commit()
    writer.close()
    with closing(sqlite3.connect(part)) as connection, connection:
        extra = json.dumps({"order": order})
        connection.execute("UPDATE meta SET value = ? WHERE key = 'extra'", (extra,))
    assert recover(part).parent.name == "damaged"


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
    return recover(unfinished(tmp_path, committed, meta(extra={"order": {"fields": ordered}})))


def unfinished(tmp_path, committed, its_meta):
    """A capture as a crash leaves it."""
    writer = CaptureWriter.create(tmp_path / "c.grab.part", its_meta)
    writer.append(committed)
    writer.commit()
    writer.close()
    return tmp_path / "c.grab.part"


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
    with CaptureReader(recover(tmp_path / "x.grab.part", now_s(1))) as reader:
        assert reader.ledger.entries == [LedgerEntry(0, 1, Outcome.LOST, f"{CUT}; unknown, at most 51")]


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


def test_a_file_that_breaks_while_it_is_sealed_is_set_aside_and_what_is_whole_is_saved(part):
    connection = sqlite3.connect(part)
    page = connection.execute("SELECT rootpage FROM sqlite_schema WHERE name = 'reserve'").fetchone()[0]
    size = connection.execute("PRAGMA page_size").fetchone()[0]
    connection.close()
    with part.open("r+b") as file:
        file.seek((page - 1) * size)
        file.write(b"\xff" * size)
    path = recover(part)
    assert (part.parent / "damaged" / part.name).exists()
    with CaptureReader(path) as reader:
        assert [field.numbered.n for field in reader.fields()] == [*range(30), 33]


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
