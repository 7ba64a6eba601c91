"""Who may, without HTTP."""

from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path

import pytest

from grabberd.archive.access import AT_THE_MACHINE, SESSION_LIFE, Access, Identity
from grabberd.documents.enums import Role
from grabberd.errors import Conflict, InputError, NotFound


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


def test_each_role_may_what_those_before_it_may() -> None:
    for lower, higher in pairwise(Role):
        assert Identity(higher, "token").covers(lower)
        assert Identity(higher, "token").covers(higher)
        assert not Identity(lower, "token").covers(higher)


def test_a_session_lasts_a_month(access: Access, wall: Wall) -> None:
    tablet = access.of_token(access.add("tablet", Role.OPERATOR))
    assert tablet
    session = access.open_session(tablet)
    assert timedelta(days=30) == SESSION_LIFE
    wall.utc += SESSION_LIFE - timedelta(seconds=1)
    assert access.of_session(session) == Identity(Role.OPERATOR, "session", "tablet")
    wall.utc += timedelta(seconds=1)
    assert access.of_session(session) is None


def test_a_token_is_no_session_and_a_session_no_token(access: Access) -> None:
    secret = access.add("tablet", Role.OPERATOR)
    tablet = access.of_token(secret)
    assert tablet
    assert access.of_session(secret) is None
    assert access.of_token(access.open_session(tablet)) is None


def test_only_a_living_token_is_traded(access: Access) -> None:
    tablet = access.of_token(access.add("tablet", Role.OPERATOR))
    assert tablet
    for other in (AT_THE_MACHINE, Identity(Role.ADMIN, "session", "tablet")):
        with pytest.raises(Conflict):
            access.open_session(other)
    access.remove("tablet")
    with pytest.raises(NotFound):
        access.open_session(tablet)


@pytest.mark.parametrize("secret", ["", "grabberd_", "\ud800", "x" * 100_000, "' OR 1=1 --"])
def test_what_is_no_secret_is_nobodys(access: Access, secret: str) -> None:
    access.add("tablet", Role.ADMIN)
    assert access.of_token(secret) is None
    assert access.of_session(secret) is None


@pytest.mark.parametrize("name", ["", "-barn", ".barn", "a b", "Ås", "barn\n", "x" * 65])
def test_an_invalid_name_is_refused_and_gives_no_token(access: Access, name: str) -> None:
    with pytest.raises(InputError, match="not a valid token name"):
        access.add(name, Role.VIEWER)
    assert not access.needs_token()


@pytest.mark.parametrize("name", ["x", "7", "x" * 64, "Barn-2.left_side"])
def test_a_name_has_up_to_64_letters_digits_and_signs(access: Access, name: str) -> None:
    identity = access.of_token(access.add(name, Role.VIEWER))
    assert identity == Identity(Role.VIEWER, "token", name)


def test_a_name_is_given_once(access: Access) -> None:
    secret = access.add("tablet", Role.OPERATOR)
    with pytest.raises(Conflict):
        access.add("tablet", Role.ADMIN)
    assert access.of_token(secret) == Identity(Role.OPERATOR, "token", "tablet")


def test_a_session_is_closed_alone_and_its_token_stays(access: Access) -> None:
    secret = access.add("tablet", Role.OPERATOR)
    tablet = access.of_token(secret)
    assert tablet
    closed, other = access.open_session(tablet), access.open_session(tablet)
    access.close_session(closed)
    access.close_session(closed)
    assert access.of_session(closed) is None
    assert access.of_session(other) is not None
    assert access.of_token(secret) == tablet


def test_a_secret_is_256_random_bits(access: Access) -> None:
    secrets = {access.add(f"token-{n}", Role.VIEWER) for n in range(3)}
    assert len(secrets) == 3
    assert all(len(secret) == len("grabberd_") + 43 for secret in secrets)
