"""What is no capture file, or a damaged one, is refused by name."""

import shutil
import sqlite3
from contextlib import closing, suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from archive.captures import numbers, slot, slots, write
from grabberd.archive.capture.reader import CaptureReader, stat_at_rest
from grabberd.archive.capture.schema import connect
from grabberd.errors import CaptureFileError, GrabberdError, StorageError


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(CaptureFileError, match=r"no capture file .*gone\.grab"):
        CaptureReader(tmp_path / "gone.grab")
    assert list(tmp_path.iterdir()) == []


def test_one_that_was_sealed_since_its_path_was_looked_up_is_read_by_its_name_now(tmp_path):
    sealed = write(tmp_path, slots(2))
    before = sealed.with_name(f"{sealed.name}.part")
    with CaptureReader(before) as reader:
        assert reader.path == sealed
    assert stat_at_rest(before) == sealed.stat()
    sealed.unlink()
    with pytest.raises(CaptureFileError, match=r"no capture file .*\.grab\.part"):
        CaptureReader(before)


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
    path = write(tmp_path, slots(3), fields_a_commit=1)
    connection = connect(path, writable=True)
    connection.execute("UPDATE pictures SET data = x'00' WHERE first_n = 1")
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


def columns_of(path):
    """(table, column) of everything that a reader reads."""
    with closing(sqlite3.connect(path)) as connection:
        for table in ("meta", "fields", "pictures", "ledger", "runs", "points"):
            for column in connection.execute(f"PRAGMA table_info({table})").fetchall():
                yield table, column[1]


def read_all(path):
    """Whatever there is to read; how many fields and points."""
    with CaptureReader(path) as reader:
        assert reader.ledger.total >= 0
        for run in reader.runs:
            reader.point_count(run.run)
            reader.point_span(run.run)
        fields = list(reader.fields())
        return len(fields), len(list(reader.points())), reader.first_time_ns, reader.field_count


@pytest.mark.parametrize("value", [None, "garbage", "[1]", -1, 2**62, 1.5, b"\0\xff"])
def test_whatever_a_damaged_cell_says_a_reader_says_it_of_the_capture(tmp_path, value):
    whole = write(tmp_path, [*slots(3), slot(5, lost=2)], measured=[0, 1])
    for table, column in columns_of(whole):
        path = tmp_path / f"{table}-{column}.grab"
        shutil.copy(whole, path)
        with closing(sqlite3.connect(path, isolation_level=None)) as connection, suppress(sqlite3.Error):
            connection.execute(f"UPDATE {table} SET {column} = ? WHERE rowid = 1", (value,))
        with suppress(GrabberdError):
            read_all(path)


@given(st.lists(st.tuples(st.integers(0, 2**31), st.integers(1, 255)), min_size=1, max_size=20))
def test_whatever_bytes_are_damaged_a_reader_says_it_of_the_capture(whole, flips):
    content = bytearray(whole.read_bytes())
    for place, flip in flips:
        content[place % len(content)] ^= flip
    path = whole.with_name("flipped.grab")
    path.write_bytes(content)
    with suppress(GrabberdError):
        read_all(path)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return write(tmp_path_factory.mktemp("whole"), slots(30), measured=range(20))
