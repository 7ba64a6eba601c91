"""The index is rebuilt while the daemon runs; who asks meanwhile waits a moment or is told to ask again."""

import logging
import threading
from pathlib import Path

import pytest
from slots import ManualClock

from archive.captures import slots, write
from grabberd.archive.state.capture_index import PAUSE_S, CaptureIndex, IndexKeeper, Unusable
from grabberd.errors import Cause, IndexRebuilding, StorageError
from grabberd.fault_board import FaultBoard

PATIENCE_S = 30.0
DAMAGED = Unusable("file is not a database")


class SlowIndex(CaptureIndex):
    """Is rebuilt when the test lets it."""

    def __init__(self, directory: Path) -> None:
        super().__init__(directory)
        self.go_on = threading.Event()
        self.failure: StorageError | None = None
        self.attempts = 0

    def rebuild(self, unsealed: object = (), *, anew: bool = False) -> None:
        self.attempts += 1
        self.read = (3, 12)
        assert self.go_on.wait(PATIENCE_S)
        if self.failure is not None:
            raise self.failure
        super().rebuild(anew=anew)


class Rig:
    def __init__(self, folder: Path) -> None:
        self.clock = ManualClock(0)
        self.faults = FaultBoard(self.clock)
        self.index = SlowIndex(folder)
        self.keeper = IndexKeeper(self.index, list, self.faults, lambda: self.clock.ns / 1e9)

    def causes(self) -> list[Cause]:
        return [fault.cause_code for fault in self.faults.now]


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    write(tmp_path, slots(2), name="c1", id="c1")
    return Rig(tmp_path)


def test_who_asks_when_it_takes_longer_is_told_how_far_it_is_and_to_ask_again(rig: Rig) -> None:
    for _ in range(3):
        with pytest.raises(IndexRebuilding, match="3 of 12") as told:
            rig.keeper.heal(DAMAGED, patience_s=0)
        assert "again" in told.value.hint
        assert rig.causes() == [Cause.INDEX_REBUILDING]
    rig.index.go_on.set()
    rig.keeper.heal(DAMAGED, PATIENCE_S)
    assert rig.index.attempts == 1
    assert rig.causes() == []
    assert rig.keeper.rebuilt == 1
    assert [entry.id for entry in rig.index.list()] == ["c1"]


def test_who_asks_when_it_takes_a_moment_waits_for_it(rig: Rig) -> None:
    rig.index.go_on.set()
    rig.keeper.heal(DAMAGED, PATIENCE_S)
    assert [entry.id for entry in rig.index.list()] == ["c1"]


def test_the_log_has_a_line_when_it_begins_and_one_when_it_is_done(
    rig: Rig, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    for _ in range(100):
        with pytest.raises(IndexRebuilding):
            rig.keeper.heal(DAMAGED, patience_s=0)
    rig.index.go_on.set()
    rig.keeper.heal(DAMAGED, PATIENCE_S)
    lines = [record for record in caplog.records if record.name.startswith("grabberd")]
    assert [line.levelname for line in lines] == ["WARNING", "INFO"]


def test_where_it_fails_it_is_a_fault_and_tried_again_after_a_pause(rig: Rig) -> None:
    rig.index.failure = StorageError("the disk is full", "make room")
    rig.index.go_on.set()
    for _ in range(5):
        with pytest.raises(StorageError, match="the disk is full") as told:
            rig.keeper.heal(DAMAGED, PATIENCE_S)
        assert told.value.cause is Cause.INDEX_FAILED
    assert rig.index.attempts == 1
    assert rig.causes() == [Cause.INDEX_FAILED]
    rig.index.failure = None
    rig.clock.advance(PAUSE_S)
    rig.keeper.heal(DAMAGED, PATIENCE_S)
    assert rig.causes() == []
    assert rig.faults.counts[Cause.INDEX_FAILED] == 1
