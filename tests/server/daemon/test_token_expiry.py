"""Tokens for some days, and the key of the machine, without HTTP."""

import stat
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from grabberd.archive.access import AS_THE_DAEMON, Access, MachineKey, readable_key
from grabberd.documents.enums import Role
from grabberd.errors import AccessExpired, Conflict

WEEK = timedelta(days=7)


class Wall:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.utc = datetime(2026, 1, 1, tzinfo=UTC)

    def now_ns(self) -> int:
        return 0

    def utc_now(self) -> datetime:
        return self.utc


@pytest.fixture
def wall() -> Wall:
    return Wall()


@pytest.fixture
def access(tmp_path: Path, wall: Wall) -> Access:
    access = Access(tmp_path, wall)
    access.open()
    return access


# --- expiry ---


def test_a_token_is_good_until_its_day_and_says_why_it_is_not_then(access: Access, wall: Wall) -> None:
    secret = access.add("visitor", Role.VIEWER, WEEK)
    wall.utc += WEEK - timedelta(milliseconds=1)
    identity = access.of_token(secret)
    assert identity is not None
    assert identity.expires_utc == "2026-01-08T00:00:00.000Z"
    wall.utc += timedelta(milliseconds=1)
    with pytest.raises(AccessExpired, match=r"visitor.*2026-01-08"):
        access.of_token(secret)


def test_its_sessions_end_with_it(access: Access, wall: Wall) -> None:
    identity = access.of_token(access.add("visitor", Role.VIEWER, WEEK))
    assert identity is not None
    session = access.open_session(identity)
    wall.utc += WEEK - timedelta(milliseconds=1)
    assert access.of_session(session) is not None
    assert access.list()[0].sessions == 1
    wall.utc += timedelta(milliseconds=1)
    assert access.of_session(session) is None
    assert access.list()[0].sessions == 0


def test_without_a_day_it_is_good_for_ever(access: Access, wall: Wall) -> None:
    secret = access.add("tablet", Role.OPERATOR)
    wall.utc += timedelta(days=10_000)
    assert access.of_token(secret) is not None


def test_when_the_last_one_has_expired_the_door_does_not_stand_open(access: Access, wall: Wall) -> None:
    access.add("visitor", Role.VIEWER, WEEK)
    wall.utc += 2 * WEEK
    assert access.needs_token()


# --- the key of the machine ---


def test_who_can_read_the_daemons_files_is_an_admin(access: Access) -> None:
    access.key.make()
    secret = access.key.path.read_text().strip()
    identity = access.of_token(secret)
    assert identity == AS_THE_DAEMON
    assert identity.role is Role.ADMIN
    assert not access.needs_token()
    with pytest.raises(Conflict):
        access.open_session(identity)


def test_nobody_else_can_read_it(access: Access) -> None:
    access.key.make()
    assert stat.S_IMODE(access.key.path.stat().st_mode) == 0o600


def test_it_is_another_one_at_every_start_and_none_after_the_end(access: Access, tmp_path: Path) -> None:
    access.key.make()
    old = access.key.path.read_text().strip()
    access.key.make()
    assert access.of_token(old) is None
    assert readable_key(tmp_path) == access.key.path
    new = access.key.path.read_text().strip()
    access.key.remove()
    access.key.remove()
    assert access.of_token(new) is None
    assert readable_key(tmp_path) is None


def test_a_program_that_did_not_make_it_does_not_take_it_away(access: Access, tmp_path: Path) -> None:
    access.key.make()
    MachineKey(tmp_path).remove()
    assert readable_key(tmp_path) == access.key.path


def test_a_folder_that_cannot_be_written_has_none_and_that_is_no_error(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    key = MachineKey(tmp_path / "nowhere")
    key.make()
    assert "cannot be written" in caplog.text
    assert not key.fits("")
