"""The state database is backed up by itself and recovered when it is damaged, at the start and afterwards."""

import logging
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from slots import ManualClock

from grabberd.archive.access import Access
from grabberd.archive.state.state_database import StateStore
from grabberd.archive.state.state_keeper import ALWAYS_NS, StateKeeper, accept_state
from grabberd.documents.enums import Role
from grabberd.errors import Cause, StorageError
from grabberd.fault_board import FaultBoard


class Rig:
    """The state of a daemon that is started and stopped."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.path = folder / "state.sqlite"
        self.clock = ManualClock(0)
        self.again: list[int] = []
        self.start()

    def start(self) -> None:
        self.faults = FaultBoard(self.clock)
        restored = lambda: self.again.append(1)  # noqa: E731
        self.keeper = StateKeeper(self.folder, self.faults, self.clock, restored)
        self.store = StateStore(self.path, self.keeper.heal)
        self.access = Access(self.folder, self.clock, self.keeper.heal)
        self.keeper.open()

    def restart(self) -> None:
        self.keeper.close()
        self.clock.advance(1)
        self.start()

    def change(self, value: int) -> None:
        self.clock.advance(10)
        self.store.put({"threshold": value})
        self.keeper.look()

    def damage(self, *, backups: bool = False) -> None:
        for path in (self.path, *(self.folder / "backups").glob("*" if backups else "none")):
            if path.is_file():
                path.write_bytes(b"garbage " * 2000)
        self.clock.advance(1)

    def causes(self) -> list[Cause]:
        return [fault.cause_code for fault in self.faults.now]

    def backups(self) -> int:
        return len(list((self.folder / "backups").glob("state-*")))


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    started = Rig(tmp_path / "state")
    yield started
    started.keeper.close()


def test_it_is_backed_up_at_the_start_and_when_it_has_changed(rig: Rig) -> None:
    assert rig.backups() == 1
    rig.change(60)
    assert rig.backups() == 2
    rig.keeper.look()
    assert rig.backups() == 2
    assert rig.causes() == []


def test_what_another_program_changes_is_backed_up_as_well(rig: Rig) -> None:
    Access(rig.folder, rig.clock).add("tablet", Role.OPERATOR)
    rig.clock.advance(10)
    rig.keeper.look()
    assert [path.name.split(".")[1] for path in sorted((rig.folder / "backups").glob("*"))] == [
        "tokens-0",
        "tokens-1",
    ]


def test_what_changes_last_is_backed_up_at_the_end(rig: Rig) -> None:
    rig.store.put({"threshold": 61})
    rig.clock.advance(1)
    rig.keeper.close()
    assert rig.backups() == 2


def test_damage_that_nobody_has_come_across_is_found_within_the_hour(rig: Rig) -> None:
    rig.change(60)
    stat = rig.path.stat()
    with rig.path.open("r+b") as file:
        file.seek(4096)
        file.write(b"\xff" * 4096)
    rig.keeper._seen = (stat.st_ino, rig.path.stat().st_mtime_ns, stat.st_size)  # as a disk loses bits
    rig.keeper.look()
    assert rig.causes() == []
    rig.clock.advance(ALWAYS_NS / 1e9)
    rig.keeper.look()
    assert rig.causes() == [Cause.SETTINGS_RESTORED]


def test_damaged_at_the_start_it_comes_back_and_says_from_when_it_is(
    rig: Rig, caplog: pytest.LogCaptureFixture
) -> None:
    rig.change(60)
    rig.keeper.close()
    rig.damage()
    rig.start()
    assert rig.store.get("threshold") == 60
    (fault,) = rig.faults.now
    assert (fault.cause_code, fault.level) == (Cause.SETTINGS_RESTORED, "warning")
    assert "those of 2026-01-01T00:00:10.000Z" in fault.message
    assert "state.sqlite.damaged-20260101T000011000000Z" in fault.message
    assert len([record for record in caplog.records if record.levelno >= logging.WARNING]) == 1


def test_without_a_good_backup_it_starts_all_the_same_and_says_loudly_what_is_lost(
    rig: Rig, caplog: pytest.LogCaptureFixture
) -> None:
    rig.keeper.close()
    rig.damage(backups=True)
    rig.start()
    (fault,) = rig.faults.now
    assert (fault.cause_code, fault.level) == (Cause.SETTINGS_LOST, "fault")
    assert "lost since 2026-01-01T00:00:01.000Z" in fault.message
    assert "grabberd restore" in fault.hint
    assert [record.levelname for record in caplog.records if record.levelno >= logging.WARNING] == ["ERROR"]


@pytest.mark.parametrize("lost", [False, True])
def test_it_is_said_after_every_restart_until_a_person_accepts_it(rig: Rig, lost: bool) -> None:
    rig.keeper.close()
    rig.damage(backups=lost)
    rig.start()
    rig.restart()
    assert rig.causes() == [Cause.SETTINGS_LOST if lost else Cause.SETTINGS_RESTORED]
    assert not rig.keeper.pins_known
    accept_state(rig.path, rig.folder / "captures")
    rig.clock.advance(10)
    rig.keeper.look()
    assert rig.causes() == []
    assert rig.keeper.pins_known


@pytest.mark.parametrize("deleted", [False, True])
def test_damaged_or_deleted_while_it_is_used_it_comes_back_at_once(rig: Rig, deleted: bool) -> None:
    rig.change(60)
    if deleted:
        rig.path.unlink()
    else:
        rig.damage()
    assert rig.store.get("threshold") == 60
    assert rig.causes() == [Cause.SETTINGS_RESTORED]
    assert rig.again == [1], "what is in force is stored again"


def test_damage_deep_in_the_file_fails_one_call_and_no_other(rig: Rig) -> None:
    rig.change(60)
    rig.clock.advance(1)
    with rig.path.open("r+b") as file:
        file.seek(4096)
        file.write(b"\xff" * (rig.path.stat().st_size - 4096))
    with pytest.raises(StorageError, match="recovered") as refused:
        rig.store.get("threshold")
    assert "again" in refused.value.hint
    assert rig.store.get("threshold") == 60


def test_a_full_or_broken_disk_is_no_damage(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    rig.keeper.heal("disk I/O error")
    assert rig.causes() == []
    assert list(rig.folder.glob("*damaged*")) == []


def test_a_state_directory_that_is_gone_is_not_made_anew(rig: Rig) -> None:
    rig.change(60)
    away = rig.folder.rename(rig.folder.with_name("away"))
    rig.folder.mkdir()  # an empty mount point
    with pytest.raises(StorageError, match="is gone"):
        rig.store.get("threshold")
    rig.keeper.look()
    assert rig.causes() == [Cause.SETTINGS_UNREADABLE]
    assert list(rig.folder.iterdir()) == []
    shutil.rmtree(rig.folder)
    away.rename(rig.folder)
    rig.keeper.look()
    assert rig.causes() == []
    assert rig.store.get("threshold") == 60


def test_two_daemons_do_not_share_a_state_directory(rig: Rig) -> None:
    with pytest.raises(StorageError, match="another grabberd"):
        StateKeeper(rig.folder, rig.faults, rig.clock).open()


# --- who is let in ---


@pytest.mark.parametrize("running", [False, True])
def test_lost_tokens_let_nobody_in_and_a_new_one_does(rig: Rig, running: bool) -> None:
    secret = rig.access.add("tablet", Role.ADMIN)
    assert rig.access.needs_token()
    rig.clock.advance(10)
    rig.keeper.look()
    if not running:
        rig.keeper.close()
    rig.damage(backups=True)
    if not running:
        rig.start()
    assert rig.access.needs_token()
    assert rig.access.of_token(secret) is None
    rig.restart()
    assert rig.access.needs_token(), "after a restart as well"
    new = rig.access.add("tablet", Role.ADMIN)
    assert rig.access.of_token(new)


def test_restored_tokens_are_valid_as_they_were(rig: Rig) -> None:
    secret = rig.access.add("tablet", Role.ADMIN)
    rig.clock.advance(10)
    rig.keeper.look()
    rig.damage()
    identity = rig.access.of_token(secret)
    assert identity
    assert identity.role is Role.ADMIN


def test_a_machine_without_tokens_is_served_while_the_state_cannot_be_read(rig: Rig) -> None:
    assert not rig.access.needs_token()
    rig.folder.rename(rig.folder.with_name("away"))
    assert not rig.access.needs_token()
    rig.folder.with_name("away").rename(rig.folder)


def test_one_with_tokens_is_not(rig: Rig) -> None:
    rig.access.add("tablet", Role.ADMIN)
    assert rig.access.needs_token()
    rig.folder.rename(rig.folder.with_name("away"))
    with pytest.raises(StorageError):
        assert rig.access.needs_token()
    rig.folder.with_name("away").rename(rig.folder)
