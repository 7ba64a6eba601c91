"""The index over many captures can always be made again from the files."""

import os
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from archive.captures import slot, slots, write
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.guarded_database import open_tables
from grabberd.archive.state import capture_index
from grabberd.archive.state.capture_index import CaptureIndex
from grabberd.archive.state.index_entries import read_entries
from grabberd.core.ledger import Outcome
from grabberd.errors import NotFound, StorageError


def test_it_is_made_from_the_files(archive):
    index = CaptureIndex(archive)
    index.rebuild()
    assert [entry.id for entry in index.list()] == ["c3", "c2", "c1"]
    assert index.get("c2").device == "teatcup"
    assert index.get("c2").file == "c2.grab"


def test_making_it_again_forgets_what_is_gone(archive):
    index = CaptureIndex(archive)
    index.rebuild()
    (archive / "c2.grab").unlink()
    index.rebuild()
    assert [entry.id for entry in index.list()] == ["c3", "c1"]


class Reader:
    """Reads entries of files, and keeps which."""

    def __init__(self):
        self.read = []

    def __call__(self, paths):
        self.read += [path.name for path in paths]
        return read_entries(paths)


def test_only_what_has_changed_since_is_read_again(archive):
    CaptureIndex(archive).rebuild()
    write(archive, slots(2), name="c4", id="c4", created_utc="2026-03-04T09:00:00.000Z")
    (archive / "c1.grab").unlink()
    write(archive, slots(3), name="c1", id="c1", created_utc="2026-03-01T10:00:00.000Z")
    os.utime(archive / "c2.grab", ns=(0, 1))
    reader = Reader()
    index = CaptureIndex(archive, read_entries=reader)
    index.rebuild()
    assert reader.read == ["c1.grab", "c2.grab", "c4.grab"]
    assert [(entry.id, entry.created_utc) for entry in index.list()] == [
        ("c4", "2026-03-04T09:00:00.000Z"),
        ("c3", "2026-03-03T09:00:00.000Z"),
        ("c2", "2026-03-02T09:00:00.000Z"),
        ("c1", "2026-03-01T10:00:00.000Z"),
    ]
    assert index.read == (3, 4)


def test_an_index_that_cannot_be_read_is_no_help_for_a_new_one(archive):
    CaptureIndex(archive).rebuild()
    (archive / "index.sqlite").write_bytes(b"garbage")
    reader = Reader()
    CaptureIndex(archive, read_entries=reader).rebuild()
    assert reader.read == ["c1.grab", "c2.grab", "c3.grab"]


@pytest.mark.parametrize(
    ("column", "value"),
    [("created_utc", "2026-03-02T09:00:00"), ("note", b"\x00"), ("reason", b"\x00"), ("labels", 7)],
)
def test_an_entry_that_no_list_could_show_is_made_anew(archive, column, value):
    CaptureIndex(archive).rebuild()
    with closing(sqlite3.connect(archive / "index.sqlite")) as connection, connection:
        connection.execute(f"UPDATE captures SET {column} = ? WHERE id = 'c2'", (value,))
    index = CaptureIndex(archive)
    index.rebuild()
    assert [(entry.id, entry.created_utc, entry.note) for entry in index.list()][1] == (
        "c2",
        "2026-03-02T09:00:00.000Z",
        "first milking",
    )


def test_an_index_that_has_to_be_healed_is_not_believed(archive):
    CaptureIndex(archive).rebuild()
    reader = Reader()
    CaptureIndex(archive, read_entries=reader).rebuild(anew=True)
    assert reader.read == ["c1.grab", "c2.grab", "c3.grab"]


def test_content_that_was_changed_under_an_old_time_is_read_again(archive):
    CaptureIndex(archive).rebuild()
    found = (archive / "c2.grab").stat()
    with (archive / "c2.grab").open("r+b") as file:
        file.write(b"garbage")
    os.utime(archive / "c2.grab", ns=(found.st_atime_ns, found.st_mtime_ns))
    index = CaptureIndex(archive)
    index.rebuild()
    assert index.get("c2").state == "damaged"


def test_a_capture_under_another_name_is_read_each_time(archive):
    (archive / "c2.grab").rename(archive / "renamed.grab")
    CaptureIndex(archive).rebuild()
    reader = Reader()
    CaptureIndex(archive, read_entries=reader).rebuild()
    assert reader.read == ["renamed.grab"]


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
    assert (archive / index.get("c1").file).read_bytes() == b"garbage"
    assert index.get("c1").file == "damaged/c1.grab"
    assert "cannot be read" in (archive / "damaged" / "c1.grab.txt").read_text()


def test_a_damaged_capture_says_why_wherever_it_lies(archive):
    (archive / "c1.grab").write_bytes(b"garbage")
    (archive / "c2.grab").unlink()
    (archive / "c2.grab").symlink_to(archive / "c3.grab")
    index = CaptureIndex(archive)
    for _ in range(2):
        index.rebuild()
        reasons = {entry.id: entry.reason for entry in index.list()}
        assert "not a database" in reasons["c1"]
        assert "a link" in reasons["c2"]
        assert not reasons["c3"]


def test_a_name_that_cannot_be_shown_is_changed_and_nothing_is_lost(archive):
    bad = os.fsencode(archive) + b"/st\xff\nick.grab"
    os.rename(archive / "c1.grab", bad)
    (archive / "damaged").mkdir()
    Path(os.fsdecode(os.fsencode(archive) + b"/damaged/\xfe.grab")).write_bytes(b"garbage")
    index = CaptureIndex(archive)
    index.rebuild()
    assert index.get("c1").file == "st%FF%0Aick.grab"
    assert index.get("%FE").file == "damaged/%FE.grab"


def forge(index, statement):
    with closing(sqlite3.connect(index.path, isolation_level=None)) as connection:
        connection.execute(statement)


@pytest.mark.parametrize("name", ["evil.part", "evil.grab.txt", "evil", "evil.grab-journal", "folder.part"])
def test_a_file_among_the_damaged_that_is_no_capture_is_not_listed(archive, name):
    (archive / "damaged").mkdir()
    (archive / "damaged" / name).write_bytes(b"garbage")
    index = CaptureIndex(archive)
    index.rebuild()
    assert [entry.id for entry in index.list()] == ["c3", "c2", "c1"]


def test_a_file_without_a_name_but_its_ending_is_listed_by_it(archive):
    (archive / ".grab").write_bytes(b"garbage")
    index = CaptureIndex(archive)
    index.rebuild()
    assert index.get(".grab").state == "damaged"


def test_a_capture_that_no_list_could_show_is_damaged_and_the_index_serves_all_others(archive):
    with closing(sqlite3.connect(archive / "c1.grab", isolation_level=None)) as connection:
        connection.execute("""UPDATE meta SET value = '{"name": "a\\u0007"}' WHERE key = 'device'""")
    index = CaptureIndex(archive)
    index.rebuild()
    assert [entry.id for entry in index.list()] == ["c3", "c2", "c1"]
    assert "cannot be shown" in index.get("c1").reason


@pytest.mark.parametrize(
    "statement",
    [
        "CREATE VIEW more AS SELECT * FROM captures",
        "CREATE TRIGGER late AFTER INSERT ON captures BEGIN DELETE FROM captures; END",
        "ALTER TABLE captures ADD COLUMN more",
    ],
)
def test_an_index_of_another_schema_is_made_again(archive, statement):
    index = CaptureIndex(archive)
    index.rebuild()
    forge(index, statement)
    assert len(index.list()) == 3
    with closing(open_tables(index.path, capture_index._TABLE)) as connection:
        assert len(connection.execute("SELECT * FROM sqlite_schema").fetchall()) == 2


@pytest.mark.parametrize(
    "change",
    [
        "file = '../state.sqlite'",
        "file = '/etc/passwd.grab'",
        "file = 'damaged/../../c1.grab'",
        "file = '..'",
        "state = 'running'",
        "created_utc = '9999'",
        "created_utc = 5",
        "id = 'a' || char(10)",
        "labels = '[1]'",
        "labels = '{\"cow\": {}}'",
        "labels = x'00'",
        "verdict = 7",
        "length = 'long'",
        "widths = '{}'",
        "widths = '[\"wide\"]'",
    ],
)
def test_a_forged_entry_leads_to_no_other_file(archive, change):
    index = CaptureIndex(archive)
    index.rebuild()
    forge(index, f"UPDATE captures SET {change} WHERE id = 'c1'")
    assert {entry.id: entry.file for entry in index.list()} == {
        "c1": "c1.grab",
        "c2": "c2.grab",
        "c3": "c3.grab",
    }


def test_a_file_of_a_later_version_is_listed_where_it_is(archive):
    connection = sqlite3.connect(archive / "c1.grab")
    connection.execute("PRAGMA user_version = 99")
    connection.close()
    index = CaptureIndex(archive)
    index.rebuild()
    assert index.get("c1").state == "damaged"
    assert index.get("c1").file == "c1.grab"


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


def test_a_folder_that_is_gone_is_not_made_again_by_its_index(archive):
    index = CaptureIndex(archive)
    index.rebuild()
    archive.rename(archive.with_name("away"))
    with pytest.raises(StorageError):
        index.list()
    assert not archive.exists()


def test_a_capture_that_ends_while_the_index_is_rebuilt_is_entered_afterwards(archive):
    late = "c4"

    def read_slowly(paths):
        for reading in read_entries(paths):
            if reading.path.name == "c3.grab":  # the last: the folder has been looked through
                index.add(
                    write(archive, slots(2), name=late, id=late, created_utc="2026-03-04T09:00:00.000Z")
                )
                (archive / "c1.grab").unlink()
            yield reading

    index = CaptureIndex(archive, read_entries=read_slowly)
    index.rebuild()
    assert [entry.id for entry in index.list()] == ["c4", "c3", "c2"], "and what is gone is not in it"


def test_a_full_disk_leaves_the_index_as_it_is(archive, monkeypatch):
    index = CaptureIndex(archive)
    index.rebuild()
    with monkeypatch.context() as patch:
        patch.setattr(capture_index, "_TABLE", "PRAGMA max_page_count = 1;" + capture_index._TABLE)
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
        patch.setattr(index, "_change", full)
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
        patch.setattr(index, "_change", lambda _: (_ for _ in ()).throw(StorageError("full", "mend")))
        with pytest.raises(StorageError):
            index.add(path)
    path.unlink()
    assert index.list() == []


def test_an_entry_says_how_long_and_how_whole_a_capture_is(tmp_path):
    taken = [slot(0), slot(5, lost=2), slot(6, Outcome.DAMAGED, "torn")]
    write(tmp_path, taken, measured=[0, 5], name="c1", id="c1")
    write(tmp_path, slots(3), name="c2", id="c2")
    index = CaptureIndex(tmp_path)
    index.rebuild()
    lossy, whole = index.get("c1"), index.get("c2")
    with CaptureReader(tmp_path / "c1.grab") as reader:
        counts = reader.ledger.counts()
    assert (lossy.verdict, lossy.length, lossy.runs, lossy.calibration) == ("incomplete", 7, 1, "rig-7")
    assert lossy.losses == sum(counts.values()) - counts[Outcome.RECEIVED]
    assert (whole.verdict, whole.length, whole.losses, whole.runs, whole.calibration) == (
        "complete",
        3,
        0,
        0,
        "",
    )


def test_widths_are_kept_over_a_rebuild_but_not_for_a_file_that_has_changed_since(archive):
    index = CaptureIndex(archive)
    index.rebuild()
    known = index.get("c2")
    index.keep_widths(known, "[1.5, null]")
    index.keep_widths(index.get("c1")._replace(changed_ns=1), "[2.5]")
    CaptureIndex(archive).rebuild()
    assert [index.get(one).widths for one in ("c1", "c2")] == ["", "[1.5, null]"]
    (archive / "c2.grab").unlink()
    write(archive, slots(3), name="c2", id="c2")
    index.add(archive / "c2.grab")
    assert index.get("c2").widths == ""


def test_whoever_asks_is_told_which_entries_have_changed(archive):
    told = []
    index = CaptureIndex(archive, changed=told.append)
    index.rebuild()
    index.add(write(archive, slots(2), name="c4", id="c4", created_utc="2026-03-04T09:00:00.000Z"))
    index.remove("c1")
    assert told == [None, "c4", "c1"]
    assert sorted(entry.id for entry in index.some(["c4", "c1", "c2"])) == ["c2", "c4"]
