"""A capture file holds runs: points, and what they were made with."""

import fcntl
import sqlite3
import tracemalloc
from contextlib import closing

import pytest

from archive.captures import MADE_WITH, ledger_of, points, slots, write
from grabberd.archive.capture.groups import GROUPED, MOST_FIELDS
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.runs import append_run
from grabberd.archive.capture.schema import connect
from grabberd.errors import CaptureFileError, NotFound, StorageError

OTHERS = (
    "first_n + 100, last_n + 100, fields, points, field_n, field_points, exact, target, xyz_mm, "
    "covariance_mm2, calibration_covariance_mm2, image_px, residual_px"
)


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


def test_how_well_a_run_was_measured_is_asked_when_its_points_are_known_and_comes_back(tmp_path):
    path = write(tmp_path, slots(4), measured=range(4))
    taken = []
    again = (taken.append(n) or (n, points(n)) for n in range(4))
    append_run(path, "measure", "", "", {}, again, lambda: {"verdict": "measured_well", "fields": len(taken)})
    with CaptureReader(path) as reader:
        first, second = reader.runs
    assert first.coverage is None
    assert second.coverage == {"verdict": "measured_well", "fields": 4}


def test_the_live_run_is_sealed_with_its_coverage(tmp_path):
    path = write(tmp_path, slots(2), measured=range(2), coverage={1: {"verdict": "not_measured"}})
    with CaptureReader(path) as reader:
        (run,) = reader.runs
        assert reader.meta.state == "sealed"
    assert run.coverage == {"verdict": "not_measured"}


def test_coverage_that_is_no_document_is_damage(tmp_path):
    path = write(tmp_path, slots(2), measured=range(2), coverage={1: {"verdict": "measured_well"}})
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("UPDATE meta SET value = '[1]' WHERE key = 'coverage.1'")
        connection.commit()
    with CaptureReader(path) as reader, pytest.raises(CaptureFileError, match="coverage of run 1"):
        _ = reader.runs


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


def test_memory_holds_few_points_however_long_a_run_is(tmp_path):
    path = write(tmp_path, slots(4))
    tracemalloc.start()
    append_run(path, "measure", "", "", {}, ((n, points(n % 7, 100)) for n in range(1500)))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert path.stat().st_size > 1_500_000
    assert most < 4_000_000  # all of them would take 40 MB
    with CaptureReader(path) as reader:
        assert [n for n, _ in reader.points(1)] == [0, 1, 2, 3]


def test_a_run_for_which_there_is_no_room_leaves_the_capture_as_it_was(tmp_path, monkeypatch):
    path = write(tmp_path, slots(4), measured=range(4))

    def limited(*arguments, **options):
        connection = connect(*arguments, **options)
        pages = connection.execute("PRAGMA page_count").fetchone()[0]
        connection.execute(f"PRAGMA max_page_count = {pages + 3}")
        return connection

    monkeypatch.setattr("grabberd.archive.capture.runs.connect", limited)
    with pytest.raises(StorageError, match="full"):
        append_run(path, "measure", "", "", {}, ((n, points(n, 100)) for n in range(200)))
    assert [file.name for file in tmp_path.iterdir()] == ["liner.grab"]
    with CaptureReader(path) as reader:
        assert len(reader.runs) == 1
        assert [n for n, _ in reader.points()] == [0, 1, 2, 3]


def test_a_run_is_seen_when_it_is_whole_and_others_read_while_it_is_copied(tmp_path, monkeypatch):
    path = write(tmp_path, slots(4), measured=range(4))
    seen = []

    def look(_):
        with CaptureReader(path) as reader:
            seen.append((len(reader.runs), [n for n, _ in reader.points()]))

    monkeypatch.setattr(
        "grabberd.archive.capture.runs.point_table", lambda _: GROUPED._replace(rows_a_commit=1)
    )
    monkeypatch.setattr("grabberd.archive.capture.runs.runtime.sleep", look)
    append_run(path, "measure", "", "", {}, ((n, points(n)) for n in range(2 * MOST_FIELDS)))
    assert seen == [(1, [0, 1, 2, 3])] * 3
    with CaptureReader(path) as reader:
        assert [info.run for info in reader.runs] == [1, 2]


def test_what_a_killed_program_left_of_a_run_is_nobodys_and_removed_by_the_next(tmp_path):
    path = write(tmp_path, slots(4), measured=range(4))
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute(f"INSERT INTO points SELECT 2, {OTHERS} FROM points")
    with CaptureReader(path) as reader:
        assert [n for n, _ in reader.points()] == [0, 1, 2, 3]
    assert append_run(path, "measure", "", "", {}, [(0, points(0))]) == 2
    with closing(sqlite3.connect(path)) as connection:
        assert connection.execute("SELECT first_n FROM points WHERE run = 2").fetchall() == [(0,)]


def test_two_programs_do_not_add_a_run_at_once(tmp_path):
    path = write(tmp_path, slots(4), measured=range(4))
    with path.open("rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        with pytest.raises(StorageError, match="another program is adding a run"):
            append_run(path, "measure", "", "", {}, [(0, points(0))])
    assert append_run(path, "measure", "", "", {}, [(0, points(0))]) == 2


def test_the_latest_run_is_meant_where_none_is_named(tmp_path):
    with CaptureReader(write(tmp_path, slots(1), measured=[0])) as reader:
        assert reader.run(None).run == 1
        with pytest.raises(NotFound, match="has no run 7") as caught:
            reader.run(7)
        assert "1" in caught.value.hint


def test_a_capture_without_points_says_so(tmp_path):
    with CaptureReader(write(tmp_path, slots(1))) as reader, pytest.raises(NotFound, match="no points"):
        reader.run(None)


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
