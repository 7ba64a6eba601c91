"""Profiles of a state directory: stored, found by labels, retired, backed up."""

import sqlite3
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

import pytest

from grabberd.archive.state.backup import back_up, restore
from grabberd.errors import Conflict, InputError, NotFound, StorageError
from grabberd.work.process import Processes
from grabberd_liner.chain.analysis.profile_inputs import quantity_problems
from grabberd_liner.profiles.profiles import Profiles, check_name, problems_in_process, read_profile
from liner.chain.analysis.profiling import ALL, COW, CUP, LINER, PULSATOR, changed


class Clock:
    """A wall clock that stands still."""

    def utc_now(self) -> datetime:
        return datetime(2026, 3, 1, 9, 30, tzinfo=UTC)

    def now_ns(self) -> int:
        return 0


def profiles_in(folder: Path) -> Profiles:
    profiles = Profiles(folder / "state.sqlite", quantity_problems, Clock())
    profiles.open()
    return profiles


@pytest.fixture
def profiles(tmp_path: Path) -> Profiles:
    return profiles_in(tmp_path)


def test_a_stored_profile_comes_back_as_document_and_as_text(profiles: Profiles) -> None:
    stored = profiles.put(LINER)
    assert (stored.is_new, stored.document.version, stored.document.created_utc[:10]) == (
        True,
        1,
        "2026-03-01",
    )
    found = profiles.get("liner", "A")
    assert found == stored.document
    assert found.profile == read_profile(found.yaml) == LINER


def test_the_next_version_is_new_and_the_same_content_is_not(profiles: Profiles) -> None:
    profiles.put(LINER)
    older = changed(LINER, "age_milkings", 900)
    assert [profiles.put(one).is_new for one in (LINER, older, older)] == [False, True, False]
    assert list(profiles.versions("liner", "A")) == [2, 1]
    assert profiles.get("liner", "A", 1).profile == LINER


def test_a_profile_that_cannot_be_used_is_not_stored(profiles: Profiles) -> None:
    with pytest.raises(InputError, match="E_sigma_mpa"):
        profiles.put(changed(LINER, "material.E_sigma_mpa", None))
    with pytest.raises(NotFound):
        profiles.get("liner", "A")


def test_labels_find_the_newest_versions_of_those_in_use(profiles: Profiles) -> None:
    for one in (*ALL, changed(COW, "lactation", 3)):
        profiles.put(one)
    profiles.retire("cup", CUP["name"])
    labels = {"liner": "A", "pulsator": "south", "cup": "1", "cow": "112", "teat": "front left"}
    found = profiles.of_labels(labels).profiles
    assert [(one.kind, one.version) for one in found] == [
        ("liner", 1),
        ("cow", 2),
    ]
    assert list(profiles.of_labels({"teat": "front left"}).profiles) == []


def test_a_label_is_found_however_its_letters_are_sent(profiles: Profiles) -> None:
    profiles.put({"kind": "cow", "name": "Bl\u00e5ros"})
    assert [one.name for one in profiles.of_labels({"cow": "Bla\u030aros"}).profiles] == ["Bl\u00e5ros"]


def test_retired_ones_are_listed_only_if_wanted_and_stay_readable(profiles: Profiles) -> None:
    for one in ALL:
        profiles.put(one)
    assert profiles.retire("liner", "A").retired_utc is not None
    assert [head.kind for head in profiles.heads()] == ["cow", "cup", "pulsator"]
    assert [head.kind for head in profiles.heads("liner", retired=True)] == ["liner"]
    assert profiles.get("liner", "A", 1).profile == LINER


def test_a_new_profile_does_not_take_the_name_of_a_retired_one(profiles: Profiles) -> None:
    profiles.put(COW)
    profiles.retire("cow", "112")
    with pytest.raises(Conflict, match="already"):
        profiles.put(COW, after=0)


def test_a_document_of_another_profile_than_its_address_names_is_refused() -> None:
    check_name(LINER, "liner", "A")
    for document in (changed(LINER, "name", "B"), PULSATOR, {}):
        with pytest.raises(InputError, match="the address of the liner 'A'"):
            check_name(document, "liner", "A")


def test_one_that_the_disk_has_changed_is_listed_with_the_reason_and_never_used(
    profiles: Profiles, tmp_path: Path
) -> None:
    for one in (LINER, COW):
        profiles.put(one)
    with closing(sqlite3.connect(tmp_path / "state.sqlite")) as connection, connection:
        connection.execute(
            "UPDATE profiles SET content = replace(content, '2.5', '3.5') WHERE kind = 'liner'"
        )
    cow, liner = (profiles.row(kind, name, version) for kind, name, version, *_ in profiles.heads())
    assert (cow.problem, liner.problem) == (None, "version 1 of the liner profile A is not what was stored")
    for ask in (lambda: profiles.get("liner", "A"), lambda: profiles.of_labels({"liner": "A"})):
        with pytest.raises(StorageError, match="not what was stored"):
            ask()
    assert profiles.put(LINER).document.version == 2


def test_a_backup_has_all_versions(tmp_path: Path) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    profiles = profiles_in(here)
    profiles.put(LINER)
    profiles.put(changed(LINER, "age_milkings", 900))
    back_up(here, tmp_path / "barn.zip", "2026-03-01T09:30:00.000Z", "0.1.0")
    restore(there, tmp_path / "barn.zip", "20260301T093000Z")
    restored = profiles_in(there)
    assert restored.heads() == profiles.heads()
    assert restored.row("liner", "A", 2) == profiles.row("liner", "A", 2)
    assert restored.get("liner", "A", 1).profile == LINER


def test_the_process_finds_what_is_wrong_as_the_daemon_would(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, processes: Processes
) -> None:
    (tmp_path / "grabberd.py").write_text("raise SystemExit('a module of the current folder')")
    monkeypatch.chdir(tmp_path)
    wrong = changed(LINER, "material.E_mpa", float("nan"))
    assert problems_in_process(processes, LINER) == []
    found = problems_in_process(processes, wrong)
    assert [words.replace("NaN", "nan") for words in found] == quantity_problems(wrong)
    assert problems_in_process(processes, {**LINER, 7: "seven", "lot": {1, 2}}) == []


def test_a_process_that_does_not_answer_is_an_error_of_the_machine(
    monkeypatch: pytest.MonkeyPatch, processes: Processes
) -> None:
    monkeypatch.setattr("sys.executable", "/bin/false")
    with pytest.raises(StorageError, match="does not answer"):
        problems_in_process(processes, LINER)
    assert problems_in_process(processes, COW) == []
