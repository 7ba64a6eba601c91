"""The running instrument on the simulated grabber: which captures it takes, and what becomes of them."""

import sqlite3
from pathlib import Path
from threading import Event

import pytest
from capturing import capture
from running import PATIENCE_S, configuration, running, sealed

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.schema import create
from grabberd.config import default_config_file
from grabberd.errors import CaptureRunning, Conflict, NotFound
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.instrument.capture.recording import Recording
from grabberd.instrument.setup import set_up
from grabberd.server.daemon.service import Service


def test_a_file_whose_ledger_contradicts_itself_is_shown_as_damaged_beside_the_others(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        bad, good = capture(service, fields=10), capture(service, fields=5)
        connection = sqlite3.connect(bad)
        connection.execute("INSERT INTO ledger VALUES (3, 4, 'lost', 'twice')")
        connection.commit()
        connection.close()
        states = {document.id: document.state for document in service.archive.documents()}
        assert states == {bad.stem: "damaged", good.stem: "sealed"}


def test_a_second_start_is_refused_with_the_id_of_the_running_one(tmp_path: Path) -> None:
    with running(tmp_path, {"pace": "real"}) as service:
        capture_id = service.capture_control.start(None, CaptureRequest()).id
        with pytest.raises(CaptureRunning) as refused:
            service.capture_control.start(None, CaptureRequest())
        assert refused.value.capture_id == capture_id
        service.capture_control.stop(capture_id)
        sealed(service)
        with pytest.raises(Conflict):
            service.capture_control.stop(capture_id)


def test_the_state_says_while_a_capture_that_is_over_keeps_the_next_one_from_starting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measured, seal = Event(), Recording._seal
    monkeypatch.setattr(Recording, "_seal", lambda one: (measured.wait(PATIENCE_S), seal(one)))
    with running(tmp_path) as service:
        device, recording = service.instrument(None), started(service, fields=5)
        while device.captures.running:
            recording.sealed.wait(0.005)
        said = service.state().devices["simulated"]
        assert (said.capture_id, said.sealing_capture_id) == (None, recording.id)
        with pytest.raises(CaptureRunning):
            started(service, fields=5)
        measured.set()
        sealed(service)
        assert service.state().devices["simulated"].sealing_capture_id is None
        started(service, fields=5)


def started(service: Service, **request: int) -> Recording:
    """A capture that was just started."""
    service.capture_control.start(None, CaptureRequest(**request))
    recording = service.instrument(None).captures.recording
    assert recording is not None
    return recording


def test_without_a_compiled_kernel_the_daemon_says_at_its_start_what_is_slower(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("grabberd.core.kernel.KERNEL", None)
    with running(tmp_path):
        assert "there is no compiled kernel" in caplog.text
        assert "python3-dev" in caplog.text


def test_several_devices_do_not_know_of_one_another(tmp_path: Path) -> None:
    config = configuration({"pace": "free"})
    one = config.devices["simulated"]
    broken = one.model_copy(
        update={"options": {"faults": [{"kind": "unplug", "at_s": 0, "back_after_s": 1e6}]}}
    )
    two = config.model_copy(update={"devices": {"good": one, "broken": broken}})
    service = Service(set_up(two, default_config_file()), tmp_path)
    service.start()
    try:
        board = service.instrument("good").board
        with board.changed:
            assert board.changed.wait_for(lambda: service.instrument("good").captures.accepts, PATIENCE_S)
        with pytest.raises(NotFound):
            service.instrument(None)
        service.capture_control.start("good", CaptureRequest(fields=10))
        recording = service.instrument("good").captures.recording
        assert recording
        assert recording.sealed.wait(PATIENCE_S)
        assert recording.complete
    finally:
        service.stop()


def test_a_capture_that_is_renamed_while_it_is_looked_at_is_shown_with_its_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with running(tmp_path) as service:
        path = capture(service, fields=5)
        recording = service.instrument(None).captures.recording
        assert recording
        monkeypatch.setattr(service.archive, "_recordings", lambda: [recording])
        assert service.archive.document(recording.id).state == "sealed"
        monkeypatch.setattr(recording._writer, "path", path.with_name(f"{path.name}.part"))
        assert service.archive.document(recording.id).size_bytes == path.stat().st_size


def test_stopping_the_service_seals_a_running_capture(tmp_path: Path) -> None:
    with running(tmp_path, {"pace": "real"}) as service:
        capture_id = service.capture_control.start(None, CaptureRequest()).id
        reader = service.instrument(None).pipeline.ring.reader()
        assert reader.take(PATIENCE_S)
    path = service.archive.path(capture_id)
    with CaptureReader(path) as file:
        assert file.meta.state == "sealed"
        assert file.meta.ended_because == "the daemon stopped"


def test_a_full_disk_ends_the_capture_and_what_is_on_it_can_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "grabberd.archive.capture.schema.create", lambda path, *_: create(path, max_pages=600)
    )
    with running(tmp_path, {"pace": "real"}) as service:
        path = capture(service)
        recording = service.instrument(None).captures.recording
        assert recording
        assert recording.failure is not None
        assert "full" in recording.failure.message
        with CaptureReader(path) as reader:
            assert reader.meta.complete is False
            assert reader.meta.ended_because is not None
            assert "full" in reader.meta.ended_because
            assert reader.field_count > 10
        monkeypatch.undo()
        assert capture(service, fields=5).exists(), "the daemon lives"


def test_what_a_crash_left_is_sealed_at_the_next_start(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        whole = capture(service, fields=20)
    part = whole.with_name(whole.name + ".part")
    whole.rename(part)
    with running(tmp_path) as service:
        assert service.archive.document(whole.stem).state == "sealed"
        assert not part.exists()
