"""What the broker retains for others is removed when it is no longer wanted."""

from pathlib import Path

import pytest

from grabberd.archive.state.state_database import StateStore
from grabberd_mqtt.home_assistant import Announcements
from grabberd_mqtt.messages import Message

NORTH, SOUTH = (Message(f"homeassistant/sensor/{name}/config", {"name": name}, True) for name in ("n", "s"))


@pytest.fixture
def store(tmp_path: Path) -> StateStore:
    made = StateStore(tmp_path / "state.sqlite")
    made.open()
    return made


def removed(*messages: Message) -> list[Message]:
    return [message._replace(content=None) for message in messages]


def test_what_is_wanted_is_told_at_every_connection(store: StateStore) -> None:
    wanted = Announcements(store, [NORTH, SOUTH])
    assert list(wanted.due()) == list(wanted.due()) == [NORTH, SOUTH]
    assert wanted.any


def test_what_never_was_is_not_removed(store: StateStore) -> None:
    assert not list(Announcements(store, []).due())
    assert not Announcements(store, []).any


def test_what_is_no_longer_wanted_is_removed_once(store: StateStore) -> None:
    list(Announcements(store, [NORTH, SOUTH], ["grabberd/n/capture"]).due())
    assert list(Announcements(store, [SOUTH]).due()) == [
        SOUTH,
        *removed(NORTH),
        Message("grabberd/n/capture", None, True),  # after what leads to it
    ]
    assert list(Announcements(store, []).due()) == removed(SOUTH)
    assert not list(Announcements(store, []).due())


def test_what_the_broker_did_not_take_is_removed_the_next_time(store: StateStore) -> None:
    list(Announcements(store, [NORTH, SOUTH]).due())
    broken = Announcements(store, []).due()
    next(broken)  # published, but never acknowledged
    assert list(Announcements(store, []).due()) == removed(NORTH, SOUTH)


def test_what_was_told_before_a_crash_can_be_removed(store: StateStore) -> None:
    next(Announcements(store, [NORTH, SOUTH]).due())
    assert list(Announcements(store, []).due()) == removed(NORTH, SOUTH)
