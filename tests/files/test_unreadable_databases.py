"""A disk that fails to read is no damage, though SQLite says of both that the image is malformed."""

import errno
import os
import sqlite3
from contextlib import closing

import pytest

from grabberd.archive.capture.schema import reading_errors
from grabberd.archive.state.state_database import StateStore
from grabberd.errors import CaptureFileError, StorageError
from grabberd.files.disk import is_damaged, is_unreadable, storage_errors


@pytest.fixture
def path(tmp_path):
    with closing(sqlite3.connect(tmp_path / "a.sqlite")) as connection:
        connection.execute("CREATE TABLE t (n)")
    return tmp_path / "a.sqlite"


@pytest.fixture
def failing_disk(monkeypatch):
    def fail(*_):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os, "pread", fail)


def malformed():
    error = sqlite3.DatabaseError("database disk image is malformed")
    error.sqlite_errorcode = sqlite3.SQLITE_CORRUPT
    return error


@pytest.mark.parametrize("place", [0, 100])
def test_a_file_that_can_be_read_is_damaged_if_its_content_is(path, place):
    content = bytearray(path.read_bytes())
    content[place : place + 20] = bytes(20)
    path.write_bytes(content)
    assert is_damaged(malformed(), path)
    assert not is_unreadable(malformed(), path)


def test_one_that_is_whole_is_not_damaged_for_an_error_of_the_disk_that_has_passed(path):
    assert not is_damaged(malformed(), path)


def test_one_that_the_disk_fails_to_read_is_not(path, failing_disk):
    assert not is_damaged(malformed(), path)
    assert is_unreadable(malformed(), path)


def test_another_error_is_neither(path, failing_disk):
    error = sqlite3.OperationalError("database is locked")
    error.sqlite_errorcode = sqlite3.SQLITE_BUSY
    assert not is_damaged(error, path)
    assert not is_unreadable(error, path)


def test_writing_into_a_database_that_cannot_be_read_is_the_disks_fault(path):
    """The writer's thread ended by it, and its capture stayed unsealed until the next start."""
    with pytest.raises(StorageError, match="malformed"), storage_errors(path):
        raise malformed()


def test_errors_of_the_program_stay_what_they_are(path):
    with pytest.raises(sqlite3.ProgrammingError), storage_errors(path):
        raise sqlite3.ProgrammingError("Cannot operate on a closed database")


def test_a_capture_that_cannot_be_read_now_is_not_set_aside(path, failing_disk):
    with pytest.raises(StorageError, match="cannot be read now"), reading_errors(path):
        raise malformed()


def test_a_damaged_capture_is(path):
    with pytest.raises(CaptureFileError), reading_errors(path):
        raise malformed()


def test_a_state_that_cannot_be_read_now_is_not_replaced_by_a_backup(tmp_path, failing_disk):
    healed = []
    (tmp_path / "state.sqlite").write_bytes(b"whatever")
    store = StateStore(tmp_path / "state.sqlite", healed.append)
    with pytest.raises(StorageError), store.errors():
        raise malformed()
    assert healed == []
