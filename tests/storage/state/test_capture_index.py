"""The index over many captures can always be made again from the files."""

import shutil
import sqlite3
from pathlib import Path

import pytest

from grabberd.errors import NotFound, StorageError
from grabberd.storage import CaptureIndex
from grabberd.storage.state import capture_index
from storage.captures import slots, write


@pytest.fixture
def archive(tmp_path):
    for day in (3, 1, 2):
        write(tmp_path, slots(2), name=f"c{day}", id=f"c{day}", created_utc=f"2026-03-0{day}T09:00:00.000Z")
    return tmp_path


def test_it_is_made_from_the_files(archive):
    index = CaptureIndex(archive)
    index.rebuild()
    assert [entry.id for entry in index.list()] == ["c3", "c2", "c1"]
    assert index.get("c2").device == "teatcup"
    assert index.file_of("c2") == archive / "c2.grab"


def test_making_it_again_forgets_what_is_gone(archive):
    index = CaptureIndex(archive)
    index.rebuild()
    (archive / "c2.grab").unlink()
    index.rebuild()
    assert [entry.id for entry in index.list()] == ["c3", "c1"]


def test_a_sealed_capture_is_added_once(archive):
    index = CaptureIndex(archive)
    index.rebuild()
    path = write(archive, slots(2), name="c4", id="c4", created_utc="2026-03-04T09:00:00.000Z")
    for _ in range(2):
        index.add(path)
    assert [entry.id for entry in index.list()] == ["c4", "c3", "c2", "c1"]


def test_damaged_files_are_listed_as_damaged_and_never_fatal(archive):
    (archive / "c1.grab").write_bytes(b"garbage")
    (archive / "damaged").mkdir()
    (archive / "damaged" / "old.grab.part").write_bytes(b"garbage")
    (archive / "damaged" / "old.grab.part.txt").write_text("why")
    index = CaptureIndex(archive)
    for _ in range(2):
        index.rebuild()
        states = {entry.id: entry.state for entry in index.list()}
        assert states == {"c3": "sealed", "c2": "sealed", "c1": "damaged", "old": "damaged"}
    assert index.file_of("c1").read_bytes() == b"garbage"
    assert index.file_of("c1") == archive / "damaged" / "c1.grab"
    assert "cannot be read" in (archive / "damaged" / "c1.grab.txt").read_text()


def test_a_file_of_a_later_version_is_listed_where_it_is(archive):
    connection = sqlite3.connect(archive / "c1.grab")
    connection.execute("PRAGMA user_version = 99")
    connection.close()
    index = CaptureIndex(archive)
    index.rebuild()
    assert index.get("c1").state == "damaged"
    assert index.file_of("c1") == archive / "c1.grab"


def test_a_copy_hides_no_capture(archive):
    shutil.copy(archive / "c1.grab", archive / "copy.grab")
    (archive / "c2.grab").write_bytes(b"garbage")
    shutil.copy(archive / "c3.grab", archive / "c2.grab.part")
    index = CaptureIndex(archive)
    index.rebuild([archive / "c2.grab.part"])
    files = {entry.id: entry.file for entry in index.list()}
    assert files == {
        "c1": "c1.grab",
        "c1-2": "copy.grab",
        "c3": "c3.grab",
        "c3-2": "c2.grab.part",
        "c2": "damaged/c2.grab",
    }


def test_a_capture_that_is_removed_is_forgotten(archive):
    index = CaptureIndex(archive)
    index.rebuild()
    for _ in range(2):
        index.remove("c2")
        assert [entry.id for entry in index.list()] == ["c3", "c1"]


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


def test_a_folder_that_is_gone_is_not_made_again_by_its_index(archive):
    index = CaptureIndex(archive)
    index.rebuild()
    archive.rename(archive.with_name("away"))
    with pytest.raises(StorageError):
        index.list()
    assert not archive.exists()


def test_a_capture_that_ends_while_the_index_is_rebuilt_is_entered_afterwards(archive, monkeypatch):
    index = CaptureIndex(archive)
    late = "c4"

    def read_slowly(path, read=capture_index._readable):
        if path.name == "c3.grab":  # the last: the folder has been looked through
            index.add(write(archive, slots(2), name=late, id=late, created_utc="2026-03-04T09:00:00.000Z"))
            (archive / "c1.grab").unlink()
        return read(path)

    monkeypatch.setattr(capture_index, "_readable", read_slowly)
    index.rebuild()
    assert [entry.id for entry in index.list()] == ["c4", "c3", "c2"], "and what is gone is not in it"


def test_a_full_disk_leaves_the_index_as_it_is(archive, monkeypatch):
    index = CaptureIndex(archive)
    index.rebuild()
    monkeypatch.setattr(capture_index, "_TABLE", "PRAGMA max_page_count = 1;" + capture_index._TABLE)
    with pytest.raises(StorageError, match="full"):
        index.rebuild()
    assert len(index.list()) == 3


def test_captures_that_are_being_written_are_not_in_it(archive):
    (archive / "c1.grab").rename(archive / "c1.grab.part")
    index = CaptureIndex(archive)
    index.rebuild()
    assert [entry.id for entry in index.list()] == ["c3", "c2"]


def test_an_unknown_capture_is_not_found(tmp_path):
    with pytest.raises(NotFound, match="no capture 'c9'"):
        CaptureIndex(tmp_path).get("c9")


def test_what_a_full_disk_kept_out_is_entered_as_soon_as_there_is_room(tmp_path, monkeypatch):
    index = CaptureIndex(tmp_path)
    index.rebuild()
    path = write(tmp_path, slots(2))

    def full(_):
        raise StorageError("index.sqlite cannot be used: database or disk is full", "mend the disk")

    with monkeypatch.context() as patch:
        patch.setattr(index, "_write", full)
        with pytest.raises(StorageError, match="full"):
            index.add(path)
        assert index.list() == []
    assert [entry.file for entry in index.list()] == [path.name]
    assert [entry.file for entry in index.page(None, 10)] == [path.name]


def test_what_was_kept_out_and_is_gone_meanwhile_is_not_entered(tmp_path, monkeypatch):
    index = CaptureIndex(tmp_path)
    index.rebuild()
    path = write(tmp_path, slots(2))
    with monkeypatch.context() as patch:
        patch.setattr(index, "_write", lambda _: (_ for _ in ()).throw(StorageError("full", "mend")))
        with pytest.raises(StorageError):
            index.add(path)
    path.unlink()
    assert index.list() == []
