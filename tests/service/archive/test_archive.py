"""The folder of captures: what a crash or a bad disk left keeps nobody from starting, and nothing is lost."""

import sqlite3
from contextlib import closing
from dataclasses import asdict
from pathlib import Path

import pytest

from grabberd.errors import NotFound
from grabberd.service.archive.archive import Archive
from grabberd.storage import CaptureReader, CaptureWriter
from storage.captures import meta, slots, write


def archive_in(folder: Path) -> Archive:
    archive = Archive(folder, list)
    archive.open()
    return archive


def states(archive: Archive) -> dict[str, str]:
    return {document.id: document.state for document in archive.documents()}


def interrupted(folder: Path, name: str) -> Path:
    writer = CaptureWriter.create(folder / f"{name}.grab.part", meta(id=name))
    writer.append(slots(5))
    writer.commit()
    writer.close()
    return folder / f"{name}.grab.part"


def test_a_damaged_file_is_set_aside_and_shown_beside_the_others(tmp_path: Path) -> None:
    write(tmp_path, slots(3), name="good", id="good")
    (tmp_path / "bad.grab").write_bytes(b"garbage " * 100)
    (tmp_path / "cut.grab.part").write_bytes(b"")
    archive = archive_in(tmp_path)
    assert states(archive) == {"good": "sealed", "bad": "damaged", "cut": "damaged"}
    assert (tmp_path / "damaged" / "bad.grab").read_bytes() == b"garbage " * 100
    document = archive.document("bad")
    assert document.verdict == "incomplete"
    assert "cannot be read as a capture" in document.ended_because


@pytest.mark.parametrize("value", ["{}", "[1]", "7", "garbage", "null", '""'])
@pytest.mark.parametrize("key", sorted(asdict(meta())))
def test_a_file_that_says_nonsense_of_itself_is_listed_and_hides_no_other(
    tmp_path: Path, key: str, value: str
) -> None:
    write(tmp_path, slots(3), name="good", id="good")
    path = write(tmp_path, slots(3), name="odd", id="odd", created_utc="2026-03-01T09:31:00.000Z")
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("UPDATE meta SET value = ? WHERE key = ?", (value, key))
    shown = states(archive_in(tmp_path))
    assert shown.pop("good") == "sealed"
    assert len(shown) == 1


def test_one_file_that_cannot_be_sealed_keeps_no_other_from_it(tmp_path: Path) -> None:
    write(tmp_path, slots(3), name="taken", id="taken")
    interrupted(tmp_path, "a")
    interrupted(tmp_path, "b").rename(tmp_path / "taken.grab.part")
    interrupted(tmp_path, "c")
    archive = archive_in(tmp_path)
    assert states(archive) == {"a": "sealed", "taken": "sealed", "c": "sealed", "b": "sealed"}
    assert archive.path("b") == tmp_path / "taken.grab.part"
    with CaptureReader(archive.path("b")) as reader:
        assert reader.field_count == 5


def test_a_later_versions_files_are_neither_sealed_nor_moved(tmp_path: Path) -> None:
    for path in (interrupted(tmp_path, "running"), write(tmp_path, slots(2), name="new", id="new")):
        connection = sqlite3.connect(path)
        connection.execute("PRAGMA user_version = 99")
        connection.close()
    archive = archive_in(tmp_path)
    assert states(archive) == {"running": "damaged", "new": "damaged"}
    assert "version 99" in archive.document("running").ended_because
    assert {path.name for path in tmp_path.glob("*.grab*")} == {"running.grab.part", "new.grab"}


def test_a_file_that_may_not_be_read_is_shown_as_damaged_and_stays(tmp_path: Path) -> None:
    (tmp_path / "folder.grab").mkdir()
    assert states(archive_in(tmp_path)) == {"folder": "damaged"}


def test_a_removed_capture_is_gone_with_its_reason(tmp_path: Path) -> None:
    write(tmp_path, slots(3), name="good", id="good")
    (tmp_path / "bad.grab").write_bytes(b"garbage " * 100)
    archive = archive_in(tmp_path)
    archive.remove("bad")
    assert states(archive) == {"good": "sealed"}
    assert list((tmp_path / "damaged").iterdir()) == []
    with pytest.raises(NotFound):
        archive.remove("bad")
