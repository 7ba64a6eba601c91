"""The state store: small values that outlive the program."""

import sqlite3
import stat
from pathlib import Path

import pytest

from grabberd.archive.state.state_database import StateStore
from grabberd.errors import StorageError


@pytest.fixture
def state(tmp_path: Path) -> StateStore:
    store = StateStore(tmp_path / "state" / "state.sqlite")
    store.open()
    return store


def test_what_was_put_is_there_after_a_restart(state: StateStore) -> None:
    state.put({"one": {"id": "rig-7", "count": 3}, "other": [1.5, None, "ü"]})
    again = StateStore(state.path)
    again.open()
    assert again.get("one") == {"id": "rig-7", "count": 3}
    assert again.get("other") == [1.5, None, "ü"]


def test_a_later_value_replaces_the_earlier(state: StateStore) -> None:
    state.put({"one": 1})
    state.put({"one": 2})
    assert state.get("one") == 2


def test_what_was_never_put_or_is_removed_is_none(state: StateStore) -> None:
    state.put({"one": 1})
    state.remove("one")
    state.remove("never")
    assert (state.get("one"), state.get("never")) == (None, None)


def test_several_keys_are_written_all_or_not_at_all(state: StateStore) -> None:
    with pytest.raises(TypeError):
        state.put({"good": 1, "bad": object()})
    connection = sqlite3.connect(state.path)
    connection.execute(
        "CREATE TRIGGER no BEFORE INSERT ON settings WHEN NEW.key = 'bad' "
        "BEGIN SELECT RAISE(ABORT, 'full'); END"
    )
    connection.close()
    with pytest.raises(StorageError, match="full"):
        state.put({"good": 1, "bad": 2})
    assert state.get("good") is None


def test_only_its_owner_may_read_it(state: StateStore) -> None:
    assert stat.S_IMODE(state.path.stat().st_mode) == 0o600


def test_a_damaged_file_is_refused_with_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "state.sqlite"
    path.write_bytes(b"garbage " * 1000)
    with pytest.raises(StorageError) as caught:
        StateStore(path).open()
    assert "backup" in caught.value.hint
    assert path.read_bytes() == b"garbage " * 1000


def test_a_later_versions_file_is_left_alone(state: StateStore) -> None:
    connection = sqlite3.connect(state.path)
    connection.execute("PRAGMA user_version = 99")
    connection.close()
    with pytest.raises(StorageError, match="version 99"):
        state.open()
