"""Which captures have still to be told of."""

import logging
from pathlib import Path

import pytest

from archive.captures import slots, write
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.state.state_database import Outbox
from grabberd_mqtt.publisher import SummaryQueue


class Barn:
    """Captures, and what is to be said of them."""

    def __init__(self, folder: Path, limit: int = 100) -> None:
        self.captures = folder / "captures"
        self.captures.mkdir(exist_ok=True)
        self.archive = Archive(self.captures, list)
        self.archive.index.rebuild()
        self.summaries = SummaryQueue(self.archive, Outbox(folder / "state.sqlite"), limit)
        self.summaries.open()

    def add(self, *names: str) -> None:
        for name in names:
            self.archive.index.add(write(self.captures, slots(3), name=name, id=name, site={"barn": "Ås"}))

    def taken(self) -> list[str]:
        """All that wait, one after the other."""
        found = []
        while (first := self.summaries.first()) is not None:
            found.append(first[0])
            self.summaries.acknowledge(first[0])
        return found


def test_a_capture_is_summed_up_once(tmp_path: Path) -> None:
    barn = Barn(tmp_path)
    barn.add("b", "a")
    barn.summaries.collect()
    barn.summaries.collect()
    assert barn.summaries.waiting == 2
    assert barn.taken() == ["a", "b"]
    barn.summaries.collect()
    assert (barn.taken(), barn.summaries.waiting, barn.summaries.acknowledged) == ([], 0, 2)


def test_captures_that_ended_while_nobody_looked_are_found(tmp_path: Path) -> None:
    barn = Barn(tmp_path)
    barn.add("a")
    barn.summaries.collect()
    barn.add("b")
    again = Barn(tmp_path)
    assert again.summaries.waiting == 1
    again.summaries.collect()
    assert again.taken() == ["a", "b"]


def test_a_summary_outlives_its_capture(tmp_path: Path) -> None:
    barn = Barn(tmp_path)
    barn.add("a")
    barn.summaries.collect()
    barn.archive.remove("a")
    barn.summaries.collect()
    first = barn.summaries.first()
    assert first is not None
    assert (first[1]["capture_id"], first[1]["site"]) == ("a", {"barn": "Ås"})


def test_a_full_outbox_takes_the_others_when_there_is_room(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    barn = Barn(tmp_path, limit=2)
    barn.add("a", "b", "c", "d")
    barn.summaries.collect()
    assert (barn.summaries.waiting, barn.summaries.remaining) == (2, {"c", "d"})
    assert "no more are kept" in caplog.text
    assert barn.taken() == ["a", "b"]
    barn.summaries.collect()
    assert (barn.taken(), barn.summaries.remaining, barn.summaries.missed) == (["c", "d"], frozenset(), 0)


def test_a_full_outbox_is_logged_once_each_time_it_fills(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    barn = Barn(tmp_path, limit=2)
    barn.add("a", "b")
    barn.summaries.collect()
    assert not barn.summaries.has_room
    assert caplog.text == "", "all of them are kept"
    barn.add("c")
    barn.summaries.collect()
    barn.summaries.collect()
    assert caplog.text.count("no more are kept") == 1
    barn.taken()
    assert barn.summaries.has_room
    barn.summaries.collect()
    barn.add("d", "e")
    barn.summaries.collect()
    assert caplog.text.count("no more are kept") == 2


def test_of_a_large_archive_some_are_entered_at_a_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("grabberd_mqtt.publisher.AT_ONCE", 2)
    barn = Barn(tmp_path)
    barn.add("a", "b", "c")
    barn.summaries.collect()
    assert (barn.summaries.waiting, barn.summaries.remaining, barn.summaries.has_room) == (2, {"c"}, True)
    barn.summaries.collect()
    assert (barn.summaries.waiting, barn.summaries.remaining, caplog.text) == (3, frozenset(), "")


def test_a_capture_that_is_deleted_before_there_is_room_is_named_and_counted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    barn = Barn(tmp_path, limit=1)
    barn.add("a", "b", "c")
    barn.summaries.collect()
    barn.archive.remove("b")
    with caplog.at_level(logging.ERROR):
        barn.summaries.collect()
    assert barn.summaries.missed == 1
    assert "capture b was deleted" in caplog.text


def test_a_damaged_capture_is_told_as_such(tmp_path: Path) -> None:
    barn = Barn(tmp_path)
    barn.add("a")
    (barn.captures / "a.grab").write_bytes(b"no capture any more")
    barn.summaries.collect()
    first = barn.summaries.first()
    assert first is not None
    assert (first[1]["state"], first[1]["verdict"], first[1]["calibration_id"]) == (
        "damaged",
        "incomplete",
        None,
    )
    assert first[1]["site"] == {}


def test_a_file_that_was_removed_by_hand_is_missed_once(tmp_path: Path) -> None:
    barn = Barn(tmp_path)
    barn.add("a", "b")
    (barn.captures / "a.grab").unlink()
    barn.summaries.collect()
    barn.summaries.collect()
    assert (barn.taken(), barn.summaries.missed) == (["b"], 1)
