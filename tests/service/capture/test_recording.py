"""A capture session: what the worker gets when it is late, and what a failing disk leaves."""

from collections.abc import Callable
from pathlib import Path

import pytest
from slots import PERIOD_NS, ManualClock, damaged, slot, without_signal

from grabberd.acquisition import Ring, Slot
from grabberd.errors import DeviceLost, DeviceRefused, PictureError, StorageError, StreamEnded
from grabberd.processes.measure import MeasuredField
from grabberd.service.capture.backlog import Backlog
from grabberd.service.capture.recorder import Recorder
from grabberd.service.capture.recording import Recording
from grabberd.storage import CaptureMeta, CaptureReader, CaptureWriter, export_csv, export_png, points_csv
from storage.captures import points

PATIENCE_S = 30.0


def meta() -> CaptureMeta:
    device = {"name": "one", "driver": "fake", "options": {}, "stream": {}}
    return CaptureMeta(
        "one", "2026-01-01T00:00:00.000Z", 0, device, {}, {}, {}, "", 1, "field", 50.0, "0", extra={}
    )


class Rig:
    """A session over a ring that the test fills."""

    def __init__(
        self,
        folder: Path,
        fields: int | None,
        capacity: int,
        *,
        measured: bool,
        ends_when_interrupted: bool = False,
        shortage: Callable[[Path], StorageError | None] = lambda _: None,
    ) -> None:
        self.ring = Ring(64)
        self.clock = ManualClock()
        self.told: list[Recording] = []
        backlog: Backlog[Slot] = Backlog(capacity)
        recorder = Recorder(fields, backlog, self.clock, PERIOD_NS)
        writer = CaptureWriter.create(folder / "one.grab.part", meta())
        if measured:
            writer.begin_run(1, "live", "2026-01-01T00:00:00.000Z", "0", {})
        self.session = Recording(
            "one",
            recorder,
            self.ring.reader(),
            writer,
            backlog,
            self.clock,
            measured=measured,
            ends_when_interrupted=ends_when_interrupted,
            shortage=shortage,
            on_sealed=self.told.append,
        )

    def put(self, *slots: Slot) -> None:
        for one in slots:
            self.ring.put(one)
            self.clock.advance(0.02)

    def sealed(self) -> CaptureReader:
        assert self.session.sealed.wait(PATIENCE_S)
        return CaptureReader(self.session.path)


def test_a_session_without_a_worker_writes_and_seals(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 5, 100, measured=False)
    rig.session.start()
    rig.put(*(slot(n) for n in range(5)))
    with rig.sealed() as reader:
        assert reader.ledger.received == 5
        assert reader.runs == []
    assert rig.told == [rig.session]
    assert rig.session.complete


def test_a_worker_that_starts_late_gets_every_good_field_in_order(tmp_path: Path) -> None:
    rig = Rig(tmp_path, None, capacity=8, measured=True)
    rig.session.start()
    good = []
    for n in range(0, 60, 3):
        rig.put(slot(n), damaged(n + 1), without_signal(n + 2))
        good.append(n)
        wait_until_written(rig, n + 3)
    rig.session.stop("stopped by the operator")
    assert rig.session.deepest_backlog <= 8
    with pytest.raises(LookupError):
        rig.session._backlog.at(0, 0)
    assert [numbered.n for numbered in rig.session.recorded()] == good
    rig.session.measuring_ended()
    rig.sealed().close()


def wait_until_written(rig: Rig, count: int) -> None:
    """The writer has taken what there is: time passes, so that it commits."""
    backlog = rig.session._backlog
    with backlog._changed:
        for _ in range(round(PATIENCE_S / 0.05)):
            rig.clock.advance(1.0)  # each time anew: it may have committed only a part
            if backlog._changed.wait_for(lambda: backlog._written >= count, 0.05):
                return
    raise AssertionError(f"only {backlog._written} of {count} are written")


def test_it_is_not_sealed_before_the_last_field_is_measured(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 3, 100, measured=True)
    rig.session.start()
    rig.put(*(slot(n) for n in range(3)))
    fields = list(rig.session.recorded())
    assert len(fields) == 3
    assert not rig.session.sealed.is_set()
    rig.session.measuring_ended()
    with rig.sealed() as reader:
        assert [run.state for run in reader.runs] == ["done"]


def test_a_worker_that_fails_leaves_the_fields_and_says_so(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 3, 100, measured=True)
    rig.session.start()
    rig.put(*(slot(n) for n in range(3)))
    rig.session.measuring_ended("the program failed")
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
        rig.session.start()
        rig.put(slot(0), slot(1))
        rig.session.source_ended(error)
        with rig.sealed() as reader:
            assert reader.meta.complete is whole
            assert reader.meta.ended_because == error.message
            assert reader.ledger.received == 2


def test_an_interruption_ends_a_capture_that_wants_it_so_in_words(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 100, 100, measured=False, ends_when_interrupted=True)
    rig.session.start()
    rig.put(slot(0), slot(1))
    rig.session.interrupted(DeviceLost("the grabber is gone", "plug it in"))
    with rig.sealed() as reader:
        assert reader.meta.complete is False
        assert reader.meta.ended_because == "interrupted: the grabber is gone"
        assert reader.ledger.received == 2


def test_an_interruption_does_not_end_another_capture(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 4, 100, measured=False)
    rig.session.start()
    rig.put(slot(0))
    rig.session.interrupted(DeviceLost("the grabber is gone", "plug it in"))
    rig.put(slot(3, lost_before=2, reason="unplugged"))
    with rig.sealed() as reader:
        assert reader.meta.ended_because == "length reached"
        assert reader.meta.complete is False
        assert [entry.reason for entry in reader.ledger.entries] == ["unplugged"]


def test_a_capture_is_exported_while_it_goes_on_and_loses_nothing(tmp_path: Path) -> None:
    rig = Rig(tmp_path, None, 100, measured=True)
    rig.session.start()
    for n in range(60):  # before the fields, so that they are written no later
        rig.session.add(MeasuredField(n, n * PERIOD_NS, (), points(n)))
    rig.put(*(slot(n) for n in range(60)))
    wait_until_written(rig, 60)
    path = rig.session.path
    assert path.name == "one.grab.part"
    assert export_png(path, tmp_path / "png") == 60
    assert export_csv(path, tmp_path / "csv") > 0
    text = points_csv(path)
    assert next(text).startswith("n,")
    rig.put(*(slot(n) for n in range(60, 90)))
    assert sum(1 for _ in text) > 0
    rig.session.stop("stopped by the operator")
    rig.session.measuring_ended()
    with rig.sealed() as reader:
        assert reader.meta.complete
        assert reader.ledger.received == 90


def test_other_pictures_end_every_capture(tmp_path: Path) -> None:
    rig = Rig(tmp_path, None, 100, measured=False)
    rig.session.start()
    rig.put(slot(0))
    rig.session.source_ended(DeviceRefused("the grabber grants other pictures", "begin a new capture"))
    with rig.sealed() as reader:
        assert reader.meta.complete is False
        assert reader.meta.ended_because == "the grabber grants other pictures"


def test_a_disk_that_fails_ends_the_recording_and_frees_the_worker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = Rig(tmp_path, None, 100, measured=True)

    def fail(*_: object) -> None:
        raise StorageError("the disk is full", "make room")

    monkeypatch.setattr(rig.session._writer, "append", fail)
    rig.session.start()
    rig.put(slot(0))
    results: list[MeasuredField] = []
    for numbered in rig.session.recorded():
        results.append(MeasuredField(numbered.n, numbered.time_ns, None, None))  # type: ignore[arg-type]
    with rig.sealed() as reader:
        assert reader.meta.ended_because == "the disk is full"
        assert reader.meta.complete is False
        assert [(run.state, run.reason) for run in reader.runs] == [
            ("failed", "writing ended early: the disk is full")
        ]
    assert not rig.session.recorder.recording
