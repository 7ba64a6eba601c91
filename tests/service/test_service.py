"""The running instrument on the simulated grabber: captures, their files, and what a replay of them gives."""

import sqlite3
from pathlib import Path

import cv2
import numpy as np
import pytest
from running import PATIENCE_S, configuration, running, sealed

from grabberd.acquisition import Outcome
from grabberd.config import CaptureConfig, ThresholdConfig, default_config_file
from grabberd.errors import CalibrationMismatch, CaptureRunning, Conflict, NotFound
from grabberd.service.jobs import JobState
from grabberd.service.measuring import order_measuring
from grabberd.service.recorder import CaptureRequest
from grabberd.service.service import Service
from grabberd.service.setup import set_up
from grabberd.service.states import DeviceState
from grabberd.storage import CaptureReader
from grabberd.storage.export import export_png

Points = dict[tuple[int, int], tuple[float, ...]]
FIXED = {"threshold": {"kind": "fixed", "value": 60}}


def fixed_threshold() -> dict[str, object]:
    return {"threshold": ThresholdConfig(kind="fixed", value=60)}


def capture(service: Service, **request: object) -> Path:
    capture_id = service.start_capture(None, CaptureRequest(**request))  # type: ignore[arg-type]
    sealed(service)
    return service.archive.path(capture_id)


def points_of(path: Path, run: int = 1) -> Points:
    with CaptureReader(path) as reader:
        return {
            (n, int(target)): tuple(xyz)
            for n, points in reader.points(run)
            for target, xyz in zip(points.target, points.xyz_mm.tolist(), strict=True)
        }


def test_a_capture_has_all_its_fields_and_the_points_of_each(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        path = capture(service, fields=64)
        with CaptureReader(path) as reader:
            assert reader.ledger.complete
            assert reader.meta.complete
            assert [field.n for field in reader.received()] == list(range(64))
            assert [n for n, _ in reader.points()] == list(range(64))
            assert all(len(points) > 60 for _, points in reader.points())


def test_the_file_says_what_it_was_made_with(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        path = capture(service, fields=5, note="second udder", labels={"cow": "112"})
        with CaptureReader(path) as reader:
            assert reader.meta.device["driver"] == "fake"
            assert reader.meta.labels == {"cow": "112"}
            assert reader.meta.note == "second udder"
            assert reader.runs[0].made_with["calibration"]["schema"] == "grabberd/calibration/1"
            assert len(reader.runs[0].made_with["object"]["targets"]) == 108


def test_points_lie_near_the_simulators_truth(tmp_path: Path) -> None:
    from grabberd_fake import truth_at  # noqa: PLC0415

    with running(tmp_path) as service:
        path = capture(service, fields=50)
        options = service.instrument(None).setup.config.options
        with CaptureReader(path) as reader:
            errors = []
            for _, time_ns, points in reader.timed_points():
                truth = truth_at(options, time_ns)
                place = dict(zip(truth.ids.tolist(), truth.xyz_mm, strict=True))
                errors += [xyz - place[int(t)] for t, xyz in zip(points.target, points.xyz_mm, strict=True)]
        error = np.linalg.norm(errors, axis=1)
        assert np.sqrt((error**2).mean()) < 0.12
        assert error.max() < 1.0, "no target has another's id"


@pytest.mark.parametrize(("bits", "lines"), [(1, "field"), (4, "field"), (8, "field"), (8, "doubled")])
def test_other_bits_re_arm_the_ring_first(tmp_path: Path, bits: int, lines: str) -> None:
    with running(tmp_path) as service:
        path = capture(service, fields=10, bits=bits, lines=lines)
        with CaptureReader(path) as reader:
            packed = reader.field(3).numbered.packed
            assert (packed.bits, packed.y_step) == (bits, 1 if lines == "doubled" else 2)
            assert sum(len(points) for _, points in reader.points()) > 600


def test_without_a_wish_a_capture_has_the_bits_of_the_configuration(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        capture(service, fields=5, bits=8)
        with CaptureReader(capture(service, fields=5)) as reader:
            assert reader.meta.bits == 1


def test_a_calibration_of_pictures_of_another_size_is_refused(tmp_path: Path) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for n in range(4):
        cv2.imwrite(str(pictures / f"{n}.png"), np.zeros((288, 360), np.uint8))
    with replaying(tmp_path, pictures) as service, pytest.raises(CalibrationMismatch, match="720"):
        service.start_capture(None, CaptureRequest())


def test_a_file_whose_ledger_contradicts_itself_is_shown_as_damaged_beside_the_others(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        bad, good = capture(service, fields=10), capture(service, fields=5)
        connection = sqlite3.connect(bad)
        connection.execute("INSERT INTO ledger VALUES (3, 4, 'lost', 'twice')")
        connection.commit()
        connection.close()
        states = {document["id"]: document["state"] for document in service.archive.documents()}
        assert states == {bad.stem: "damaged", good.stem: "sealed"}


def test_a_second_start_is_refused_with_the_id_of_the_running_one(tmp_path: Path) -> None:
    with running(tmp_path, {"pace": "real"}) as service:
        capture_id = service.start_capture(None, CaptureRequest())
        with pytest.raises(CaptureRunning) as refused:
            service.start_capture(None, CaptureRequest())
        assert refused.value.capture_id == capture_id
        service.stop_capture(capture_id)
        sealed(service)
        with pytest.raises(Conflict):
            service.stop_capture(capture_id)


def test_the_fields_before_the_trigger_belong_to_the_capture(tmp_path: Path) -> None:
    with running(tmp_path, {"pace": "real"}) as service:
        instrument = service.instrument(None)
        reader = instrument.intake.armed.ring.reader()
        for _ in range(12):
            assert reader.take(PATIENCE_S)
        newest = instrument.intake.armed.ring.newest
        path = capture(service, fields=20, pre_trigger_fields=10)
        session = instrument.session
        assert newest
        assert session
        assert session.recorder.first_n is not None
        assert session.recorder.first_n <= newest.n - 8
        with CaptureReader(path) as file:
            assert file.ledger.received == 20


def test_measuring_the_file_again_gives_the_same_points_bit_for_bit(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        path = capture(service, fields=30)
        job = order_measuring(service, path.stem)
        done = service.jobs.wait(job.id, PATIENCE_S)
        assert done.state is JobState.DONE, done.problem
        assert done.result["run"] == 2
        assert points_of(path, run=2) == points_of(path, run=1)


@pytest.mark.parametrize("bits", [1, 8])
def test_a_replay_of_exported_pictures_gives_the_same_points_bit_for_bit(tmp_path: Path, bits: int) -> None:
    with running(tmp_path / "live", **fixed_threshold()) as service:
        live = capture(service, fields=40, bits=bits, lines="field")
    export_png(live, tmp_path / "pictures")
    with replaying(tmp_path, tmp_path / "pictures") as service:
        again = capture(service, bits=bits, lines="field")
        assert sealed(service).recorder.ledger.complete
        assert len(points_of(live)) > 2000
        assert points_of(again) == points_of(live)


@pytest.mark.parametrize("lines", ["doubled", "field"])
def test_a_replay_of_a_capture_file_gives_the_same_points_bit_for_bit(tmp_path: Path, lines: str) -> None:
    with running(tmp_path / "live", **fixed_threshold()) as service:
        live = capture(service, fields=40, bits=1, lines=lines)
    with replaying(tmp_path, live) as service:
        assert points_of(capture(service, bits=1, lines=lines)) == points_of(live)


def replaying(tmp_path: Path, recording: Path, **changes: object):  # type: ignore[no-untyped-def]
    from contextlib import contextmanager  # noqa: PLC0415

    from running import wait_until_it_accepts  # noqa: PLC0415

    @contextmanager
    def service():  # type: ignore[no-untyped-def]
        config = configuration({}, driver="replay", **{**fixed_threshold(), **changes})
        device = config.devices["simulated"].model_copy(update={"options": {"path": str(recording)}})
        config = config.model_copy(update={"devices": {"simulated": device}})
        one = Service(set_up(config, default_config_file()), tmp_path / "replayed")
        one.start()
        try:
            wait_until_it_accepts(one)
            yield one
        finally:
            one.stop()

    return service()


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
    with running(tmp_path, {"pace": "real", "faults": faults}) as service:
        path = capture(service, fields=140, pre_trigger_fields=16)
        with CaptureReader(path) as reader:
            counts = reader.ledger.counts()
            assert counts[Outcome.DAMAGED] == 2
            assert counts[Outcome.NO_SIGNAL] > 0
            first, *rest = (entry.reason for entry in reader.ledger.entries)
            assert first == "repeated"
            assert {reason.partition(":")[0] for reason in rest} == {"no signal"}


def test_a_picture_that_the_grabber_makes_up_is_no_signal_whatever_its_driver_says(tmp_path: Path) -> None:
    faults = [{"kind": "no_signal", "at_field": 30, "duration_s": 1.0, "picture": "blue", "told": False}]
    with running(tmp_path, {"pace": "real", "faults": faults}) as service:
        board = service.instrument(None).board
        with board.changed:
            assert board.changed.wait_for(lambda: board.state is DeviceState.NO_SIGNAL, PATIENCE_S)
            assert board.now.cause == "no signal: a flat picture"
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


@pytest.mark.parametrize("on_interruption", ["continue", "end"])
def test_a_capture_follows_its_policy_when_the_device_stalls(tmp_path: Path, on_interruption: str) -> None:
    faults = [{"kind": "stall", "at_s": 1.0, "until": "restart"}]
    with running(tmp_path, {"pace": "real", "faults": faults}) as service:
        path = capture(service, fields=120, on_interruption=on_interruption)
        with CaptureReader(path) as reader:
            (gap,) = reader.ledger.entries
            assert (gap.outcome, gap.reason) == (Outcome.LOST, "no field for 0.8 s")
            assert reader.meta.complete is False
            assert reader.meta.extra["on_interruption"] == on_interruption
            ended = {"continue": "length reached", "end": "interrupted: no field for 0.8 s"}
            assert reader.meta.ended_because == ended[on_interruption]
            assert (reader.ledger.total == 120) == (on_interruption == "continue")
        document = service.state()["devices"]["simulated"]
        assert document["recoveries"]["restart"] == 1
        assert document["last_failure"] == "no field for 0.8 s"


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
            assert board.changed.wait_for(lambda: service.instrument("good").accepts, PATIENCE_S)
        with pytest.raises(NotFound):
            service.instrument(None)
        service.start_capture("good", CaptureRequest(fields=10))
        session = service.instrument("good").session
        assert session
        assert session.sealed.wait(PATIENCE_S)
        assert session.complete
    finally:
        service.stop()


def test_a_capture_that_is_renamed_while_it_is_looked_at_is_shown_as_sealed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with running(tmp_path) as service:
        path = capture(service, fields=5)
        session = service.instrument(None).session
        assert session
        monkeypatch.setattr(service.archive, "_sessions", lambda: [session])
        part = service.archive.part_of(session.id)
        part.write_bytes(path.read_bytes())
        opened = CaptureReader.__init__

        def then_gone(reader: CaptureReader, file: Path) -> None:
            opened(reader, file)
            part.unlink(missing_ok=True)

        monkeypatch.setattr(CaptureReader, "__init__", then_gone)
        assert service.archive.document(session.id)["state"] == "sealed"


def test_stopping_the_service_seals_a_running_capture(tmp_path: Path) -> None:
    with running(tmp_path, {"pace": "real"}) as service:
        capture_id = service.start_capture(None, CaptureRequest())
        reader = service.instrument(None).intake.armed.ring.reader()
        assert reader.take(PATIENCE_S)
    path = service.archive.index.file_of(capture_id)
    with CaptureReader(path) as file:
        assert file.meta.state == "sealed"
        assert file.meta.ended_because == "the daemon stopped"


def test_a_full_disk_ends_the_capture_and_what_is_on_it_can_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from grabberd.storage import schema  # noqa: PLC0415

    create = schema.create
    monkeypatch.setattr("grabberd.storage.writer.create", lambda path, _=None: create(path, max_pages=600))
    with running(tmp_path, {"pace": "real"}) as service:
        path = capture(service)
        session = service.instrument(None).session
        assert session
        assert session.failure is not None
        assert "full" in session.failure.message
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
        assert service.archive.document(whole.stem)["state"] == "sealed"
        assert not part.exists()


def thresholds_of(path: Path) -> list[int]:
    with CaptureReader(path) as reader:
        return [field.packed.threshold for field in reader.received()]


@pytest.mark.parametrize("threshold", [ThresholdConfig(), ThresholdConfig(map=True)])
def test_a_live_capture_has_one_chosen_threshold_from_its_first_field_on(
    tmp_path: Path, threshold: ThresholdConfig
) -> None:
    with running(tmp_path, {"pace": "real"}, threshold=threshold) as service:
        (chosen,) = set(thresholds_of(capture(service, fields=25)))
        assert 30 < chosen < 110
        (grey,) = set(thresholds_of(capture(service, fields=5, bits=8)))
        assert grey < chosen, "chosen anew for other bits"


def test_the_same_recording_gives_the_same_thresholds_and_points_each_time(tmp_path: Path) -> None:
    with running(tmp_path / "live") as service:
        recording = capture(service, fields=30, bits=8)
    thresholds, points = [], []
    for again in ("one", "two"):
        with replaying(tmp_path / again, recording, threshold=ThresholdConfig()) as service:
            path = capture(service)
            thresholds.append(thresholds_of(path))
            points.append(points_of(path))
    assert thresholds[0] == thresholds[1]
    assert len(set(thresholds[0])) == 1
    assert points[0] == points[1]
