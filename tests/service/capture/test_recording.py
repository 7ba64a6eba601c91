"""A recording: what the worker gets when it is late, and what a failing disk leaves."""

from pathlib import Path

import pytest
from recording_rig import Rig, wait_until_written
from slots import PERIOD_NS, damaged, slot, without_signal

from grabberd.errors import DeviceLost, DeviceRefused, PictureError, StorageError, StreamEnded
from grabberd.processes.measure import MeasuredField
from grabberd.storage import export_csv, export_png, points_csv
from storage.captures import points


def test_a_recording_without_a_worker_writes_and_seals(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 5, 100, measured=False)
    rig.recording.start()
    rig.put(*(slot(n) for n in range(5)))
    with rig.sealed() as reader:
        assert reader.ledger.received == 5
        assert reader.runs == []
    assert rig.told == [rig.recording]
    assert rig.recording.complete


def test_a_worker_that_starts_late_gets_every_good_field_in_order(tmp_path: Path) -> None:
    rig = Rig(tmp_path, None, capacity=8, measured=True)
    rig.recording.start()
    good = []
    for n in range(0, 60, 3):
        rig.put(slot(n), damaged(n + 1), without_signal(n + 2))
        good.append(n)
        wait_until_written(rig, n + 3)
    rig.recording.stop("stopped by the operator")
    assert rig.recording.recorder.backlog.deepest <= 8
    with pytest.raises(LookupError):
        rig.recording._backlog.at(0, 0)
    assert [numbered.n for numbered in rig.recording.recorded()] == good
    rig.recording.measuring_ended()
    rig.sealed().close()


def test_it_is_not_sealed_before_the_last_field_is_measured(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 3, 100, measured=True)
    rig.recording.start()
    rig.put(*(slot(n) for n in range(3)))
    fields = list(rig.recording.recorded())
    assert len(fields) == 3
    assert not rig.recording.sealed.is_set()
    rig.recording.measuring_ended()
    with rig.sealed() as reader:
        assert [run.state for run in reader.runs] == ["done"]


def test_a_worker_that_fails_leaves_the_fields_and_says_so(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 3, 100, measured=True)
    rig.recording.start()
    rig.put(*(slot(n) for n in range(3)))
    rig.recording.measuring_ended("the program failed")
    with rig.sealed() as reader:
        assert reader.ledger.complete
        assert [(run.state, run.reason) for run in reader.runs] == [("failed", "the program failed")]


def test_a_recording_that_ends_is_whole_and_one_that_cannot_be_read_is_cut_short(tmp_path: Path) -> None:
    for error, whole in (
        (StreamEnded("no further picture", ""), True),
        (PictureError("b.png is cut", ""), False),
    ):
        place = tmp_path / type(error).__name__
        place.mkdir()
        rig = Rig(place, None, 100, measured=False)
        rig.recording.start()
        rig.put(slot(0), slot(1))
        rig.recording.source_ended(error)
        with rig.sealed() as reader:
            assert reader.meta.complete is whole
            assert reader.meta.ended_because == error.message
            assert reader.ledger.received == 2


def test_an_interruption_ends_a_capture_that_wants_it_so_in_words(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 100, 100, measured=False, ends_when_interrupted=True)
    rig.recording.start()
    rig.put(slot(0), slot(1))
    rig.recording.interrupted(DeviceLost("the grabber is gone", "plug it in"))
    with rig.sealed() as reader:
        assert reader.meta.complete is False
        assert reader.meta.ended_because == "interrupted: the grabber is gone"
        assert reader.ledger.received == 2


def test_an_interruption_does_not_end_another_capture(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 4, 100, measured=False)
    rig.recording.start()
    rig.put(slot(0))
    rig.recording.interrupted(DeviceLost("the grabber is gone", "plug it in"))
    rig.put(slot(3, lost_before=2, reason="unplugged"))
    with rig.sealed() as reader:
        assert reader.meta.ended_because == "length reached"
        assert reader.meta.complete is False
        assert [entry.reason for entry in reader.ledger.entries] == ["unplugged"]


def test_a_capture_is_exported_while_it_goes_on_and_loses_nothing(tmp_path: Path) -> None:
    rig = Rig(tmp_path, None, 100, measured=True)
    rig.recording.start()
    for n in range(60):  # before the fields, so that they are written no later
        rig.recording.add(MeasuredField(n, n * PERIOD_NS, (), points(n)))
    rig.put(*(slot(n) for n in range(60)))
    wait_until_written(rig, 60)
    path = rig.recording.path
    assert path.name == "one.grab.part"
    assert export_png(path, tmp_path / "png") == 60
    assert export_csv(path, tmp_path / "csv") > 0
    text = points_csv(path)
    assert next(text).startswith("n,")
    rig.put(*(slot(n) for n in range(60, 90)))
    assert sum(1 for _ in text) > 0
    rig.recording.stop("stopped by the operator")
    rig.recording.measuring_ended()
    with rig.sealed() as reader:
        assert reader.meta.complete
        assert reader.ledger.received == 90


def test_other_pictures_end_every_capture(tmp_path: Path) -> None:
    rig = Rig(tmp_path, None, 100, measured=False)
    rig.recording.start()
    rig.put(slot(0))
    rig.recording.source_ended(DeviceRefused("the grabber grants other pictures", "begin a new capture"))
    with rig.sealed() as reader:
        assert reader.meta.complete is False
        assert reader.meta.ended_because == "the grabber grants other pictures"


def test_a_disk_that_fails_ends_the_recording_and_frees_the_worker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = Rig(tmp_path, None, 100, measured=True)

    def fail(*_: object) -> None:
        raise StorageError("the disk is full", "make room")

    monkeypatch.setattr(rig.recording._writer, "append", fail)
    rig.recording.start()
    rig.put(slot(0))
    results: list[MeasuredField] = []
    for numbered in rig.recording.recorded():
        results.append(MeasuredField(numbered.n, numbered.time_ns, None, None))  # type: ignore[arg-type]
    with rig.sealed() as reader:
        assert reader.meta.ended_because == "the disk is full"
        assert reader.meta.complete is False
        assert [(run.state, run.reason) for run in reader.runs] == [
            ("failed", "writing ended early: the disk is full")
        ]
    assert not rig.recording.recorder.recording
