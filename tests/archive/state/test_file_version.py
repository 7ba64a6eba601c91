"""What is remembered of a database, until anybody changes it."""

import os
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from grabberd.archive.access import FileVersion, NotRemembered, Remembered

ELSEWHERE = """
import sqlite3, sys
with sqlite3.connect(sys.argv[1]) as connection:
    connection.execute(sys.argv[2])
connection.close()
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "state.sqlite"
    sql(path, "CREATE TABLE tokens (name TEXT)")
    sql(path, "INSERT INTO tokens VALUES ('tablet')")
    return path


@pytest.fixture
def remembered(path: Path) -> Remembered[str]:
    return Remembered(FileVersion(path), 3)


def sql(path: Path, statement: str) -> list[tuple[str, ...]]:
    with closing(sqlite3.connect(path)) as connection, connection:
        return connection.execute(statement).fetchall()


def in_another_process(path: Path, statement: str) -> None:
    subprocess.run([sys.executable, "-c", ELSEWHERE, str(path), statement], check=True)


def names(path: Path) -> str:
    return ", ".join(name for (name,) in sql(path, "SELECT name FROM tokens ORDER BY name"))


def test_what_nobody_changes_is_read_once(path: Path, remembered: Remembered[str]) -> None:
    assert remembered.get("names", lambda: names(path)) == "tablet"
    assert remembered.get("names", pytest.fail) == "tablet"
    assert remembered.get("names", pytest.fail, at_once=True) == "tablet"


def test_what_is_not_known_is_not_told_at_once(path: Path, remembered: Remembered[str]) -> None:
    with pytest.raises(NotRemembered):
        remembered.get("names", pytest.fail, at_once=True)


@pytest.mark.parametrize("change", ["DELETE FROM tokens", "INSERT INTO tokens VALUES ('robot')"])
def test_a_change_by_another_process_counts_at_once(
    path: Path, remembered: Remembered[str], change: str
) -> None:
    remembered.get("names", lambda: names(path))
    in_another_process(path, change)
    with pytest.raises(NotRemembered):
        remembered.get("names", pytest.fail, at_once=True)
    assert remembered.get("names", lambda: names(path)) == names(path) != "tablet"


def test_changes_count_however_fast_they_follow_each_other(path: Path, remembered: Remembered[str]) -> None:
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("PRAGMA synchronous = OFF")
        for number in range(300):
            remembered.get("names", lambda: "before")
            with connection:
                connection.execute("UPDATE tokens SET name = ?", (f"{number}",))
            with pytest.raises(NotRemembered):
                remembered.get("names", pytest.fail, at_once=True)


def test_another_file_in_its_place_counts_at_once(path: Path, remembered: Remembered[str]) -> None:
    other = path.with_name("other.sqlite")
    shutil.copy2(path, other)
    remembered.get("names", lambda: names(path))
    other.replace(path)
    with pytest.raises(NotRemembered):
        remembered.get("names", pytest.fail, at_once=True)
    remembered.get("names", lambda: names(path))
    assert remembered.get("names", pytest.fail, at_once=True) == "tablet"


def test_content_written_over_it_counts(path: Path, remembered: Remembered[str]) -> None:
    remembered.get("names", lambda: names(path))
    content = path.read_bytes()
    path.write_bytes(content + bytes(4096))
    with pytest.raises(NotRemembered):
        remembered.get("names", pytest.fail, at_once=True)


def test_of_a_file_that_is_gone_nothing_is_known(path: Path, remembered: Remembered[str]) -> None:
    remembered.get("names", lambda: names(path))
    path.unlink()
    with pytest.raises(NotRemembered):
        remembered.get("names", pytest.fail, at_once=True)


def test_what_changes_while_it_is_read_is_not_remembered(path: Path, remembered: Remembered[str]) -> None:
    def read() -> str:
        found = names(path)
        sql(path, "DELETE FROM tokens")
        return found

    assert remembered.get("names", read) == "tablet"
    with pytest.raises(NotRemembered):
        remembered.get("names", pytest.fail, at_once=True)


def test_what_is_read_after_a_transaction_was_rolled_back_is_not_taken_for_the_next_one(
    path: Path, remembered: Remembered[str]
) -> None:
    """The counter is the same after both, if the first reached the file before it was rolled back."""
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("PRAGMA cache_size = 1")
        connection.execute("PRAGMA cache_spill = 1")
        connection.execute("BEGIN EXCLUSIVE")
        connection.execute("CREATE TABLE many (x BLOB)")
        for _ in range(50):
            connection.execute("INSERT INTO many VALUES (randomblob(8000))")

        def read() -> str:
            connection.execute("ROLLBACK")
            return names(path)

        assert remembered.get("names", read) == "tablet"
    sql(path, "UPDATE tokens SET name = 'robot'")
    with pytest.raises(NotRemembered):
        remembered.get("names", pytest.fail, at_once=True)


def test_a_file_with_a_write_ahead_log_is_never_remembered(path: Path, remembered: Remembered[str]) -> None:
    sql(path, "PRAGMA journal_mode = WAL")
    remembered.get("names", lambda: names(path))
    with pytest.raises(NotRemembered):
        remembered.get("names", pytest.fail, at_once=True)


def test_that_there_is_none_is_not_remembered(path: Path, remembered: Remembered[str]) -> None:
    assert remembered.get("nobody", lambda: None) is None
    with pytest.raises(NotRemembered):
        remembered.get("nobody", pytest.fail, at_once=True)


def test_few_values_are_kept_those_asked_for_last(remembered: Remembered[str]) -> None:
    for key in ("a", "b", "c", "a", "d"):
        remembered.get(key, lambda key=key: key)
    with pytest.raises(NotRemembered):
        remembered.get("b", pytest.fail, at_once=True)
    assert [remembered.get(key, pytest.fail, at_once=True) for key in "acd"] == list("acd")


def test_the_locks_of_other_connections_outlast_a_look(path: Path) -> None:
    version = FileVersion(path)
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("BEGIN EXCLUSIVE")
        for _ in range(3):
            version.now()
        hasty = ELSEWHERE.replace("(sys.argv[1])", "(sys.argv[1], timeout=0)")
        words = [sys.executable, "-c", hasty, str(path), "DELETE FROM tokens"]
        refused = subprocess.run(words, check=False, capture_output=True, text=True)
    assert "database is locked" in refused.stderr


def test_one_file_is_held_open_at_a_time(path: Path) -> None:
    version = FileVersion(path)
    version.now()
    held = len(os.listdir("/proc/self/fd"))
    for _ in range(5):
        other = path.with_name("other.sqlite")
        shutil.copy2(path, other)
        other.replace(path)
        assert version.now() is not None
    assert len(os.listdir("/proc/self/fd")) == held
