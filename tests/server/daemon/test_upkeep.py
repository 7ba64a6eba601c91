"""The running instrument heals what breaks round it, and records meanwhile."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from capturing import capture
from running import PATIENCE_S, running

from grabberd.archive.capture.captures_folder import id_of
from grabberd.config import ThresholdConfig
from grabberd.errors import Cause, NotFound, StorageError
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.server.daemon.service import Service
from grabberd.server.daemon.upkeep import STATE_EVERY


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    with running(tmp_path) as started:
        started.upkeep.stop()  # the tests look themselves
        yield started


def causes(service: Service) -> list[Cause]:
    return [fault.cause_code for fault in service.state().faults]


def ids(service: Service) -> list[str]:
    return [document.id for document in service.archive.documents()]


@pytest.mark.parametrize("deleted", [False, True])
def test_an_index_that_breaks_is_rebuilt_and_captures_go_on(service: Service, deleted: bool) -> None:
    first = capture(service, fields=5).stem
    index = service.archive.index.path
    index.unlink() if deleted else index.write_bytes(b"garbage " * 2000)
    second = capture(service, fields=5).stem
    assert ids(service) == [second, first]
    assert service.archive.keeper.rebuilt == 1
    assert service.faults.counts[Cause.INDEX_REBUILDING] == 1
    assert causes(service) == []


def test_without_its_folder_nothing_is_recorded_or_listed_and_all_is_well_when_it_is_back(
    service: Service,
) -> None:
    known = capture(service, fields=5)
    folder = known.parent
    away = folder.rename(folder.with_name("away"))
    for attempt in (
        lambda: service.capture_control.start(None, CaptureRequest(fields=5)),
        lambda: service.capture_control.arm(None, CaptureRequest(fields=5)),
        service.archive.documents,
        lambda: service.archive.document(known.stem),
        lambda: service.archive.path(known.stem),
        lambda: service.annotations.delete(known.stem),
    ):
        with pytest.raises(StorageError, match="is gone") as refused:
            attempt()
        assert refused.value.cause is Cause.CAPTURES_MISSING
    service.upkeep.look(STATE_EVERY)
    assert not folder.exists()
    assert causes(service) == [Cause.CAPTURES_MISSING]
    storage = service.state().storage
    assert (storage.cause_code, storage.free_bytes) == (Cause.CAPTURES_MISSING, None)
    away.rename(folder)
    assert ids(service) == [known.stem]
    assert causes(service) == []
    assert capture(service, fields=5).exists()


def test_a_folder_that_was_gone_at_the_start_is_awaited(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        known = capture(service, fields=5)
    away = known.parent.rename(tmp_path / "away")
    shutil.copy(away / known.name, away / "left.grab.part")
    with running(tmp_path) as service:
        service.upkeep.stop()
        assert causes(service) == [Cause.CAPTURES_MISSING]
        assert not known.parent.exists()
        away.rename(known.parent)
        service.upkeep.look(1)
        assert causes(service) == []
        assert known.stem in ids(service)
        assert (known.parent / "left.grab").exists(), "what a crash left is sealed then"


def test_a_capture_that_lost_its_folder_is_sealed_when_that_is_back(tmp_path: Path) -> None:
    with running(tmp_path, {"pace": "real"}) as service:
        service.upkeep.stop()
        started = service.capture_control.start(None, CaptureRequest())
        assert service.instrument(None).pipeline.ring.reader().take(PATIENCE_S)
        folder = service.archive.directory
        away = folder.rename(folder.with_name("away"))
        recording = service.instrument(None).captures.recording
        assert recording is not None
        assert recording.sealed.wait(PATIENCE_S)
        assert set(causes(service)) == {Cause.CAPTURES_MISSING, Cause.CAPTURE_UNSEALED}
        away.rename(folder)
        service.unsealed._due_ns = 0
        service.upkeep.look(1)
        assert causes(service) == []
        document = service.archive.document(started.id)
        assert (document.state, document.verdict) == ("sealed", "incomplete")


def test_one_that_is_not_sealed_yet_stays_listed_when_the_next_one_has_begun(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:

        def refuse(_: Path) -> Path:
            raise StorageError("cannot be written", "make room")

        patch.setattr("grabberd.archive.capture.writer.publish", refuse)
        service.capture_control.start(None, CaptureRequest(fields=5))
        recording = service.instrument(None).captures.recording
        assert recording is not None
        assert recording.sealed.wait(PATIENCE_S)
    second = capture(service, fields=5).stem
    states = {document.id: document.state for document in service.archive.documents()}
    assert states == {recording.id: "unsealed", second: "sealed"}
    service.unsealed._due_ns = 0
    service.upkeep.look(1)
    assert service.archive.document(recording.id).verdict == "complete"


def test_a_file_that_was_removed_by_hand_is_forgotten(service: Service) -> None:
    gone, kept = capture(service, fields=5), capture(service, fields=5)
    gone.unlink()
    with pytest.raises(NotFound, match="is gone"):
        service.archive.path(gone.stem)
    assert ids(service) == [kept.stem]


def test_what_is_in_force_survives_the_loss_of_the_state(service: Service, tmp_path: Path) -> None:
    service.settings.set_threshold(service.instrument(None), ThresholdConfig(kind="fixed", value=77))
    # The backups first: whichever thread finds the state damaged recovers it at once.
    for backup in (tmp_path / "backups").iterdir():
        backup.write_bytes(b"garbage")
    (tmp_path / "state.sqlite").write_bytes(b"garbage " * 2000)
    service.upkeep.look(STATE_EVERY)
    assert causes(service) == [Cause.SETTINGS_LOST]
    assert service.state_store.get("threshold.simulated") == {"kind": "fixed", "value": 77, "map": False}
    assert service.state_store.get("captures_folder") == id_of(service.archive.directory)
    assert capture(service, fields=5).exists()


def test_captures_whose_pins_may_be_lost_are_not_deleted(service: Service, tmp_path: Path) -> None:
    (tmp_path / "state.sqlite").write_bytes(b"garbage " * 2000)
    service.upkeep.look(STATE_EVERY)
    with pytest.raises(StorageError, match="pins") as refused:
        service.retention.apply()
    assert "storage accept" in refused.value.hint


def test_a_look_that_fails_keeps_none_of_those_to_come(
    service: Service, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    looks = iter([OSError(5, "I/O error"), OSError(5, "I/O error"), None])

    def look(_: int) -> None:
        if (failure := next(looks)) is not None:
            raise failure
        service.upkeep._stopping.set()

    monkeypatch.setattr(service.upkeep, "look", look)
    monkeypatch.setattr("grabberd.server.daemon.upkeep.EVERY_S", 0)
    service.upkeep._stopping.clear()
    service.upkeep._run()
    assert len([record for record in caplog.records if "has failed" in record.getMessage()]) == 1
