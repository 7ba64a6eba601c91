"""A recording: how seldom it commits, what a late worker gets, and what a failing disk leaves."""

import threading
from itertools import pairwise
from pathlib import Path

import pytest
from recording_rig import PATIENCE_S, Rig, wait_until_written
from slots import PERIOD_NS, damaged, slot, without_signal

from archive.captures import points
from grabberd.archive.export.field_pictures import export_png
from grabberd.archive.export.points_export import export_csv, points_csv
from grabberd.core.chain.measure import MeasuredField
from grabberd.errors import DeviceLost, DeviceRefused, PictureError, StorageError, StreamEnded
from grabberd.instrument.capture.recording import WAIT_S


def test_a_recording_without_a_worker_writes_and_seals(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 5, 100, measured=False)
    rig.recording.start()
    rig.put(*(slot(n) for n in range(5)))
    with rig.sealed() as reader:
        assert reader.ledger.received == 5
        assert reader.runs == []
    assert rig.told == [rig.recording]
    assert rig.recording.complete
    with pytest.raises(LookupError):  # ten seconds of pictures would be kept until the next capture
        rig.recording._backlog.at(4, 0)


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


def recorded(folder: Path) -> Rig:
    """Three recorded fields that the writer has while the worker still measures them."""
    rig = Rig(folder, 3, 10, measured=True)
    rig.put(*(slot(n) for n in range(3)))
    rig.recording.recorder.run()
    return rig


def count_commits(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> threading.Semaphore:
    """Released with every commit but that of the seal."""
    commits, commit = threading.Semaphore(0), rig.recording._commit

    def counted() -> None:
        commit()
        commits.release()

    monkeypatch.setattr(rig.recording, "_commit", counted)
    return commits


def test_it_sleeps_while_the_worker_has_the_last_fields(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = recorded(tmp_path)
    commits = count_commits(rig, monkeypatch)
    rig.recording.start()
    for n in range(3):
        assert not rig.recording.sealed.wait(2 * WAIT_S), "it waits for the worker"
        rig.recording.add(MeasuredField(n, n, (), points(n)))
    rig.recording.measuring_ended()
    with rig.sealed() as reader:
        assert sum(1 for _ in reader.points(1)) == 3
    assert commits.acquire(blocking=False)
    assert not commits.acquire(blocking=False), "without time passing nothing is due but the last"
    assert rig.recording.committed == 3


def test_what_is_due_is_committed_while_it_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = recorded(tmp_path)
    commits = count_commits(rig, monkeypatch)
    rig.recording.start()
    rig.clock.advance(1.0)
    assert commits.acquire(timeout=PATIENCE_S)
    assert rig.recording.committed == 3
    rig.recording.measuring_ended()
    rig.sealed().close()


def test_what_comes_during_a_slow_commit_is_committed_within_a_second(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = recorded(tmp_path)
    begun_s: list[float] = []

    def slow() -> None:
        begun_s.append(round((rig.clock.now_ns() - start_ns) / 1e9, 3))
        rig.clock.advance(0.45)

    monkeypatch.setattr(rig.recording._writer, "commit", slow)
    start_ns = rig.clock.now_ns()
    for _ in range(30):
        rig.recording._write_some()
        rig.clock.advance(0.05)
    assert {round(other - one, 3) for one, other in pairwise(begun_s)} == {0.5}
