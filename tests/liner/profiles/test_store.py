"""The store of profiles: every version that was ever stored comes back as it was."""

import sqlite3
import subprocess
import sys
import threading
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grabberd.errors import Conflict, InputError, NotFound
from grabberd_liner.profiles.profiles import LARGEST_BYTES, ProfileStore, StoredProfile

NOW = "2026-03-01T09:30:00.000Z"


@pytest.fixture
def store(tmp_path: Path) -> ProfileStore:
    store = ProfileStore(tmp_path / "state.sqlite")
    store.open()
    return store


def all_versions(store: ProfileStore, kind: str, name: str) -> list[StoredProfile]:
    """All versions of a profile, the newest first."""
    return [store.get(kind, name, number) for number in range(store.newest(kind, name), 0, -1)]


def test_versions_count_from_one_and_stay_as_they_were(store: ProfileStore) -> None:
    for age in range(3):
        stored = store.put("liner", "A", {"age": age}, NOW)
        assert (stored.version, stored.newest, stored.content) == (age + 1, age + 1, {"age": age})
    assert [one.content["age"] for one in all_versions(store, "liner", "A")] == [2, 1, 0]
    assert store.get("liner", "A", 1).content == {"age": 0}
    assert store.get("liner", "A", 1).newest == 3


def test_the_same_content_makes_no_version(store: ProfileStore) -> None:
    first = store.put("liner", "A", {"age": 1, "lot": "7"}, NOW)
    assert store.put("liner", "A", {"lot": "7", "age": 1.0}, "2026-03-02T00:00:00.000Z") == first


def test_an_earlier_content_makes_a_version_of_its_own(store: ProfileStore) -> None:
    for age in (1, 2, 1):
        store.put("liner", "A", {"age": age}, NOW)
    assert [one.version for one in all_versions(store, "liner", "A")] == [3, 2, 1]


def test_kinds_do_not_share_their_names(store: ProfileStore) -> None:
    store.put("liner", "A", {"age": 1}, NOW)
    store.put("cow", "A", {"age": 2}, NOW)
    assert [(one.kind, one.name, one.version) for one in store.heads()] == [
        ("cow", "A", 1),
        ("liner", "A", 1),
    ]
    assert store.get("cow", "A").content == {"age": 2}
    assert [one.kind for one in store.heads("cow")] == ["cow"]


def test_a_retired_profile_keeps_its_versions_and_comes_back_when_it_is_stored_again(
    store: ProfileStore,
) -> None:
    store.put("liner", "A", {"age": 1}, NOW)
    retired = store.retire("liner", "A", NOW)
    assert (retired.retired_utc, retired.content) == (NOW, {"age": 1})
    assert store.retire("liner", "A", "2026-04-01T00:00:00.000Z").retired_utc == NOW
    back = store.put("liner", "A", {"age": 1}, NOW)
    assert (back.version, back.retired_utc) == (1, None)


def test_a_change_of_another_version_than_the_newest_is_refused_and_changes_nothing(
    store: ProfileStore,
) -> None:
    store.put("liner", "A", {"age": 1}, NOW, after=0)
    store.put("liner", "A", {"age": 2}, NOW, after=1)
    for after in (0, 1, 3):
        with pytest.raises(Conflict, match="version 2"):
            store.put("liner", "A", {"age": 9}, NOW, after=after)
    assert [one.content["age"] for one in all_versions(store, "liner", "A")] == [2, 1]


def test_a_refused_change_does_not_bring_a_retired_profile_back(store: ProfileStore) -> None:
    store.put("liner", "A", {"age": 1}, NOW)
    store.retire("liner", "A", NOW)
    with pytest.raises(Conflict):
        store.put("liner", "A", {"age": 2}, NOW, after=0)
    assert store.get("liner", "A").retired_utc == NOW


def test_profiles_and_versions_that_there_are_not_are_told(store: ProfileStore) -> None:
    store.put("liner", "A", {"age": 1}, NOW)
    with pytest.raises(NotFound, match="has no version 2"):
        store.get("liner", "A", 2)
    for ask in (store.get, store.newest):
        with pytest.raises(NotFound, match="no liner profile 'B'"):
            ask("liner", "B")
    with pytest.raises(NotFound):
        store.retire("liner", "B", NOW)
    assert store.find("liner", "B") is None


@pytest.mark.parametrize("content", [{"note": "x" * LARGEST_BYTES}, {"E": float("nan")}, {"note": "\ud800"}])
def test_a_content_that_cannot_be_kept_is_refused(store: ProfileStore, content: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        store.put("liner", "A", content, NOW)
    assert list(store.heads()) == []


def test_a_version_that_the_disk_has_changed_is_not_taken_for_what_was_stored(store: ProfileStore) -> None:
    store.put("liner", "A", {"age": 1}, NOW)
    with closing(sqlite3.connect(store.path)) as connection, connection:
        connection.execute("""UPDATE profiles SET content = '{"age": 2}'""")
    damaged = store.get("liner", "A")
    assert damaged.problem == "version 1 of the liner profile A is not what was stored"
    with pytest.raises(ValueError, match="not what was stored"):
        _ = damaged.content
    assert store.put("liner", "A", {"age": 2}, NOW).version == 2


def test_programs_that_store_at_the_same_moment_get_a_version_each(store: ProfileStore) -> None:
    def add(own: int) -> None:
        for age in range(10):
            ProfileStore(store.path).put("liner", "A", {"own": own, "age": age}, NOW)

    threads = [threading.Thread(target=add, args=(own,)) for own in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    versions = all_versions(store, "liner", "A")
    assert [one.version for one in versions] == list(range(30, 0, -1))
    assert len({(one.content["own"], one.content["age"]) for one in versions}) == 30


def test_a_program_that_is_killed_leaves_whole_versions(store: ProfileStore) -> None:
    store.put("liner", "A", {"age": 0}, NOW)
    code = (
        "import sys; from pathlib import Path; from itertools import count\n"
        "from grabberd_liner.profiles.profiles import ProfileStore\n"
        "store = ProfileStore(Path(sys.argv[1]))\n"
        "for age in count(1):\n"
        "    print(store.put('liner', 'A', {'age': age}, sys.argv[2]).version, flush=True)\n"
    )
    for _ in range(3):
        with subprocess.Popen([sys.executable, "-c", code, store.path, NOW], stdout=subprocess.PIPE) as child:
            assert child.stdout is not None
            said = [int(child.stdout.readline()) for _ in range(5)]
            child.kill()
        versions = all_versions(store, "liner", "A")
        assert [one.version for one in versions] == list(range(len(versions), 0, -1))
        assert [one.problem for one in versions] == [None] * len(versions)
        assert versions[0].version >= said[-1]
        assert store.get("liner", "A", 1).content == {"age": 0}


CONTENT = st.dictionaries(
    st.text(max_size=3),
    st.one_of(st.integers(-9, 9), st.floats(-9, 9), st.text(max_size=3), st.booleans()),
    max_size=2,
)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.one_of(st.none(), CONTENT), max_size=8))
def test_whatever_is_stored_and_retired_all_of_it_can_be_read(
    tmp_path_factory: pytest.TempPathFactory, steps: list[dict[str, Any] | None]
) -> None:
    """A step is a content to store, or None to retire."""
    store = ProfileStore(tmp_path_factory.mktemp("profiles") / "state.sqlite")
    store.open()
    known: list[dict[str, Any]] = []
    for step in steps:
        if step is not None:
            known += [] if known and known[-1] == step else [step]
            assert store.put("cow", "112", step, NOW).retired_utc is None
        elif known:
            assert store.retire("cow", "112", NOW).retired_utc == NOW
    versions = all_versions(store, "cow", "112") if known else []
    assert [one.content for one in versions] == known[::-1]
    assert [one.version for one in versions] == list(range(len(known), 0, -1))
