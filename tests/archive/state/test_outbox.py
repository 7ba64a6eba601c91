"""Summaries that wait until they are acknowledged."""

from pathlib import Path

import pytest

from grabberd.archive.state.state_database import Outbox


@pytest.fixture
def outbox(tmp_path: Path) -> Outbox:
    one = Outbox(tmp_path / "state.sqlite")
    one.open()
    return one


def test_the_oldest_comes_first_until_it_is_acknowledged(outbox: Outbox) -> None:
    for name in ("b", "a"):
        outbox.enter(name, {"id": name})
    assert outbox.first() == outbox.first() == ("a", {"id": "a"})
    outbox.acknowledge("a")
    assert (outbox.first(), outbox.waiting()) == (("b", {"id": "b"}), 1)


def test_what_waits_is_there_after_a_restart(outbox: Outbox, tmp_path: Path) -> None:
    outbox.enter("a", {"words": "Å"})
    again = Outbox(tmp_path / "state.sqlite")
    again.open()
    assert again.first() == ("a", {"words": "Å"})


def test_what_was_acknowledged_is_not_entered_again(outbox: Outbox) -> None:
    outbox.enter("a", {})
    outbox.acknowledge("a")
    outbox.enter("a", {})
    assert (outbox.first(), outbox.waiting(), outbox.entered()) == (None, 0, {"a"})


def test_captures_that_are_gone_are_forgotten_unless_they_wait(outbox: Outbox) -> None:
    for name in ("waits", "told"):
        outbox.enter(name, {})
    outbox.acknowledge("told")
    outbox.forget(["waits", "told", "never"])
    assert outbox.entered() == {"waits"}
