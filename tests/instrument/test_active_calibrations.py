"""Which calibrations there are, and which of them a device measures with: also after a restart."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calibrators import SHIFT_MM, calibration, exact, failed, listed
from running import PATIENCE_S, configuration, running, sealed, wait_until_it_accepts

from grabberd.archive.calibrations.calibration_catalog import calibration_frame_document
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.state.calibration_store import CalibrationRecord
from grabberd.config import GlassConfig, default_config_file
from grabberd.documents.enums import JobState
from grabberd.documents.requests import CalibrationOptions
from grabberd.errors import CalibrationMismatch, CaptureRunning, Conflict, InputError, NotFound
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.instrument.setup import set_up
from grabberd.library.jobs.calibration_jobs import CalibrationJob
from grabberd.library.jobs.measurement import MeasurementJob
from grabberd.server.daemon.service import Service

pytestmark = pytest.mark.usefixtures("importable")
"""By the job process, whose calibrator is one of the tests."""

CONFIGURED = "fake-1-2"


@contextmanager
def at_rest(folder: Path, **changes: Any) -> Iterator[Service]:
    """A service that knows its calibrations and whose devices do not stream."""
    service = Service(set_up(configuration({}, **changes), default_config_file()), folder)
    service.open_stores()
    yield service


def two_devices(folder: Path, *names: str) -> Service:
    config = configuration({})
    device = config.devices["simulated"].model_copy(update={"calibration": None})
    config = config.model_copy(update={"devices": dict.fromkeys(names, device)})
    service = Service(set_up(config, default_config_file()), folder)
    service.open_stores()
    return service


def in_force(service: Service) -> str | None:
    document = service.active.document(service.instrument(None))
    return document.id if document else None


def capture(service: Service, **request: Any) -> Path:
    capture_id = service.capture_control.start(None, CaptureRequest(fields=8, **request)).id
    sealed(service)
    return service.archive.path(capture_id)


def remeasure(service: Service, path: Path) -> None:
    job = MeasurementJob(subject=path.stem, made_with=service.instrument(None).setup.made_with)
    service.jobs.wait(service.jobs.submit(job).id, PATIENCE_S)


def z_of(path: Path, run: int) -> dict[tuple[int, int], float]:
    with CaptureReader(path) as reader:
        return {
            (n, int(target)): float(xyz[2])
            for n, points in reader.points(run)
            for target, xyz in zip(points.target, points.xyz_mm, strict=True)
        }


def shift_between(path: Path, run: int, other: int) -> float:
    one, two = z_of(path, run), z_of(path, other)
    assert len(one.keys() & two.keys()) > 400
    return float(np.mean([two[key] - one[key] for key in one.keys() & two.keys()]))


def test_the_configurations_calibration_is_in_force_by_itself_and_listed(tmp_path: Path) -> None:
    with at_rest(tmp_path) as service:
        [row] = listed(service)
        assert (row.id, row.origin, row.active) == (CONFIGURED, "configuration", True)
        assert (row.device, row.created_utc) == ("simulated", "2026-01-01T00:00:00Z")
        assert service.active.document(service.instrument(None)).activated_utc is None  # type: ignore[union-attr]


def test_an_imported_one_waits_until_it_is_activated(tmp_path: Path) -> None:
    with at_rest(tmp_path) as service:
        service.import_calibration(calibration("rig-7", created_utc="2026-05-01T00:00:00Z"), None, "mirrors")
        assert [(row.id, row.active) for row in listed(service)] == [
            ("rig-7", False),
            (CONFIGURED, True),
        ]
        service.active.activate("rig-7", service.instrument(None))
        assert [row.active for row in listed(service)] == [True, False]
        assert service.active.row("rig-7").note == "mirrors"


def test_a_failed_one_is_used_only_on_an_admins_word_and_the_device_then_warns(tmp_path: Path) -> None:
    with at_rest(tmp_path) as service:
        service.import_calibration(failed("rig-7"), None, "")
        assert service.active.row("rig-7").verdict == "failed"
        with pytest.raises(Conflict, match=r"failed: the scale is off by \+2 %"):
            service.active.activate("rig-7", service.instrument(None))
        assert in_force(service) == CONFIGURED
        service.active.activate("rig-7", service.instrument(None), despite_failure=True)
        assert in_force(service) == "rig-7"
    with at_rest(tmp_path) as service:
        assert in_force(service) == "rig-7"
        assert any("the scale is off" in one for one in service.active.warnings(service.instrument(None)))


def test_the_choice_survives_a_restart_and_can_be_taken_back(tmp_path: Path) -> None:
    with at_rest(tmp_path) as service:
        service.import_calibration(calibration("rig-7"), None, "")
        service.active.activate("rig-7", service.instrument(None))
    with at_rest(tmp_path) as service:
        assert in_force(service) == "rig-7"
        assert service.instrument(None).setup.made_with["calibration"]["id"] == "rig-7"
        service.active.activate(CONFIGURED, service.instrument(None))
        assert in_force(service) == CONFIGURED
    with at_rest(tmp_path) as service:
        assert in_force(service) == CONFIGURED


def test_a_choice_that_is_damaged_is_replaced_by_none_and_says_so(tmp_path: Path) -> None:
    with at_rest(tmp_path) as service:
        service.import_calibration(calibration("rig-7"), None, "")
        service.active.activate("rig-7", service.instrument(None))
    file = tmp_path / "calibrations" / "rig-7" / "calibration.json"
    file.chmod(0o644)
    file.write_text("{}")
    with at_rest(tmp_path) as service:
        assert in_force(service) is None
        assert service.instrument(None).setup.measuring is None
        damaged, *_ = service.active.warnings(service.instrument(None))
        assert "rig-7" in damaged
        assert "cannot be used" in damaged
        assert [row.problem is None for row in listed(service)] == [True, False]
        service.active.activate(CONFIGURED, service.instrument(None))
        assert service.active.warnings(service.instrument(None)) == []


def test_a_choice_that_no_longer_fits_the_rig_is_not_used(tmp_path: Path) -> None:
    with at_rest(tmp_path) as service:
        service.import_calibration(calibration("rig-7"), None, "")
        service.active.activate("rig-7", service.instrument(None))
    rig = configuration({}).devices["simulated"].rig
    glass = GlassConfig(thickness_mm=2.0, refractive_index=1.5)
    with at_rest(tmp_path, calibration=None, rig=rig.model_copy(update={"glass": glass})) as service:
        assert in_force(service) is None
        assert "without glass" in service.active.warnings(service.instrument(None))[0]


def test_without_any_calibration_the_state_warns(tmp_path: Path) -> None:
    with at_rest(tmp_path, calibration=None, object=None) as service:
        calibration_missing, object_missing = service.active.warnings(service.instrument(None))
        assert "no calibration" in calibration_missing
        assert "no object model" in object_missing


def test_the_same_id_is_refused_be_it_stored_or_configured(tmp_path: Path) -> None:
    with at_rest(tmp_path) as service:
        service.import_calibration(calibration("rig-7"), None, "")
        for taken in ("rig-7", CONFIGURED):
            with pytest.raises(Conflict, match=taken):
                service.import_calibration(calibration(taken, shift_mm=1.0), None, "")


def test_one_that_is_stored_and_configured_is_listed_once_with_its_note(tmp_path: Path) -> None:
    with at_rest(tmp_path, calibration=None) as service:
        service.import_calibration(calibration(CONFIGURED), None, "taken home")
    with at_rest(tmp_path) as service:
        [row] = listed(service)
        assert (row.note, row.origin, row.active) == ("taken home", "import", True)


def test_a_stored_one_hidden_by_the_configurations_is_listed_with_that_problem(tmp_path: Path) -> None:
    with at_rest(tmp_path, calibration=None) as service:
        service.import_calibration(calibration(CONFIGURED, shift_mm=1.0), None, "")
        service.active.activate(CONFIGURED, service.instrument(None))
    with at_rest(tmp_path) as service:
        assert sorted(bool(row.problem) for row in listed(service)) == [False, True]
        assert service.instrument(None).setup.made_with["calibration"] == calibration(CONFIGURED)


@pytest.mark.parametrize(
    "changes",
    [
        {"image": {"columns": 640, "lines": 480}},
        {"image": {"columns": 720, "lines": 480}},
        {"glass": {"thickness_mm": 2.0, "refractive_index": 1.5}},
    ],
)
def test_one_of_another_rig_is_refused(tmp_path: Path, changes: Any) -> None:
    with at_rest(tmp_path) as service:
        document = calibration("rig-7", **changes)
        if "image" in changes and changes["image"]["columns"] == 640:
            document["views"]["right"]["end_column"] = 640
        with pytest.raises(CalibrationMismatch):
            service.import_calibration(document, None, "")
        service.calibrations.add(document, CalibrationRecord("simulated"))
        with pytest.raises(CalibrationMismatch):
            service.active.activate("rig-7", service.instrument(None))
        assert in_force(service) == CONFIGURED


def test_one_with_other_halves_is_refused(tmp_path: Path) -> None:
    with at_rest(tmp_path) as service:
        document = calibration("rig-7")
        document["views"]["left"]["end_column"] = 350
        with pytest.raises(CalibrationMismatch, match="left"):
            service.import_calibration(document, None, "")


def test_what_is_no_calibration_is_refused_with_every_problem(tmp_path: Path) -> None:
    with at_rest(tmp_path) as service, pytest.raises(InputError, match="views"):
        service.import_calibration({"schema": "grabberd/calibration/1", "id": "rig-7"}, None, "")


def test_the_calibration_of_another_device_is_refused_but_not_that_of_a_renamed_one(tmp_path: Path) -> None:
    service = two_devices(tmp_path, "north", "south")
    with pytest.raises(NotFound, match="no device is named"):
        service.import_calibration(calibration("rig-7"), None, "")
    service.import_calibration(calibration("rig-7"), "north", "")
    with pytest.raises(CalibrationMismatch, match="north"):
        service.active.activate("rig-7", service.instrument("south"))
    service.active.activate("rig-7", service.instrument("north"))
    states = [service.active.document(service.instrument(name)) for name in ("north", "south")]
    assert [state is None for state in states] == [False, True]
    renamed = two_devices(tmp_path, "east", "south")
    renamed.active.activate("rig-7", renamed.instrument("east"))


def test_the_age_counts_from_the_calibrations_own_time(tmp_path: Path) -> None:
    with at_rest(tmp_path) as service:
        one, other = (
            calibration("a", created_utc="2026-03-01T00:00:00"),
            calibration("b", created_utc="2026-03-02T01:00:00+01:00"),
        )
        ages = []
        for document in (one, other):
            service.import_calibration(document, None, "")
            service.active.activate(document["id"], service.instrument(None))
            ages.append(service.active.document(service.instrument(None)).age_days)  # type: ignore[union-attr]
        assert ages[0] - ages[1] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.slow
def test_worker_and_captures_go_over_to_the_active_one(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        before = capture(service)
        service.import_calibration(calibration("shifted", SHIFT_MM), None, "")
        service.active.activate("shifted", service.instrument(None))
        after = capture(service)
        with CaptureReader(before) as old, CaptureReader(after) as new:
            assert old.runs[0].made_with["calibration"]["id"] == CONFIGURED
            assert new.runs[0].made_with["calibration"] == calibration("shifted", SHIFT_MM)
        remeasure(service, before)
        assert shift_between(before, 1, 2) == pytest.approx(SHIFT_MM, abs=0.01)
        service.active.activate(CONFIGURED, service.instrument(None))
        remeasure(service, after)
        assert shift_between(after, 2, 1) == pytest.approx(SHIFT_MM, abs=0.01)


def test_live_points_go_on_through_an_activation(tmp_path: Path) -> None:
    with running(tmp_path, {"pace": "real"}) as service:
        service.import_calibration(calibration("shifted", SHIFT_MM), None, "")
        worker = service.instrument(None).worker
        with worker.published:
            assert worker.published.wait_for(lambda: worker.live is not None, PATIENCE_S)
        service.active.activate("shifted", service.instrument(None))
        last = worker.live.measured.n if worker.live else 0
        with worker.published:
            assert worker.published.wait_for(
                lambda: worker.live is not None and worker.live.measured.n > last + 5, PATIENCE_S
            )
        assert worker.live
        assert len(worker.live.measured.points) > 60


def test_an_activation_is_refused_while_a_capture_runs(tmp_path: Path) -> None:
    with running(tmp_path, {"pace": "real"}, object=None) as service:
        service.import_calibration(calibration("shifted", SHIFT_MM), None, "")
        capture_id = service.capture_control.start(None, CaptureRequest()).id
        with pytest.raises(CaptureRunning, match=capture_id):
            service.active.activate("shifted", service.instrument(None))
        assert in_force(service) == CONFIGURED
        service.capture_control.stop(capture_id)
        sealed(service)
        service.active.activate("shifted", service.instrument(None))
    with at_rest(tmp_path) as service:
        assert in_force(service) == "shifted"


@pytest.mark.slow
def test_an_instrument_without_calibration_captures_is_calibrated_and_measures(tmp_path: Path) -> None:
    config = configuration({"pace": "free"}, calibration=None)
    service = Service(set_up(config, default_config_file()), tmp_path)
    service.job_contexts.calibrator = exact
    service.start()
    try:
        wait_until_it_accepts(service)
        first = capture(service)
        with CaptureReader(first) as reader:
            assert reader.runs == []
        job = CalibrationJob(
            subject=first.stem,
            calibration_frame=calibration_frame_document(None),
            options=CalibrationOptions(),
            device="simulated",
        )
        done = service.jobs.wait(service.jobs.submit(job).id, PATIENCE_S)
        assert done.state is JobState.DONE, done.problem
        service.active.activate(done.result.calibration, service.instrument(None))
        with CaptureReader(capture(service)) as reader:
            assert reader.runs[0].made_with["calibration"]["id"] == f"of-{first.stem}"
            assert sum(len(points) for _, points in reader.points()) > 400
    finally:
        service.stop()
