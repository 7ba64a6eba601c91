"""Other programs read a capture by SQLite alone: what they may do, and when, as the format's page says."""

import shutil
import sqlite3
from contextlib import closing

import pytest

from archive.captures import meta, slots
from grabberd.archive.capture.writer import CaptureWriter

BEFORE, AFTER = 30, 90


@pytest.fixture
def writer(tmp_path):
    """Writes a capture; thirty fields are committed, and sixty more are in the file, but not committed."""
    one = CaptureWriter.create(tmp_path / "liner.grab.part", meta(bits=8))
    one.append(slots(BEFORE, bits=8))
    one.commit()
    one._connection.execute("PRAGMA cache_size = 1")  # writes into the file before the commit
    one.append(slots(AFTER, bits=8)[BEFORE:])
    yield one
    one.close()


@pytest.fixture
def crashed(writer, tmp_path):
    """What a crash leaves at this instant: the file and its hot journal."""
    folder = tmp_path / "crashed"
    folder.mkdir()
    for name in ("liner.grab.part", "liner.grab.part-journal"):
        shutil.copy(tmp_path / name, folder)
    return folder / "liner.grab.part"


def count(uri, table="fields"):
    with closing(sqlite3.connect(uri, uri=True)) as connection:
        return connection.execute(f"SELECT count(*) FROM {table}").fetchone()[0]


def test_while_it_is_recorded_a_read_only_reader_sees_the_last_commit(tmp_path):
    writer = CaptureWriter.create(tmp_path / "liner.grab.part", meta())
    for taken in (slots(10), slots(20)[10:]):
        writer.append(taken)
        writer.commit()
        assert count(f"file:{writer.path}?mode=ro") == taken[-1].n + 1
        writer.append([])
    writer.close()


def test_after_a_crash_within_a_commit_a_read_only_reader_gets_an_error_and_no_numbers(crashed):
    before = crashed.read_bytes()
    with pytest.raises(sqlite3.OperationalError, match=r"readonly database|unable to open"):
        count(f"file:{crashed}?mode=ro")
    assert crashed.read_bytes() == before


def test_an_immutable_one_silently_mixes_what_was_committed_with_what_was_not(tmp_path):
    writer = CaptureWriter.create(tmp_path / "liner.grab.part", meta())
    writer.append(slots(500))
    writer.commit()
    writer._connection.execute("PRAGMA cache_size = 1")
    writer._connection.execute("BEGIN")
    writer._connection.execute("UPDATE fields SET outcome = 'changed'")
    left = tmp_path / "left.grab.part"
    for suffix in ("", "-journal"):
        shutil.copy(f"{writer.path}{suffix}", f"{left}{suffix}")
    writer.close()
    with closing(sqlite3.connect(f"file:{left}?immutable=1", uri=True)) as connection:
        found = dict(connection.execute("SELECT outcome, count(*) FROM fields GROUP BY outcome").fetchall())
    assert found.keys() == {"received", "changed"}
    with closing(sqlite3.connect(left)) as connection:
        assert connection.execute("SELECT DISTINCT outcome FROM fields").fetchall() == [("received",)]


def test_one_that_may_write_gets_what_was_committed_as_the_page_says(crashed):
    with closing(sqlite3.connect(crashed)) as connection:
        connection.execute("PRAGMA query_only = ON")
        assert connection.execute("SELECT count(*) FROM fields").fetchone() == (BEFORE,)
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    assert count(f"file:{crashed}?mode=ro") == BEFORE


def test_it_does_not_roll_back_what_a_living_writer_is_about_to_commit(writer):
    other = sqlite3.connect(writer.path, timeout=0.0)
    with closing(other), pytest.raises(sqlite3.OperationalError, match="locked"):  # it has pages in the file
        other.execute("SELECT count(*) FROM fields").fetchone()
    writer.commit()
    assert count(writer.path.as_uri()) == AFTER


def test_a_copy_of_the_file_and_its_journal_is_read_like_the_original(crashed, tmp_path):
    folder = tmp_path / "own"
    folder.mkdir()
    for name in ("liner.grab.part", "liner.grab.part-journal"):
        shutil.copy(crashed.with_name(name), folder)
    with closing(sqlite3.connect(folder / "liner.grab.part")) as connection:
        assert connection.execute("SELECT count(*) FROM fields").fetchone() == (BEFORE,)
