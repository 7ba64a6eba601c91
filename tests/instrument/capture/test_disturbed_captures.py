"""What a capture says when its device loses fields, its signal, or itself."""

from pathlib import Path

import pytest
from capturing import capture
from running import PATIENCE_S, PatientClock, live, running, sealed, until

from grabberd.archive.capture.reader import CaptureReader
from grabberd.config import CaptureConfig, RingConfig
from grabberd.core.ledger import Outcome
from grabberd.documents.enums import DeviceState
from grabberd.errors import Cause
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.instrument.live.health import device_health, lacks_of
from grabberd_fake import grabber
from grabberd_fake.options import FakeOptions
from grabberd_fake.stage import REARRANGED
from grabberd_fake.world import World

FROM_THE_FIRST = 200
"""So many fields before the trigger are all that ever came: the script's fields are the capture's."""
LONG_RING = {"ring": RingConfig(slots=256)}


def test_lost_damaged_and_repeated_fields_are_in_the_ledger(tmp_path: Path) -> None:
    faults = [
        {"kind": "lose", "at_field": 20, "count": 3},
        {"kind": "lose_silently", "at_field": 40, "count": 1},
        {"kind": "damage", "at_field": 50, "count": 2},
    ]
    with running(tmp_path, {"faults": faults}) as service:
        path = capture(service, fields=100)
        with CaptureReader(path) as reader:
            counts = reader.ledger.counts()
            assert counts[Outcome.LOST] == 4
            assert counts[Outcome.DAMAGED] == 2
            assert counts[Outcome.RECEIVED] == 94
            assert reader.meta.complete is False


def test_a_live_device_that_repeats_a_picture_and_one_without_signal_are_found_out(tmp_path: Path) -> None:
    faults = [
        {"kind": "repeat", "at_field": 30, "count": 2},
        {"kind": "no_signal", "at_field": 60, "duration_s": 3.0},
    ]
    with live(tmp_path, {"faults": faults}, **LONG_RING) as service:
        path = capture(service, fields=140, pre_trigger_fields=FROM_THE_FIRST)
        with CaptureReader(path) as reader:
            counts = reader.ledger.counts()
            assert counts[Outcome.DAMAGED] == 2
            assert counts[Outcome.NO_SIGNAL] > 0
            first, *rest = (entry.reason for entry in reader.ledger.entries)
            assert first == "repeated"
            assert {reason.partition(":")[0] for reason in rest} == {"no signal"}


def test_a_picture_that_the_grabber_makes_up_is_no_signal_whatever_its_driver_says(tmp_path: Path) -> None:
    faults = [{"kind": "no_signal", "at_field": 30, "duration_s": 1.0, "picture": "blue", "told": False}]
    with live(tmp_path, {"faults": faults}) as service:
        board = service.instrument(None).board
        with board.changed:
            assert board.changed.wait_for(lambda: board.state is DeviceState.NO_SIGNAL, PATIENCE_S)
            assert (board.now.cause, board.now.code) == ("no signal: a flat picture", Cause.NO_PICTURE)
            assert board.changed.wait_for(lambda: board.state is DeviceState.READY, PATIENCE_S)
        assert board.now.outcomes[Outcome.NO_SIGNAL] == 50


def test_an_unplugged_device_comes_back_and_the_capture_says_what_is_missing(tmp_path: Path) -> None:
    faults = [{"kind": "unplug", "at_field": 30, "back_after_s": 1.0}]
    with running(tmp_path, {"faults": faults}) as service:
        path = capture(service, fields=150)
        with CaptureReader(path) as reader:
            lost = [entry for entry in reader.ledger.entries if entry.outcome is Outcome.LOST]
            assert len(lost) == 1
            assert lost[0].first_n == 30
            assert 45 <= lost[0].count <= 100
        assert service.instrument(None).board.now.openings == 2


def test_a_rearranged_stage_leaves_a_gap_and_later_captures_show_what_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = tmp_path / "stage.yaml"
    with live(tmp_path / "state", {"stage": str(stage)}) as service:
        drawn = grabber.World

        def arranged(options: FakeOptions) -> World:
            """On a clock that stands meanwhile, a new stage would be there in no time, and half of the time
            without a gap: the stream begins again with a top field.
            """
            assert isinstance(service.clock, PatientClock)
            service.clock.pass_by(0.1)
            return drawn(options)

        monkeypatch.setattr(grabber, "World", arranged)
        before = service.capture_control.start(None, CaptureRequest(fields=200)).id
        # A change before the first field would leave no gap.
        until(lambda: service.instrument(None).captures.recording.recorder.fields)
        stage.write_text("wall: thin-empty\n")
        sealed(service)
        with CaptureReader(service.archive.path(before)) as reader:
            gaps = [one.outcome for one in reader.ledger.entries if one.reason == REARRANGED]
            assert gaps == [Outcome.LOST], reader.ledger.entries
            assert reader.meta.device["stream"]["details"]["stage"] == "{}"
        with CaptureReader(capture(service, fields=5)) as reader:
            assert reader.meta.device["stream"]["details"]["stage"] == '{"wall": "thin-empty"}'
            assert reader.meta.complete


@pytest.mark.parametrize("on_interruption", ["continue", "end"])
def test_a_capture_follows_its_policy_when_the_device_stalls(tmp_path: Path, on_interruption: str) -> None:
    faults = [{"kind": "stall", "at_s": 1.0, "until": "restart"}]
    with live(tmp_path, {"faults": faults}, **LONG_RING) as service:
        path = capture(
            service, fields=120, pre_trigger_fields=FROM_THE_FIRST, on_interruption=on_interruption
        )
        with CaptureReader(path) as reader:
            gaps = [(gap.outcome, gap.reason) for gap in reader.ledger.entries]
            assert gaps == [(Outcome.LOST, "no field for 0.8 s")], reader.ledger
            assert reader.meta.complete is False
            assert reader.meta.extra["on_interruption"] == on_interruption
            ended = {"continue": "length reached", "end": "interrupted: no field for 0.8 s"}
            assert reader.meta.ended_because == ended[on_interruption]
            assert (reader.ledger.total == 120) == (on_interruption == "continue")
        document = service.state().devices["simulated"]
        assert document.recoveries["restart"] == 1
        assert document.last_failure == "no field for 0.8 s"


def test_the_configuration_says_what_captures_do_unless_they_are_asked_for_otherwise(tmp_path: Path) -> None:
    faults = [{"kind": "unplug", "at_field": 10, "back_after_s": 0.5}]
    with running(tmp_path, {"faults": faults}, capture=CaptureConfig(on_interruption="end")) as service:
        path = capture(service, fields=50)
    with CaptureReader(path) as reader:
        assert reader.meta.extra["on_interruption"] == "end"
        assert "unplugged" in str(reader.meta.ended_because)
        assert reader.ledger.received == 10


def test_a_capture_ends_where_the_device_grants_other_pictures(tmp_path: Path) -> None:
    faults = [{"kind": "standard", "at_field": 10, "duration_s": 1.0}]
    with running(tmp_path, {"faults": faults}) as service:
        path = capture(service, fields=50)
    with CaptureReader(path) as reader:
        assert "NTSC" in str(reader.meta.ended_because)
        assert reader.ledger.received == 10
        assert reader.meta.complete is False


def test_pictures_of_another_size_are_not_measured_with_the_calibration_and_that_is_said(
    tmp_path: Path,
) -> None:
    faults = [{"kind": "standard", "at_s": 1.0, "duration_s": 600}]
    with live(tmp_path, {"faults": faults}) as service:
        instrument = service.instrument(None)
        assert instrument.misfit is None
        with instrument.board.changed:
            granted = instrument.board.changed.wait_for(
                lambda: instrument.board.now.openings == 2, PATIENCE_S
            )
        assert granted
        with instrument.worker.published:
            instrument.worker.published.wait_for(lambda: instrument.worker.live is None, 3.0)
        assert instrument.worker.live is None
        words = "is for pictures of 720 x 576, these are 720 x 480: no points are measured"
        assert words in (instrument.misfit or "")
        assert [
            lack
            for lack in lacks_of(device_health(instrument, service.surroundings()).parts)
            if words in lack.message
        ]
        assert any(words in warning for warning in service.device_document(instrument).warnings)
