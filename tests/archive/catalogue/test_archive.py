"""The folder of captures: what a crash or a bad disk left keeps nobody from starting, and nothing is lost."""

import os
import sqlite3
import time
from contextlib import closing, suppress
from dataclasses import asdict
from pathlib import Path

import pytest

from archive.captures import meta, slots, write
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.catalogue.archive import Archive
from grabberd.errors import NotFound, ReadingGivenUp
from grabberd.files.reading import Patience, within

ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT"
SOON_S = 10.0
"""Processor time within which a folder is opened and listed."""


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


NONSENSE = ("{}", "[1]", "7", "garbage", "null", '""', "1e999", "[" * 5000, "9" * 5000, b"\xff", None)


@pytest.mark.parametrize("key", sorted(asdict(meta())))
def test_files_that_say_nonsense_of_themselves_are_listed_and_hide_no_other(tmp_path: Path, key: str) -> None:
    write(tmp_path, slots(3), name="good", id="good")
    for number, value in enumerate(NONSENSE):
        path = write(tmp_path, slots(3), name=f"odd{number}", id=f"odd{number}")
        with closing(sqlite3.connect(path, isolation_level=None)) as connection, suppress(sqlite3.Error):
            connection.execute("UPDATE meta SET value = ? WHERE key = ?", (value, key))
    shown = states(archive_in(tmp_path))
    assert shown.pop("good") == "sealed"
    assert len(shown) == len(NONSENSE)


def hostile(folder: Path) -> None:
    """What a stranger with write access to the folder may leave there."""
    for number, statements in enumerate(
        (
            f"DROP TABLE meta; CREATE VIEW meta AS {ENDLESS} i AS key, i AS value FROM n",
            f"DROP TABLE fields; CREATE VIEW fields AS {ENDLESS} i AS n FROM n",
            "UPDATE meta SET value = '0' WHERE key = 'rate_hz'",
            "UPDATE meta SET value = '\"9999\"' WHERE key = 'created_utc'",
            "UPDATE meta SET value = '{\"cow\": {\"a\": 1}}' WHERE key = 'labels'",
            "UPDATE fields SET n = 4000000000000 WHERE n = 2",
            "INSERT INTO ledger VALUES (3, 4000000000000, 'lost', 'time gap')",
        )
    ):
        path = write(folder, slots(3), name=f"bad{number}", id=f"bad{number}")
        with closing(sqlite3.connect(path)) as connection:
            connection.executescript(statements)
        if number % 2:
            path.rename(path.with_name(path.name + ".part"))
    (folder / "link.grab").symlink_to("/etc/hostname")
    (folder / "loop.grab").symlink_to("loop.grab")
    (folder / "folder.grab").mkdir()
    os.mkfifo(folder / "pipe.grab")
    os.mkfifo(folder / "pipe2.grab.part")
    Path(os.fsdecode(os.fsencode(folder) + b"/\xff\xfe.grab")).write_bytes(b"stick")
    Path(os.fsdecode(os.fsencode(folder) + b"/\xfd.grab.part")).write_bytes(b"stick")
    (folder / "index.sqlite").write_bytes((folder / "bad6.grab").read_bytes())


def test_a_folder_full_of_hostile_files_starts_lists_and_serves_the_good_one(tmp_path: Path) -> None:
    hostile(tmp_path)
    write(tmp_path, slots(3), name="good", id="good")
    begin_s = time.process_time()
    for _ in range(2):
        archive = archive_in(tmp_path)
        shown = {document.id: document for document in archive.documents()}
        assert shown["good"].state == "sealed"
        others = [document for document in shown.values() if document.id != "good"]
        assert all(document.state == "damaged" and document.ended_because for document in others)
        assert len(others) == 14
        assert archive.path("good").read_bytes()
        archive.close()
    assert time.process_time() - begin_s < SOON_S


def test_a_file_that_takes_too_long_is_listed_as_such_and_not_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path, slots(3), name="slow", id="slow")
    archive = archive_in(tmp_path)
    monkeypatch.setattr("grabberd.archive.catalogue.capture_documents.LONGEST_S", 0.0)
    assert states(archive) == {"slow": "damaged"}
    assert "takes longer than" in archive.document("slow").ended_because
    monkeypatch.setattr("grabberd.archive.catalogue.capture_documents.LONGEST_S", 3600.0)
    assert states(archive) == {"slow": "damaged"}
    write(tmp_path, slots(3), name="other", id="other")
    archive.index.add(tmp_path / "other.grab")
    assert states(archive) == {"slow": "damaged", "other": "sealed"}
    archive.close()


def test_who_waits_no_longer_learns_nothing_of_the_file(tmp_path: Path) -> None:
    write(tmp_path, slots(3), name="good", id="good")
    archive = archive_in(tmp_path)
    with within(Patience(0.0)), pytest.raises(ReadingGivenUp):
        archive.document("good")
    assert states(archive) == {"good": "sealed"}
    archive.close()


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
