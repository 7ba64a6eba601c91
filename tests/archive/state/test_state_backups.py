"""The state is backed up, and comes back from the newest good backup when it is damaged."""

import sqlite3
import stat
from contextlib import closing
from datetime import UTC, datetime, timedelta

import pytest

from grabberd.archive.capture.captures_folder import ANY, CapturesFolder
from grabberd.archive.state.state_database import Annotation, AnnotationStore, StateStore, TokenStore
from grabberd.archive.state.state_keeper import CAPTURES_FOLDER, KEPT, StateBackups, accept_state, origin_of
from grabberd.errors import StorageError

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)
NOW = "2026-03-01T12:00:00.000Z"
END = "2026-04-01T12:00:00.000Z"


def minutes(count):
    return NOON + timedelta(minutes=count)


@pytest.fixture
def state(tmp_path):
    store = StateStore(tmp_path / "state.sqlite")
    store.open()
    store.put({"threshold": 60})
    return store


@pytest.fixture
def tokens(state):
    return TokenStore(state.path)


@pytest.fixture
def backups(state):
    return StateBackups(state.path.parent)


def names(backups):
    return [backup.path.name for backup in backups.backups()]


def garbage(path):
    path.write_bytes(b"garbage " * 2000)


def a_damaged_page(path):
    with path.open("r+b") as file:
        file.seek(4096)
        file.write(b"\xff" * 4096)


def cut_short(path):
    path.write_bytes(path.read_bytes()[:5000])


def without_tables(path):
    path.unlink()
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("CREATE TABLE other (x)")


def emptied(path):
    path.write_bytes(b"")


HARMS = [garbage, a_damaged_page, cut_short, without_tables, emptied, lambda path: path.unlink()]


# --- backing up ---


def test_a_backup_is_made_when_something_that_matters_has_changed(state, tokens, backups):
    assert backups.back_up(minutes(0))
    assert not backups.back_up(minutes(1))
    state.put({"threshold": 61})
    assert backups.back_up(minutes(2))
    AnnotationStore(state.path).put("c1", Annotation(pinned=True))
    assert backups.back_up(minutes(3))
    tokens.add("tablet", "operator", b"hash", NOW)
    assert backups.back_up(minutes(4))
    tokens.add_session(b"session", "tablet", NOW, END)
    assert not backups.back_up(minutes(5)), "a login is worth nothing after a recovery"
    assert backups.back_up(minutes(6), always=True)


def test_it_says_in_its_name_when_it_was_made_and_how_many_tokens_there_were(tokens, backups):
    tokens.add("tablet", "operator", b"hash", NOW)
    backups.back_up(NOON)
    assert names(backups) == ["state-20260301T120000000000Z.tokens-1.sqlite"]


def test_only_its_owner_may_read_it(backups):
    backups.back_up(NOON)
    assert stat.S_IMODE(backups.folder.stat().st_mode) == 0o700
    assert stat.S_IMODE(backups.backups()[0].path.stat().st_mode) == 0o600


def test_the_newest_few_are_kept(state, backups):
    for minute in range(KEPT + 3):
        state.put({"threshold": minute})
        backups.back_up(minutes(minute))
    assert [backup.made for backup in backups.backups()] == [minutes(5), minutes(4), minutes(3)]


def test_after_a_restart_what_has_not_changed_is_not_backed_up_again(state, backups):
    backups.back_up(minutes(0))
    assert not StateBackups(backups.directory).back_up(minutes(1))


def test_a_backup_that_was_damaged_or_deleted_is_made_again(state, backups):
    backups.back_up(minutes(0))
    garbage(backups.backups()[0].path)
    assert StateBackups(backups.directory).back_up(minutes(1))
    for backup in backups.backups():
        backup.path.unlink()
    assert StateBackups(backups.directory).back_up(minutes(2))


@pytest.mark.parametrize("harm", [garbage, a_damaged_page, cut_short, without_tables])
def test_a_damaged_state_replaces_no_good_backup(state, backups, harm):
    backups.back_up(minutes(0))
    before = names(backups)
    harm(state.path)
    with pytest.raises(sqlite3.DatabaseError):
        backups.back_up(minutes(1), always=True)
    assert names(backups) == before


def test_a_disk_that_cannot_be_read_is_no_damage(backups, monkeypatch):
    def broken(*_, **__):
        error = sqlite3.OperationalError("disk I/O error")
        error.sqlite_errorcode = sqlite3.SQLITE_IOERR
        raise error

    monkeypatch.setattr(sqlite3, "connect", broken)
    with pytest.raises(StorageError, match="I/O error"):
        backups.damage()


def test_a_removed_token_is_in_no_backup_that_is_left(state, tokens, backups):
    tokens.add("tablet", "operator", b"tablet", NOW)
    backups.back_up(minutes(0))
    tokens.add("visitor", "viewer", b"visitor", NOW)
    backups.back_up(minutes(1))
    tokens.remove("visitor")
    backups.back_up(minutes(2))
    garbage(state.path)
    garbage(backups.backups()[0].path)
    backups.recover("damaged", minutes(3))
    assert tokens.of_token(b"visitor") is None
    assert tokens.of_token(b"tablet")


# --- what is damage ---


def test_a_state_that_never_was_is_not_damaged(tmp_path):
    assert StateBackups(tmp_path).damage() is None


def test_a_first_start_that_was_cut_off_is_not_damage(tmp_path):
    (tmp_path / "state.sqlite").touch()
    assert StateBackups(tmp_path).damage() is None


def test_an_intact_state_is_not_damaged_even_if_a_later_version_wrote_it(state, backups):
    assert backups.damage() is None
    with closing(sqlite3.connect(state.path)) as connection:
        connection.execute("PRAGMA user_version = 99")
    assert backups.damage() is None


@pytest.mark.parametrize("harm", HARMS)
def test_every_kind_of_damage_is_found(state, backups, harm):
    backups.back_up(NOON)
    harm(state.path)
    assert backups.damage()


# --- recovering ---


@pytest.mark.parametrize("harm", HARMS)
def test_the_newest_backup_comes_back_and_the_state_says_from_when_it_is(state, backups, harm):
    backups.back_up(minutes(0))
    harm(state.path)
    there = state.path.exists()
    origin = backups.recover("it is damaged", minutes(9))
    assert state.get("threshold") == 60
    assert origin.from_utc == "2026-03-01T12:00:00.000Z"
    assert origin.at_utc == "2026-03-01T12:09:00.000Z"
    assert origin_of(state) == origin
    assert (origin.aside is not None) == there
    assert backups.damage() is None


def test_the_damaged_file_is_kept_with_its_journal_under_a_dated_name(state, backups):
    backups.back_up(minutes(0))
    garbage(state.path)
    state.path.with_name("state.sqlite-journal").write_bytes(b"half a transaction")
    for minute in (1, 2):
        garbage(state.path)
        backups.recover("damaged", minutes(minute))
    kept = sorted(path.name for path in state.path.parent.glob("state.sqlite.*"))
    assert kept == [
        "state.sqlite.damaged-20260301T120100000000Z",
        "state.sqlite.damaged-20260301T120100000000Z-journal",
        "state.sqlite.damaged-20260301T120200000000Z",
    ]
    assert (state.path.parent / kept[0]).read_bytes() == b"garbage " * 2000


def test_a_damaged_backup_is_passed_over_for_an_older_one(state, backups):
    for minute in range(3):
        state.put({"threshold": minute})
        backups.back_up(minutes(minute))
    for backup in backups.backups()[:2]:
        garbage(backup.path)
    garbage(state.path)
    assert backups.recover("damaged", minutes(9)).from_utc == "2026-03-01T12:00:00.000Z"
    assert state.get("threshold") == 0


def test_tokens_come_back_and_sessions_do_not(state, tokens, backups):
    tokens.add("tablet", "operator", b"tablet", NOW)
    tokens.add_session(b"session", "tablet", NOW, END)
    backups.back_up(minutes(0))
    tokens.remove_session(b"session")
    garbage(state.path)
    backups.recover("damaged", minutes(1))
    assert tokens.of_token(b"tablet")
    assert tokens.of_session(b"session", NOW) is None


def test_without_a_good_backup_a_new_state_says_that_all_is_lost(state, backups):
    backups.back_up(minutes(0))
    garbage(state.path)
    garbage(backups.backups()[0].path)
    origin = backups.recover("damaged", minutes(1))
    assert origin.from_utc is None
    assert state.get("threshold") is None
    assert origin_of(state) == origin


def test_a_recovery_that_was_cut_off_is_done_at_the_next_start(state, backups):
    backups.back_up(minutes(0))
    garbage(backups.backups()[0].path)
    state.path.rename(state.path.with_name("state.sqlite.damaged-20260301T120000000000Z"))
    assert backups.damage() == "it is gone"


# --- who is let in ---


def lose(state, backups, *, also=()):
    for path in (state.path, *also):
        garbage(path)
    backups.recover("damaged", minutes(9))


def test_where_tokens_were_lost_nobody_is_let_in_without_one_until_there_is_one_again(state, tokens, backups):
    tokens.add("tablet", "operator", b"tablet", NOW)
    backups.back_up(minutes(0))
    lose(state, backups, also=[backups.backups()[0].path])
    assert tokens.list(NOW) == []
    assert tokens.guards()
    tokens.add("new", "admin", b"new", NOW)
    tokens.remove("new")
    assert not tokens.guards(), "a person has decided"


def test_where_an_older_backup_without_tokens_came_back_nobody_is_let_in_either(state, tokens, backups):
    backups.back_up(minutes(0))
    tokens.add("tablet", "operator", b"tablet", NOW)
    backups.back_up(minutes(1))
    lose(state, backups, also=[backups.backups()[0].path])
    assert tokens.list(NOW) == []
    assert tokens.guards()


def test_where_nothing_tells_whether_there_were_tokens_nobody_is_let_in(state, tokens, backups):
    lose(state, backups)
    assert tokens.guards()


@pytest.mark.parametrize("lost", [False, True])
def test_where_there_were_none_the_machine_is_served_as_before(state, tokens, backups, lost):
    backups.back_up(minutes(0))
    lose(state, backups, also=[backups.backups()[0].path] if lost else [])
    assert not tokens.guards()


# --- accepting ---


def test_a_person_accepts_what_came_back(state, backups):
    backups.back_up(minutes(0))
    lose(state, backups)
    folder = state.path.parent / "captures"
    assert accept_state(state.path, folder) == ["settings of 2026-03-01T12:00:00.000Z"]
    assert origin_of(state) is None
    assert accept_state(state.path, folder) == []


def test_a_person_accepts_another_folder_of_captures(state):
    folder = CapturesFolder(state.path.parent / "captures")
    folder.take()
    state.put({CAPTURES_FOLDER: "another"})
    assert accept_state(state.path, folder.path) == [f"the folder of captures {folder.path}"]
    assert state.get(CAPTURES_FOLDER) == ANY
    folder.release()
