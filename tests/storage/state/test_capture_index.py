"""The index over many captures can always be made again from the files."""

import shutil
import sqlite3

import pytest

from grabberd.errors import NotFound, StorageError
from grabberd.storage import CaptureIndex
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
    for _ in range(2):
        index.add(archive / "c1.grab")
    assert [entry.id for entry in index.list()] == ["c1"]


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


def test_captures_that_are_being_written_are_not_in_it(archive):
    (archive / "c1.grab").rename(archive / "c1.grab.part")
    index = CaptureIndex(archive)
    index.rebuild()
    assert [entry.id for entry in index.list()] == ["c3", "c2"]


def test_an_unknown_capture_is_not_found(tmp_path):
    with pytest.raises(NotFound, match="no capture 'c9'"):
        CaptureIndex(tmp_path / "new").get("c9")


def test_what_a_full_disk_kept_out_is_entered_as_soon_as_there_is_room(tmp_path, monkeypatch):
    index = CaptureIndex(tmp_path)
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
    path = write(tmp_path, slots(2))
    with monkeypatch.context() as patch:
        patch.setattr(index, "_write", lambda _: (_ for _ in ()).throw(StorageError("full", "mend")))
        with pytest.raises(StorageError):
            index.add(path)
    path.unlink()
    assert index.list() == []
