"""The document of a running capture, which is made from memory: its file would give the same."""

import time
from pathlib import Path

from running import PATIENCE_S, running, sealed

from archive.captures import meta
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.catalogue.capture_documents import describe
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.instrument.capture.recording import Recording
from grabberd.server.daemon.service import Service

GROWS = {"state", "verdict", "ended_because", "fields", "length_fields", "ledger", "size_bytes"}
"""What changes from field to field, or when the capture ends."""


def written(service: Service) -> Recording:
    recording = service.instrument(None).captures.recording
    assert recording is not None
    deadline = time.monotonic() + PATIENCE_S
    while not recording.committed and time.monotonic() < deadline:
        time.sleep(0.01)
    return recording


def test_a_running_capture_is_described_as_its_file_describes_it(tmp_path: Path) -> None:
    request = CaptureRequest(pre_trigger_fields=5, note="new liners", labels={"cow": "112"})
    with running(tmp_path, {"pace": "real"}) as service:
        begun = service.capture_control.start(None, request)
        recording = written(service)
        remembered, stored = recording.document, describe(recording.path)
        assert remembered.model_dump(exclude=GROWS) == stored.model_dump(exclude=GROWS)
        later = GROWS | {"first_field_s", "runs"}
        assert begun.model_dump(exclude=later) == stored.model_dump(exclude=later)
        assert (remembered.state, remembered.verdict, remembered.ended_because) == ("recording", None, None)
        assert remembered.first_field_s is not None
        assert remembered.fields >= stored.fields > 0


def test_it_tells_its_length_while_it_is_recorded(tmp_path: Path) -> None:
    with running(tmp_path, {"pace": "real"}) as service:
        begun = service.capture_control.start(None, CaptureRequest(fields=30, pre_trigger_fields=5))
        assert begun.length_fields == 30
        sealed(service)
        assert service.archive.document(begun.id).length_fields is None
        assert service.capture_control.start(None, CaptureRequest()).length_fields is None


def test_its_ledger_and_fields_are_those_of_the_sealed_file(tmp_path: Path) -> None:
    with running(tmp_path, {"pace": "real"}) as service:
        service.capture_control.start(None, CaptureRequest(fields=40))
        recording = written(service)
        sealed(service)
        remembered, stored = recording.document, describe(recording.path)
    end = {"state", "verdict", "coverage", "field_order", "rig", "runs"}
    assert remembered.model_dump(exclude=end) == stored.model_dump(exclude=end)


def test_a_run_is_listed_only_once_a_reader_of_the_file_finds_it(tmp_path: Path) -> None:
    writer = CaptureWriter.create(tmp_path / "one.grab.part", meta())
    writer.begin_run(1, "live", "2026-01-01T00:00:00.000Z", "0", {})
    assert writer.runs == []
    writer.commit()
    with CaptureReader(writer.path) as reader:
        assert [run.run for run in reader.runs] == [run.run for run in writer.runs] == [1]
    writer.close()
