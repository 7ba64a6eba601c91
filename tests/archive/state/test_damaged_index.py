"""An index that is damaged is made again from the captures, also while it is used."""

import sqlite3
from pathlib import Path

import pytest

from archive.captures import slots, write
from grabberd.archive.state.capture_index import CaptureIndex


def test_a_damaged_index_is_made_again(archive):
    (archive / "index.sqlite").write_bytes(b"garbage " * 1000)
    index = CaptureIndex(archive)
    index.rebuild()
    assert len(index.list()) == 3


def garbage(path):
    path.write_bytes(b"garbage " * 1000)


def a_damaged_page(path):
    with path.open("r+b") as file:
        file.seek(4096)
        file.write(b"\xff" * 4096)


def emptied(path):
    path.unlink()
    sqlite3.connect(path).close()
    path.touch()


@pytest.mark.parametrize("harm", [garbage, a_damaged_page, emptied, Path.unlink])
def test_an_index_that_is_damaged_or_deleted_while_it_is_used_is_made_again_at_once(archive, harm):
    index = CaptureIndex(archive)
    index.rebuild()
    harm(index.path)
    assert [entry.id for entry in index.list()] == ["c3", "c2", "c1"]
    harm(index.path)
    path = write(archive, slots(2), name="c4", id="c4", created_utc="2026-03-04T09:00:00.000Z")
    index.add(path)
    harm(index.path)
    (archive / "c1.grab").unlink()
    index.remove("c1")
    assert [entry.id for entry in index.list()] == ["c4", "c3", "c2"]


def test_a_journal_of_the_old_index_is_not_played_back_into_the_new(archive):
    index = CaptureIndex(archive)
    index.rebuild()
    with sqlite3.connect(index.path, isolation_level=None) as connection:
        connection.execute("PRAGMA cache_size = 1")
        connection.execute("BEGIN")
        connection.execute("UPDATE captures SET note = ?", ("x" * 100_000,))
        journal = (archive / "index.sqlite-journal").read_bytes()
    garbage(index.path)
    (archive / "index.sqlite-journal").write_bytes(journal)
    index.rebuild()
    assert not (archive / "index.sqlite-journal").exists()
    assert [entry.note for entry in index.list()] == ["first milking"] * 3
