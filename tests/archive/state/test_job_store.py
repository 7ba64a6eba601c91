"""The queue's file: written whole or not at all, and set aside where it is damaged."""

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from grabberd.archive.state.job_store import MIGRATIONS, QUEUE, JobStore
from grabberd.errors import StorageError
from grabberd.work.job_rows import StoredJob, Unanalysed

JOB = StoredJob(7, "measure", "c1", False, "queued", "2026-01-01T00:00:00.000Z", parameters="{}")
FAILED = Unanalysed("c1", "failed", '{"message": "m", "hint": "h"}')


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def store(tmp_path: Path, said: list[str]) -> JobStore:
    store = JobStore(tmp_path)
    store.open(said.append)
    return store


def test_jobs_come_back_in_order_as_they_were_put(store: JobStore, tmp_path: Path) -> None:
    later = JOB._replace(number=9, automatic=True, result="1", problem="2", ended_utc="3", attempts=4)
    store.put(later, JOB)
    store.put(JOB._replace(state="running"), unanalysed=[FAILED])
    again = JobStore(tmp_path)
    again.open()
    assert again.jobs() == [JOB._replace(state="running"), later]
    assert again.unanalysed() == [FAILED]
    again.put(analysed=["c1"])
    again.remove([7])
    assert (again.jobs(), again.unanalysed()) == ([later], [])


def test_what_cannot_be_written_leaves_everything_as_it_was(store: JobStore) -> None:
    store.put(JOB)
    nothing: Any = None
    with pytest.raises(StorageError):
        store.put(JOB._replace(state="done"), unanalysed=[FAILED._replace(problem=nothing)])
    assert (store.jobs(), store.unanalysed()) == ([JOB], [])


@pytest.mark.parametrize(
    "content",
    [b"no database", b"SQLite format 3\0" + b"\xff" * 4000, b"\0" * 8192],
    ids=["text", "head", "zeros"],
)
def test_a_damaged_file_is_kept_and_an_empty_queue_begins(
    store: JobStore, said: list[str], content: bytes
) -> None:
    store.put(JOB)
    store.path.write_bytes(content)
    store.open(said.append)
    assert store.jobs() == []
    assert len(said) == 1
    assert [path.read_bytes() for path in store.folder.glob(f"{QUEUE}.damaged-*")] == [content]


def test_so_is_one_of_a_later_version_or_with_more_in_it(store: JobStore, said: list[str]) -> None:
    for change in (
        f"PRAGMA user_version = {len(MIGRATIONS) + 1}",
        "CREATE TRIGGER t AFTER INSERT ON jobs BEGIN DELETE FROM jobs; END",
    ):
        store.put(JOB)
        with closing(sqlite3.connect(store.path)) as connection, connection:
            connection.execute(change)
        store.open(said.append)
        assert store.jobs() == []
    assert len(said) == 2
    assert "is of version 2, this program knows up to 1" in said[0]


def test_a_file_that_is_deleted_while_it_is_used_begins_anew(store: JobStore, said: list[str]) -> None:
    store.put(JOB)
    store.path.unlink()
    store.put(JOB._replace(number=8))
    assert [job.number for job in store.jobs()] == [8]
    assert len(said) == 1
