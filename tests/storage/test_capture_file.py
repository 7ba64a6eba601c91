"""A capture file while it is written, and after it was sealed."""

import json
import sqlite3
import threading

import numpy as np
import pytest

from grabberd.acquisition import Ledger, LedgerEntry, Outcome
from grabberd.errors import CaptureFileError, NotFound, StorageError
from grabberd.storage import CaptureReader, CaptureWriter, append_run
from grabberd.storage.schema import APPLICATION_ID, connect
from storage.captures import MADE_WITH, META, ledger_of, meta, points, same_field, slot, slots, write


@pytest.fixture
def part(tmp_path):
    return tmp_path / "liner.grab.part"


@pytest.fixture
def writer(part):
    with_run = CaptureWriter.create(part, meta())
    with_run.begin_run(1, "live", META.created_utc, "0.1.0", MADE_WITH)
    with_run.commit()
    yield with_run
    with_run.close()


def numbers(path):
    with CaptureReader(path) as reader:
        return [field.numbered.n for field in reader.fields()]


# --- fields ---


@pytest.mark.parametrize(("bits", "doubled"), [(1, True), (1, False), (4, False), (8, False)])
def test_fields_come_back_as_they_went_in(tmp_path, bits, doubled):
    taken = slots(120, bits=bits, doubled=doubled)
    with CaptureReader(write(tmp_path, taken, bits=bits)) as reader:
        back = list(reader.received())
    assert len(back) == 120
    for one, other in zip(taken, back, strict=True):
        same_field(one.numbered, other)


def test_fields_can_be_read_from_anywhere_to_anywhere(tmp_path):
    with CaptureReader(write(tmp_path, slots(120))) as reader:
        assert [field.n for field in reader.received(49, 103)] == list(range(49, 103))
        assert list(reader.received(5, 0)) == []
        same_field(reader.field(77).numbered, slot(77).numbered)


def test_a_field_that_is_not_there_is_not_found(tmp_path):
    path = write(tmp_path, [slot(0), slot(5, lost=4)])
    with CaptureReader(path) as reader, pytest.raises(NotFound, match="has no field 3"):
        reader.field(3)


def test_damaged_fields_are_kept_and_told_apart(tmp_path):
    path = write(tmp_path, [slot(0), slot(1, Outcome.DAMAGED, "repeated"), slot(2)])
    with CaptureReader(path) as reader:
        assert [(f.outcome, f.reason) for f in reader.fields()][1] == (Outcome.DAMAGED, "repeated")
        assert [field.n for field in reader.received()] == [0, 2]
        assert reader.field_count == 3


def test_a_predicted_time_is_kept_with_its_field(tmp_path):
    told = "time predicted (zero timestamp)"
    with CaptureReader(write(tmp_path, [slot(0, reason=told)])) as reader:
        assert reader.field(0).reason == told
        assert reader.ledger.complete


# --- ledger and verdict ---


def test_the_ledger_comes_back_as_the_recorder_kept_it(tmp_path):
    taken = [
        *slots(3),
        slot(6, lost=3),
        slot(7, Outcome.NO_SIGNAL, "no signal"),
        slot(8, Outcome.DAMAGED, "repeated"),
        slot(9, Outcome.DAMAGED, "repeated"),
        slot(11, lost=1, lost_reason="unplugged"),
    ]
    with CaptureReader(write(tmp_path, taken)) as reader:
        assert reader.ledger == ledger_of(taken)
        assert not reader.meta.complete


def test_a_capture_with_every_field_is_complete(tmp_path):
    with CaptureReader(write(tmp_path, slots(64))) as reader:
        assert reader.meta.complete
        assert reader.meta.state == "sealed"
        assert reader.meta.ended_because == "length reached"
        assert reader.ledger.in_words(50.0) == "complete"


def test_the_ledger_can_be_read_before_the_end(part, writer):
    writer.append([slot(0), slot(3, lost=2), slot(4, Outcome.DAMAGED, "short buffer")])
    writer.commit()
    with CaptureReader(part) as reader:
        counts = reader.ledger.counts()
    assert counts[Outcome.RECEIVED] == 2
    assert counts[Outcome.LOST] == 2
    assert counts[Outcome.DAMAGED] == 1


# --- meta ---


def test_a_capture_says_what_it_is(tmp_path):
    with CaptureReader(write(tmp_path, slots(1))) as reader:
        assert reader.meta == meta(state="sealed", complete=True, ended_because="length reached")


def test_anybody_can_read_it_with_sqlite_and_json(tmp_path):
    connection = sqlite3.connect(write(tmp_path, slots(3)))
    assert connection.execute("PRAGMA application_id").fetchone()[0] == APPLICATION_ID
    values = {key: json.loads(value) for key, value in connection.execute("SELECT * FROM meta")}
    assert values["labels"] == {"cow": "1807", "teat": "front left"}
    assert connection.execute("SELECT count(*) FROM fields").fetchone() == (3,)
    connection.close()


# --- points and runs ---


def test_points_of_the_live_run_come_back(tmp_path):
    path = write(tmp_path, slots(60), measured=range(60))
    with CaptureReader(path) as reader:
        back = list(reader.points(1))
    assert [n for n, _ in back] == list(range(60))
    for n, one in back:
        assert one.xyz_mm.tobytes() == points(n).xyz_mm.tobytes()


def test_a_run_says_what_it_was_made_with(tmp_path):
    with CaptureReader(write(tmp_path, slots(1), measured=[0])) as reader:
        (run,) = reader.runs
    assert (run.run, run.kind, run.state) == (1, "live", "done")
    assert run.made_with == MADE_WITH


def test_another_run_is_appended_and_the_first_one_stays(tmp_path):
    path = write(tmp_path, slots(4), measured=range(4))
    again = ((n, points(n + 50)) for n in range(4))
    run = append_run(path, "measure", "2026-03-02T00:00:00Z", "0.2.0", {}, again)
    assert run == 2
    with CaptureReader(path) as reader:
        assert [info.kind for info in reader.runs] == ["live", "measure"]
        assert next(reader.points(1))[1].xyz_mm.tobytes() == points(0).xyz_mm.tobytes()
        assert next(reader.points())[1].xyz_mm.tobytes() == points(50).xyz_mm.tobytes()


def test_a_run_that_fails_leaves_nothing(tmp_path):
    path = write(tmp_path, slots(4), measured=range(4))

    def failing():
        yield 0, points(0)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        append_run(path, "measure", "", "", {}, failing())
    with CaptureReader(path) as reader:
        assert len(reader.runs) == 1
    assert [file.name for file in tmp_path.iterdir()] == ["liner.grab"]


def test_readers_are_not_kept_waiting_while_a_run_is_made(tmp_path):
    path = write(tmp_path, slots(120), measured=range(4))
    seen = []

    def measured():
        for n in range(120):
            yield n, points(n, 100)
        with CaptureReader(path) as reader:
            seen.append((len(reader.runs), sum(1 for _ in reader.received())))

    append_run(path, "measure", "", "", {}, measured())
    assert seen == [(1, 120)]


def test_the_latest_run_is_meant_where_none_is_named(tmp_path):
    with CaptureReader(write(tmp_path, slots(1), measured=[0])) as reader:
        assert reader.run(None).run == 1
        with pytest.raises(NotFound, match="has no run 7") as caught:
            reader.run(7)
        assert "1" in caught.value.hint


def test_a_capture_without_points_says_so(tmp_path):
    with CaptureReader(write(tmp_path, slots(1))) as reader, pytest.raises(NotFound, match="no points"):
        reader.latest_run()


def test_points_whose_field_is_not_in_the_file_are_passed_over(part, writer):
    writer.append(slots(2))
    for n in range(3):
        writer.append_points(1, n, points(n))
    writer.commit()
    with CaptureReader(part) as reader:
        assert [n for n, _ in reader.points(1)] == [0, 1]


def test_measuring_that_failed_is_told_with_the_run(part, writer):
    writer.append(slots(1))
    writer.seal(ledger_of(slots(1)), complete=True, ended_because="stopped", measuring_failure="no light")
    with CaptureReader(writer.path) as reader:
        assert (reader.runs[0].state, reader.runs[0].reason) == ("failed", "no light")


# --- while it is being written ---


def test_what_is_committed_can_be_read_while_more_is_being_written(part, writer):
    writer.append(slots(10))
    writer.commit()
    writer.append([slot(10)])
    assert numbers(part) == list(range(10))
    writer.commit()
    assert numbers(part) == list(range(11))


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


# --- bad files ---


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(CaptureFileError, match=r"no capture file .*gone\.grab"):
        CaptureReader(tmp_path / "gone.grab")
    assert list(tmp_path.iterdir()) == []


def test_a_name_with_unusual_letters_can_be_read(tmp_path):
    path = write(tmp_path, slots(2), name="kø 100% #3?")
    assert numbers(path) == [0, 1]


@pytest.mark.parametrize("content", [b"", b"SQLite format 3\0 and then nothing", b"text " * 1000])
def test_a_file_that_is_no_capture_is_refused(tmp_path, content):
    path = tmp_path / "x.grab"
    path.write_bytes(content)
    with pytest.raises(CaptureFileError, match="capture"):
        CaptureReader(path)


def test_another_database_is_refused(tmp_path):
    connection = sqlite3.connect(tmp_path / "x.grab")
    connection.execute("CREATE TABLE meta (key, value)")
    connection.close()
    with pytest.raises(CaptureFileError, match="a database, but no capture"):
        CaptureReader(tmp_path / "x.grab")


def test_a_capture_of_a_later_version_is_refused(tmp_path):
    path = write(tmp_path, slots(1))
    connection = connect(path, writable=True)
    connection.execute("PRAGMA user_version = 99")
    connection.close()
    with pytest.raises(CaptureFileError, match="version 99"):
        CaptureReader(path)


def test_a_truncated_capture_is_refused_not_half_read(tmp_path):
    path = write(tmp_path, slots(200, bits=8), bits=8)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])

    def read():
        with CaptureReader(path) as reader:
            return list(reader.received())

    with pytest.raises(CaptureFileError, match="cannot be read as a capture"):
        read()


def test_a_damaged_field_is_named_and_the_others_can_be_read(tmp_path):
    path = write(tmp_path, slots(3))
    connection = connect(path, writable=True)
    connection.execute("UPDATE fields SET data = x'00' WHERE n = 1")
    connection.close()
    with CaptureReader(path) as reader:
        with pytest.raises(CaptureFileError, match="field 1"):
            reader.field(1)
        assert reader.field(2).numbered.n == 2


def test_a_locked_file_is_not_called_damaged(tmp_path):
    path = write(tmp_path, slots(1))
    other = connect(path, writable=True)
    reader = CaptureReader(path)
    reader._connection.execute("PRAGMA busy_timeout = 0")
    other.execute("BEGIN EXCLUSIVE")
    with pytest.raises(StorageError, match="cannot be read now"):
        reader.field(0)
    other.execute("ROLLBACK")
    other.close()
    reader.close()


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


def test_a_folder_that_is_not_there_is_told(tmp_path):
    with pytest.raises(StorageError, match="cannot be written"):
        CaptureWriter.create(tmp_path / "nowhere" / "x.grab.part", meta())


def test_threads_are_seen_to_by_the_caller_one_at_a_time(writer):
    thread = threading.Thread(target=lambda: (writer.append(slots(3)), writer.commit()))
    thread.start()
    thread.join(10)
    assert numbers(writer.path) == [0, 1, 2]


def test_times_and_thresholds_are_whole_numbers_in_the_file(tmp_path):
    path = write(tmp_path, [slot(0)._replace(numbered=slot(0).numbered._replace(time_ns=np.int64(5)))])
    with CaptureReader(path) as reader:
        assert reader.field(0).numbered.time_ns == 5
        assert reader.first_time_ns == 5
