"""Tokens and sessions in the state store."""

import sqlite3
import stat
from contextlib import closing
from pathlib import Path

import pytest

from grabberd.archive.state.state_database import (
    MIGRATIONS,
    SESSIONS_A_TOKEN,
    Holder,
    StateStore,
    TokenRow,
    TokenStore,
)
from grabberd.errors import Conflict, NotFound, StorageError

NOW, LATER, END = "2026-01-01T00:00:00.000Z", "2026-01-02T00:00:00.000Z", "2026-02-01T00:00:00.000Z"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "state" / "state.sqlite"


@pytest.fixture
def tokens(path: Path) -> TokenStore:
    store = TokenStore(path)
    store.open()
    store.add("tablet", "operator", b"token 1", NOW)
    return store


def sql(path: Path, text: str) -> list[tuple[object, ...]]:
    with closing(sqlite3.connect(path)) as connection, connection:
        return connection.execute(text).fetchall()


def test_a_token_is_found_by_its_hash_after_a_restart_too(tokens: TokenStore, path: Path) -> None:
    assert tokens.of_token(b"token 1") == Holder("tablet", "operator")
    assert tokens.of_token(b"token 2") is None
    again = TokenStore(path)
    again.open()
    assert again.of_token(b"token 1") == Holder("tablet", "operator")


def test_tokens_are_listed_by_name_with_their_living_sessions(tokens: TokenStore) -> None:
    tokens.add("admin", "admin", b"token 2", LATER)
    tokens.add_session(b"session 1", "tablet", NOW, LATER)
    tokens.add_session(b"session 2", "tablet", NOW, END)
    assert tokens.list(LATER) == [
        TokenRow("admin", "admin", LATER, 0),
        TokenRow("tablet", "operator", NOW, 1),
    ]


def test_a_name_is_given_once(tokens: TokenStore) -> None:
    with pytest.raises(Conflict):
        tokens.add("tablet", "viewer", b"token 2", NOW)
    assert tokens.of_token(b"token 2") is None


def test_a_role_that_there_is_not_is_refused(tokens: TokenStore) -> None:
    with pytest.raises(StorageError):
        tokens.add("other", "king", b"token 2", NOW)


def test_a_session_has_its_tokens_role_until_its_time_is_over(tokens: TokenStore) -> None:
    tokens.add_session(b"session", "tablet", NOW, LATER)
    assert tokens.of_session(b"session", NOW) == Holder("tablet", "operator", None, LATER)
    assert tokens.of_session(b"session", LATER) is None
    assert tokens.of_session(b"token 1", NOW) is None
    assert tokens.of_token(b"session") is None


def test_sessions_end_with_their_token(tokens: TokenStore, path: Path) -> None:
    tokens.add_session(b"session", "tablet", NOW, END)
    tokens.remove("tablet")
    assert tokens.of_session(b"session", NOW) is None
    assert sql(path, "SELECT * FROM sessions") == []
    tokens.add("tablet", "operator", b"token 2", NOW)
    assert tokens.of_session(b"session", NOW) is None


def test_a_session_ends_when_it_is_told_to_and_others_do_not(tokens: TokenStore) -> None:
    for name in (b"one", b"two"):
        tokens.add_session(name, "tablet", NOW, END)
    tokens.remove_session(b"one")
    tokens.remove_session(b"one")
    assert tokens.of_session(b"one", NOW) is None
    assert tokens.of_session(b"two", NOW)


def test_what_has_ended_and_what_is_too_many_is_swept_out(tokens: TokenStore, path: Path) -> None:
    tokens.add_session(b"short", "tablet", NOW, LATER)
    for n in range(SESSIONS_A_TOKEN + 5):
        tokens.add_session(b"%d" % n, "tablet", f"2026-01-03T00:00:{n:02d}.000Z", END)
    assert tokens.of_session(b"4", NOW) is None
    assert tokens.of_session(b"5", NOW)
    assert sql(path, "SELECT count(*) FROM sessions") == [(SESSIONS_A_TOKEN,)]


def test_there_is_no_session_of_a_token_that_is_gone(tokens: TokenStore) -> None:
    with pytest.raises(NotFound):
        tokens.add_session(b"session", "other", NOW, END)
    with pytest.raises(NotFound):
        tokens.remove("other")


def test_it_knows_whether_there_are_any(tokens: TokenStore) -> None:
    assert tokens.guards()
    tokens.remove("tablet")
    assert not tokens.guards()


def test_only_its_owner_may_read_it(tokens: TokenStore, path: Path) -> None:
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_a_file_of_the_first_version_is_brought_forward_with_its_settings(path: Path) -> None:
    path.parent.mkdir()
    sql(path, "CREATE TABLE settings (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID")
    sql(path, "INSERT INTO settings VALUES ('one', '1')")
    sql(path, "PRAGMA user_version = 1")
    TokenStore(path).open()
    TokenStore(path).add("tablet", "operator", b"token", NOW)
    assert StateStore(path).get("one") == 1
    assert sql(path, "PRAGMA user_version") == [(len(MIGRATIONS),)]


def test_a_migration_that_fails_changes_nothing(path: Path) -> None:
    path.parent.mkdir()
    sql(path, "CREATE TABLE sessions (x)")
    sql(path, "PRAGMA user_version = 1")
    with pytest.raises(StorageError):
        TokenStore(path).open()
    assert sql(path, "SELECT name FROM sqlite_schema WHERE type = 'table'") == [("sessions",)]
    assert sql(path, "PRAGMA user_version") == [(1,)]


def test_a_token_that_expires_is_listed_with_its_day_and_still_known_after_it(tokens: TokenStore) -> None:
    tokens.add("guest", "viewer", b"token 2", NOW, LATER)
    assert tokens.of_token(b"token 2") == Holder("guest", "viewer", LATER)
    assert [row.expires_utc for row in tokens.list(END)] == [LATER, None]
    tokens.remove("tablet")
    assert tokens.guards()


def test_a_session_never_outlives_its_token(tokens: TokenStore) -> None:
    tokens.add("guest", "viewer", b"token 2", NOW, LATER)
    tokens.add_session(b"session", "guest", NOW, END)
    assert tokens.of_session(b"session", NOW) == Holder("guest", "viewer", LATER, LATER)
    assert tokens.of_session(b"session", LATER) is None
