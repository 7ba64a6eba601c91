"""Once a month all captures are held against their digests, and what the disk has changed is told."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from archive.captures import slots, write
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.catalogue.scrub import KEY, Scrub
from grabberd.archive.state.state_database import StateStore
from grabberd.errors import Cause
from grabberd.fault_board import FaultBoard

BEGIN = datetime(2026, 3, 1, 9, 30, tzinfo=UTC)
MONTH = timedelta(days=31)


class Clock:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.moment = BEGIN

    def utc_now(self) -> datetime:
        return self.moment


class Barn:
    """A folder of two captures, and what scrubs it."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        for name in ("c1", "c2"):
            write(folder, slots(3), name=name, id=name, measured=range(3), fields_a_commit=1)
        self.clock, self.faults, self.recording = Clock(), FaultBoard(), False
        self.store = StateStore(folder / "state.sqlite")
        self.store.open()
        self.archive = Archive(folder, list)
        self.archive.open()
        self.scrub = self.started()

    def started(self) -> Scrub:
        return Scrub(self.archive, self.store, self.faults, self.clock, lambda: self.recording)

    def change(self, capture_id: str) -> None:
        with closing(sqlite3.connect(self.archive.path(capture_id), isolation_level=None)) as connection:
            connection.execute("UPDATE fields SET time_ns = time_ns + 1 WHERE n = 1")


@pytest.fixture
def barn(tmp_path: Path) -> Iterator[Barn]:
    barn = Barn(tmp_path / "captures")
    yield barn
    barn.archive.close()


def test_the_first_round_is_a_month_after_the_first_start(barn: Barn) -> None:
    assert not barn.scrub.look()
    barn.clock.moment += timedelta(days=29)
    assert not barn.scrub.look()
    barn.clock.moment += timedelta(days=2)
    assert barn.scrub.look()
    assert not barn.scrub.look()
    assert barn.faults.now == []


def test_a_capture_that_the_disk_has_changed_is_told_until_it_is_gone(barn: Barn) -> None:
    barn.scrub.look()
    barn.change("c1")
    barn.clock.moment += MONTH
    assert barn.scrub.look()
    (fault,) = barn.faults.now
    assert fault.cause_code is Cause.CAPTURE_CHANGED
    assert "c1: field 1: it is not what was written" in fault.message
    assert "c2" not in fault.message
    barn.archive.remove("c1")
    barn.scrub.look()
    assert barn.faults.now == []


def test_a_capture_that_was_copied_back_is_sound_in_the_next_round(barn: Barn) -> None:
    good = barn.archive.path("c1").read_bytes()
    barn.scrub.look()
    barn.change("c1")
    barn.clock.moment += MONTH
    barn.scrub.look()
    barn.archive.path("c1").write_bytes(good)
    barn.clock.moment += MONTH
    assert barn.scrub.look()
    assert barn.faults.now == []


def test_a_restarted_daemon_tells_of_damage_that_was_found_before(barn: Barn) -> None:
    barn.scrub.look()
    barn.change("c1")
    barn.clock.moment += MONTH
    barn.scrub.look()
    barn.faults = FaultBoard()
    assert not barn.started().look()
    assert barn.faults.has(Cause.CAPTURE_CHANGED)


def test_nothing_is_read_while_a_capture_is_recorded(barn: Barn) -> None:
    barn.scrub.look()
    barn.clock.moment += MONTH
    barn.recording = True
    assert not barn.scrub.look()
    barn.recording = False
    assert barn.scrub.look()


def test_a_clock_that_was_set_back_does_not_put_it_off_for_years(barn: Barn) -> None:
    barn.scrub.look()
    barn.clock.moment -= timedelta(days=3650)
    assert barn.scrub.look()
    assert barn.store.get(KEY)["ended_utc"].startswith("2016")


def test_a_round_that_was_broken_off_is_not_taken_for_one(barn: Barn) -> None:
    barn.scrub.look()
    barn.clock.moment += MONTH
    barn.scrub.stop()
    assert not barn.scrub.look()
    assert barn.started().look()


def test_what_is_whole_of_a_capture_that_was_set_aside_is_saved_and_listed(tmp_path: Path) -> None:
    folder = tmp_path / "captures"
    folder.mkdir()
    whole = write(folder, slots(400, bits=8), name="c3", id="c3", fields_a_commit=25)
    whole.write_bytes(whole.read_bytes()[:-65536])
    barn = Barn.__new__(Barn)
    barn.clock, barn.faults, barn.recording = Clock(), FaultBoard(), True
    barn.store = StateStore(folder / "state.sqlite")
    barn.archive = Archive(folder, list)
    barn.archive.open()
    scrub = barn.started()
    scrub.save_whole()
    assert barn.archive.index.get("c3").state == "damaged", "not while somebody records"
    barn.recording = False
    scrub.save_whole()
    entry = barn.archive.index.get("c3")
    assert (entry.state, entry.verdict, entry.file) == ("sealed", "incomplete", "c3.grab")
    assert (folder / "damaged" / "c3.grab").exists()
    barn.archive.close()
