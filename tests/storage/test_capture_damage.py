"""What is no capture file, or a damaged one, is refused by name."""

import sqlite3

import pytest

from grabberd.errors import CaptureFileError, StorageError
from grabberd.storage import CaptureReader
from grabberd.storage.schema import connect
from storage.captures import numbers, slots, write


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
