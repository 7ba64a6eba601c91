"""Starting a capture: what is checked first, what a refusal says, and what a disarmed one leaves."""

from datetime import UTC, datetime
from pathlib import Path

import pytest
from running import PATIENCE_S, patient, running
from several import sealed_all, several

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.schema import create
from grabberd.documents.enums import DeviceState
from grabberd.errors import Conflict, InputError, NotReady, StorageError
from grabberd.instrument.capture import capture_start
from grabberd.instrument.capture.capture_request import CaptureRequest, NewCapture
from grabberd.instrument.capture.capture_start import CaptureStart
from grabberd.instrument.capture.device_captures import CurrentCaptures
from grabberd.instrument.device.worker import NEWEST, Worker
from grabberd.server.daemon.service import Service


def test_a_device_that_does_not_stream_is_refused_with_its_cause_and_hint(tmp_path: Path) -> None:
    service = patient(tmp_path)
    board = service.instrument(None).board
    with pytest.raises(NotReady, match=r"is absent \(not opened yet\)") as unopened:
        service.capture_control.start(None, CaptureRequest())
    assert unopened.value.hint == "wait until its state is ready: GET /api/v1/state"
    board.enter(DeviceState.FAILED, "the grabber is gone", "plug it in")
    with pytest.raises(NotReady, match=r"is failed \(the grabber is gone\)") as gone:
        service.capture_control.start(None, CaptureRequest())
    assert gone.value.hint == "plug it in"
    board.enter(DeviceState.OPENING)
    with pytest.raises(NotReady, match=r"is opening"):
        service.capture_control.start(None, CaptureRequest())


def test_a_ring_cannot_give_more_fields_than_it_has_slots(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        slots = service.instrument(None).pipeline.ring.slots
        with pytest.raises(InputError, match=f"but the ring has {slots} slots"):
            service.capture_control.arm(None, CaptureRequest(pre_trigger_fields=slots + 1))
        service.capture_control.arm(None, CaptureRequest(pre_trigger_fields=slots))


def test_a_capture_that_was_disarmed_meanwhile_is_not_triggered(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        captures = service.instrument(None).captures
        armed = service.capture_control.arm(None, CaptureRequest())
        late = CaptureStart(captures, NewCapture(armed.id, CaptureRequest(), tmp_path / "late.grab.part"))
        service.capture_control.stop(armed.id)
        with pytest.raises(Conflict, match="is not armed"):
            capture_start.trigger([late], CurrentCaptures({captures.name: captures}))
        assert captures.recording is None
        assert not captures.pipeline.thresholds.held


def test_a_disarmed_capture_leaves_no_annotations(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        armed = service.capture_control.arm(None, CaptureRequest())
        service.annotations.annotate(armed.id, note="new liners")
        assert service.archive.document(armed.id).note == "new liners"
        service.capture_control.stop(armed.id)
        assert service.capture_control._annotations.all() == {}


class FrozenClock:
    """A clock that stands still."""

    def now_ns(self) -> int:
        return 0

    def utc_now(self) -> datetime:
        return datetime(2026, 1, 1, 0, 0, 0, 999_500, UTC)


def test_groups_of_the_same_moment_have_ids_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with several(tmp_path, {"left": {}, "right": {"seed": 2}}) as service:
        monkeypatch.setattr(service.capture_control, "_clock", FrozenClock())
        ids = [service.capture_control.arm_group({name: CaptureRequest()}) for name in ("left", "right")]
        assert ids == ["20260101T000000999Z", "20260101T000001000Z"]


FIFTH = 4
"""Number of a capture's fifth field; fields of the stream have greater ones after a while."""


def streaming_beyond(number: int, service: Service) -> Worker:
    """The worker, once numbers of the stream tell its fields from those of a capture."""
    worker = service.instrument("left").worker
    assert worker is not None
    with worker.published:
        assert worker.published.wait_for(
            lambda: worker.live is not None and worker.live.measured.n > number, PATIENCE_S
        )
    return worker


def wait_until_it_publishes_the_fifth_field(worker: Worker) -> None:
    with worker.published:
        assert worker.published.wait_for(
            lambda: any(one.measured.n == FIFTH for one in worker.since(0)), PATIENCE_S
        )


def test_fields_are_measured_while_the_file_is_being_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with several(tmp_path, {"left": {"pace": "real"}}) as service:
        worker = streaming_beyond(NEWEST + FIFTH, service)

        def slow(path: Path, *limits: int | None) -> object:
            wait_until_it_publishes_the_fifth_field(worker)
            return create(path, *limits)

        monkeypatch.setattr("grabberd.archive.capture.schema.create", slow)
        service.capture_control.start("left", CaptureRequest(fields=30))
        (file,) = sealed_all(service).values()
        with CaptureReader(file) as reader:
            assert len(list(reader.points())) == reader.ledger.received


def test_a_start_that_failed_leaves_the_captures_before_and_after_it_as_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with several(tmp_path, {"left": {"pace": "real"}}) as service:
        service.capture_control.start("left", CaptureRequest(fields=20))
        sealed_all(service)
        worker = streaming_beyond(2 * NEWEST, service)

        def full(path: Path, *limits: int | None) -> object:
            wait_until_it_publishes_the_fifth_field(worker)
            raise StorageError("the disk is full", "delete something")

        with monkeypatch.context() as broken:
            broken.setattr("grabberd.archive.capture.schema.create", full)
            with pytest.raises(StorageError):
                service.capture_control.start("left", CaptureRequest(fields=300))
        streaming_beyond(2 * NEWEST, service)
        assert "measuring failed" not in caplog.text  # as of the capture before, whose fields are gone
        service.capture_control.start("left", CaptureRequest(fields=20))
        (file,) = sealed_all(service).values()
        with CaptureReader(file) as reader:
            assert reader.ledger.total == 20
            assert len(list(reader.points())) == reader.ledger.received
