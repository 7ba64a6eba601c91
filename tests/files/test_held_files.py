"""While a connection of this process has a file open, no reading of it costs the process its locks."""

import gc
import os
import sqlite3
from contextlib import closing, suppress
from pathlib import Path
from threading import Thread

import pytest

from archive.another_process import CHANGE, COMMIT, COUNT, LOCKED, another_process
from archive.captures import MADE_WITH, META, ledger_of, meta, points, slots, write
from grabberd.archive import guarded_database
from grabberd.archive.capture.reader import CaptureReader, stat_at_rest
from grabberd.archive.capture.runs import append_run
from grabberd.archive.capture.schema import TABLES
from grabberd.archive.capture.verification import verify
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.guarded_database import open_tables, read_header
from grabberd.errors import StorageError
from grabberd.files.disk import HeldConnection, connect, create, hold
from grabberd_replay.video import container_of


def read_as_a_capture(path):
    with suppress(StorageError), CaptureReader(path) as reader:
        assert reader.field_count == 30


def look_at_its_tables(path):
    with suppress(sqlite3.OperationalError), closing(open_tables(path, TABLES)):
        pass


def look_at_it_at_rest(path):
    with suppress(StorageError):
        stat_at_rest(path)


READINGS = (read_header, look_at_its_tables, read_as_a_capture, look_at_it_at_rest, container_of)


@pytest.fixture(autouse=True)
def _nobody_waits(monkeypatch):
    monkeypatch.setattr(guarded_database, "_WAIT_S", 0)


@pytest.fixture
def writer(tmp_path):
    """A capture of thirty fields, and sixty more in the middle of their transaction."""
    writer = CaptureWriter.create(tmp_path / "liner.grab.part", meta(bits=8))
    writer.append(slots(30, bits=8))
    writer.commit()
    yield writer
    writer.close()


def begin_more(writer, *, spilled):
    if spilled:
        writer._connection.execute("PRAGMA cache_size = 1")  # writes into the file before the commit
    writer.append(slots(90, bits=8)[30:])
    journal = writer.path.with_name(writer.path.name + guarded_database.JOURNAL)
    # That of a transaction which is in memory is not taken for a crash's yet.
    assert (journal.read_bytes()[:8] == guarded_database._JOURNAL_MAGIC) == spilled


@pytest.mark.parametrize("spilled", [True, False])
@pytest.mark.parametrize("reading", READINGS)
def test_a_writer_keeps_its_locks_whatever_this_process_reads_of_its_file(writer, reading, spilled):
    begin_more(writer, spilled=spilled)
    for _ in range(2):
        reading(writer.path)
        # Without the lock it would take the journal for that of a crash, and roll the transaction back.
        assert another_process(writer.path, COUNT) == (LOCKED if spilled else "[(30,)]")
        assert another_process(writer.path, CHANGE) == LOCKED
    writer.commit()
    ledger = ledger_of(slots(90))
    sealed = writer.seal(ledger, complete=True, ended_because="length reached")
    assert verify(sealed).fields == 90
    assert verify(sealed).damages == []


def test_the_lock_of_a_reader_outlives_other_readers_of_its_process(tmp_path):
    path = write(tmp_path, slots(60))
    with CaptureReader(path) as reader:
        reader._connection.execute("BEGIN")
        reader._connection.execute(COUNT).fetchone()
        with CaptureReader(path) as another:
            assert another.field_count == 60
        container_of(path)
        assert another_process(path, COMMIT) == LOCKED
    assert another_process(path, COMMIT) == "[]"


def test_the_lock_of_one_who_adds_a_run_outlives_another_who_is_refused(tmp_path):
    path = write(tmp_path, slots(10))
    adding = (path, "measured", META.created_utc, "0.1.0", MADE_WITH)
    refused = []

    def points_of_a_run():
        yield 0, points(0)

    def coverage():
        # In the middle of the last transaction of the run.
        with pytest.raises(StorageError, match="another program is adding a run"):
            append_run(*adding, points_of_a_run())
        refused.append(another_process(path, CHANGE))
        return {}

    assert append_run(*adding, points_of_a_run(), coverage) == 1
    assert refused == [LOCKED]
    assert append_run(*adding, points_of_a_run()) == 2
    assert verify(path).damages == []


def test_a_cursor_that_is_read_no_further_leaves_no_transaction_behind(tmp_path):
    path = tmp_path / "liner.sqlite"
    with create(path):
        connection = connect(path, HeldConnection)
    connection.executescript("CREATE TABLE fields (n); INSERT INTO fields VALUES (0), (1); BEGIN IMMEDIATE")
    connection.execute("INSERT INTO fields VALUES (2)")
    cursor = connection.execute("SELECT n FROM fields")
    assert cursor.fetchone() == (0,)
    connection.close()
    assert another_process(path, COMMIT) == "[]"
    assert another_process(path, COUNT) == "[(2,)]"
    del cursor


def descriptors_of(path):
    found = path.stat()
    return [link for link in Path("/proc/self/fd").iterdir() if is_of(link, found)]


def is_of(link, found):
    with suppress(OSError):
        return os.path.samestat(os.stat(link), found)
    return False


def test_there_is_one_descriptor_for_all_and_it_is_closed_with_the_last(tmp_path):
    path = write(tmp_path, slots(5))
    with hold(path) as first:
        with hold(path) as second:
            assert second.descriptor == first.descriptor
        for _ in range(3):
            read_header(path)
        assert len(descriptors_of(path)) == 1
        assert os.pread(first.descriptor, 6, 0) == b"SQLite"
    assert descriptors_of(path) == []


def test_a_connection_that_is_forgotten_is_closed_and_releases_its_file(tmp_path):
    path = write(tmp_path, slots(5))
    connection = open_tables(path, TABLES)
    connection.execute("BEGIN IMMEDIATE")
    assert another_process(path, CHANGE) == LOCKED
    del connection
    gc.collect()
    assert another_process(path, CHANGE) == "[]"
    assert descriptors_of(path) == []


def test_a_file_is_opened_again_where_another_took_its_place_meanwhile(tmp_path, monkeypatch):
    path, other = write(tmp_path, slots(5)), write(tmp_path, slots(7), name="other")
    connecting = sqlite3.connect
    replaced = []

    def replaced_meanwhile(*args, **options):
        if not replaced:
            replaced.append(other.rename(path))
        return connecting(*args, **options)

    monkeypatch.setattr(sqlite3, "connect", replaced_meanwhile)
    with closing(connect(path, HeldConnection)) as connection:
        assert connection.execute(COUNT).fetchone() == (7,)
        assert len(descriptors_of(path)) == 2, "SQLite's and the one that holds it"
    assert descriptors_of(path) == []


def test_a_link_is_not_held(tmp_path):
    path = write(tmp_path, slots(5))
    link = tmp_path / "link.grab"
    link.symlink_to(path)
    with pytest.raises(OSError, match="symbolic links"):
        hold(link)


def test_a_file_is_created_once(tmp_path):
    with create(tmp_path / "new") as held:
        assert held.is_at(tmp_path / "new")
    with pytest.raises(FileExistsError):
        create(tmp_path / "new")


def test_many_threads_read_a_file_while_one_keeps_its_lock(writer):
    begin_more(writer, spilled=True)
    threads = [Thread(target=lambda: [read_header(writer.path) for _ in range(200)]) for _ in range(4)]
    for thread in threads:
        thread.start()
    answers = [another_process(writer.path, COUNT) for _ in range(5)]
    for thread in threads:
        thread.join()
    assert set(answers) == {LOCKED}
    assert another_process(writer.path, COUNT) == LOCKED
