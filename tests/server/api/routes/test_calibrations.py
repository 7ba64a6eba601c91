"""Calibrations over HTTP."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from calibrators import calibration, exact, failed, without_result
from fastapi.testclient import TestClient
from running import configuration, wait_until_it_accepts

from grabberd import reports
from grabberd.archive.state.calibration_store import CalibrationRecord
from grabberd.config import default_config_file
from grabberd.documents.document import JobProblem
from grabberd.documents.enums import Role
from grabberd.instrument.setup import set_up
from grabberd.server.api import create_app
from grabberd.server.daemon.service import Service

pytestmark = pytest.mark.usefixtures("importable")
"""By the job process, whose calibrator is one of the tests."""

CALIBRATIONS = "/api/v1/calibrations"
CONFIGURED = "fake-1-2"


@contextmanager
def client_of(folder: Path, pace: str, calibrator: Callable[..., Any]) -> Iterator[TestClient]:
    """A client of a service that records and does not measure."""
    setups = set_up(configuration({"pace": pace}, object=None), default_config_file())
    service = Service(setups, folder)
    service.job_contexts.calibrator = calibrator
    with TestClient(create_app(service), "http://localhost", raise_server_exceptions=False) as client:
        wait_until_it_accepts(service)
        yield client


@pytest.fixture
def calibrating(tmp_path: Path) -> Iterator[TestClient]:
    """Captures are over in no time, and the calibrator knows the answer."""
    with client_of(tmp_path, "free", exact) as client:
        yield client


@pytest.fixture
def recording(tmp_path: Path) -> Iterator[TestClient]:
    """Captures last as long as they last."""
    with client_of(tmp_path, "real", exact) as client:
        yield client


def service_of(client: TestClient) -> Service:
    service: Service = client.app.state.service  # type: ignore[attr-defined]
    return service


def captured(client: TestClient) -> str:
    capture_id = str(client.post("/api/v1/captures", json={"fields": 5}).json()["id"])
    recording = service_of(client).instrument(None).captures.recording
    assert recording
    assert recording.sealed.wait(60)
    return capture_id


def stored(client: TestClient, calibration_id: str = "rig-7", **more: Any) -> dict[str, Any]:
    answer = client.post(CALIBRATIONS, json={"document": calibration(calibration_id), **more})
    assert answer.status_code == 201, answer.json()
    document: dict[str, Any] = answer.json()
    return document


def is_problem(answer: Any, status: int) -> bool:
    kind = answer.headers["content-type"] == "application/problem+json"
    return bool(answer.status_code == status and kind and answer.json()["hint"])


def test_a_capture_is_calibrated_by_a_job_whose_result_is_listed(calibrating: TestClient) -> None:
    capture_id = captured(calibrating)
    order: dict[str, Any] = {
        "capture": capture_id,
        "calibration_frame": "paper-108",
        "options": {"weights": "equal", "free": ["f_mm", "left.b3"]},
        "note": "new mirrors",
    }
    answer = calibrating.post(CALIBRATIONS, json=order)
    assert answer.status_code == 202
    service_of(calibrating).jobs.wait(answer.json()["id"], 60)
    job = calibrating.get(answer.headers["Location"]).json()
    assert (job["kind"], job["subject"], job["state"]) == ("calibrate", capture_id, "done"), job
    made = job["result"]["calibration"]
    document = calibrating.get(f"{CALIBRATIONS}/{made}").json()
    assert document["details"]["targets"] == 108
    assert document["details"]["options"] == order["options"]
    assert document["details"]["note"] == "new mirrors"
    rows = calibrating.get(CALIBRATIONS).json()["calibrations"]
    [row] = [row for row in rows if row["id"] == made]
    assert (row["origin"], row["capture"], row["note"]) == ("capture", capture_id, "new mirrors")
    assert (row["device"], row["active"]) == ("simulated", False)
    assert calibrating.get(f"{CALIBRATIONS}/{made}/report.json").json()["id"] == made


def test_what_the_calibrator_refuses_fails_the_job_with_its_hint(tmp_path: Path) -> None:
    with client_of(tmp_path, "free", without_result) as client:
        job = client.post(CALIBRATIONS, json={"capture": captured(client)}).json()
        failed = service_of(client).jobs.wait(job["id"], 60)
        assert failed.problem == JobProblem(
            message="2 of 108 targets were found", hint="light the calibration frame"
        )
        assert len(client.get(CALIBRATIONS).json()["calibrations"]) == 1


def test_a_complete_calibration_is_stored_and_found_where_the_answer_says(fast: TestClient) -> None:
    answer = fast.post(CALIBRATIONS, json={"document": calibration("rig-7"), "note": "from the workshop"})
    assert answer.status_code == 201
    assert (answer.json()["id"], answer.json()["origin"]) == ("rig-7", "import")
    assert fast.get(answer.headers["Location"]).json() == calibration("rig-7")


def test_a_stored_calibration_never_changes(fast: TestClient) -> None:
    stored(fast)
    again = fast.post(CALIBRATIONS, json={"document": calibration("rig-7", shift_mm=1.0)})
    assert is_problem(again, 409)
    for method in ("PUT", "PATCH", "DELETE", "POST"):
        assert fast.request(method, f"{CALIBRATIONS}/rig-7", json={}).status_code == 405
    assert fast.get(f"{CALIBRATIONS}/rig-7").json() == calibration("rig-7")


def test_one_that_is_known_already_is_not_sent_again(fast: TestClient) -> None:
    stored(fast)
    for calibration_id in ("rig-7", CONFIGURED):
        first = fast.get(f"{CALIBRATIONS}/{calibration_id}")
        for tag in ("*", first.headers["ETag"]):
            known = {"If-None-Match": tag}
            second = fast.get(f"{CALIBRATIONS}/{calibration_id}", headers=known)
            assert (second.status_code, second.content) == (304, b"")
            assert second.headers["ETag"] == first.headers["ETag"]
    assert fast.get(f"{CALIBRATIONS}/rig-7", headers=known).status_code == 200


def test_any_copy_does_not_stand_for_a_calibration_that_there_is_not(fast: TestClient) -> None:
    assert is_problem(fast.get(f"{CALIBRATIONS}/none", headers={"If-None-Match": "*"}), 404)


def test_the_list_says_what_an_operator_chooses_by(fast: TestClient) -> None:
    stored(fast)
    rows = fast.get(CALIBRATIONS).json()["calibrations"]
    [row] = [row for row in rows if row["id"] == CONFIGURED]
    assert row == {
        "id": CONFIGURED,
        "device": "simulated",
        "origin": "configuration",
        "created_utc": "2026-01-01T00:00:00Z",
        "source": "exact optics of the simulated grabber",
        "sigma0_px": None,
        "glass": None,
        "image": {"columns": 720, "lines": 576},
        "active": True,
        "note": "",
        "capture": None,
        "stored_utc": None,
        "problem": None,
        "misfit": None,
        "verdict": None,
        "rejected": None,
    }


def test_a_damaged_one_is_listed_with_its_problem(fast: TestClient) -> None:
    stored(fast)
    file = service_of(fast).calibrations.store.directory / "rig-7" / "calibration.json"
    file.chmod(0o644)
    file.write_text("{")
    damaged = fast.get(CALIBRATIONS).json()["calibrations"][-1]
    assert damaged["id"] == "rig-7"
    assert damaged["problem"]
    assert is_problem(fast.get(f"{CALIBRATIONS}/rig-7"), 507)
    assert is_problem(fast.put(f"{CALIBRATIONS}/active", json={"id": "rig-7"}), 507)


def test_the_state_shows_the_activated_one_and_its_age(fast: TestClient) -> None:
    stored(fast)
    answer = fast.put(f"{CALIBRATIONS}/active", json={"id": "rig-7"})
    assert (answer.status_code, answer.json()["active"]) == (200, True)
    device = fast.get("/api/v1/state").json()["devices"]["simulated"]
    assert device["calibration"]["id"] == "rig-7"
    assert device["calibration"]["activated_utc"].endswith("Z")
    assert isinstance(device["calibration"]["age_days"], float)
    assert device["warnings"] == []
    assert fast.get("/api/v1/devices/simulated").json()["calibration"]["id"] == "rig-7"


def test_an_activation_during_a_capture_is_refused_with_the_captures_id(recording: TestClient) -> None:
    stored(recording)
    running = recording.post("/api/v1/captures", json={}).json()["id"]
    refused = recording.put(f"{CALIBRATIONS}/active", json={"id": "rig-7"})
    assert is_problem(refused, 409)
    assert refused.json()["capture_id"] == running


def test_one_that_does_not_fit_is_refused(fast: TestClient) -> None:
    thick = calibration("thick", glass={"thickness_mm": 2.0, "refractive_index": 1.5})
    assert is_problem(fast.post(CALIBRATIONS, json={"document": thick}), 422)
    service_of(fast).calibrations.add(thick, CalibrationRecord("simulated"))
    assert is_problem(fast.put(f"{CALIBRATIONS}/active", json={"id": "thick"}), 422)


def test_a_report_comes_as_a_page_that_loads_nothing(fast: TestClient) -> None:
    store = service_of(fast).calibrations.store
    store.add(calibration("rig-7"), report={"id": "rig-7"}, page="<p>σ0</p>")
    answer = fast.get(f"{CALIBRATIONS}/rig-7/report")
    assert (answer.headers["content-type"], answer.text) == ("text/html; charset=utf-8", "<p>σ0</p>")
    assert answer.headers["content-security-policy"].startswith("default-src 'none'")


def test_a_report_that_could_not_be_drawn_says_what_to_install(fast: TestClient) -> None:
    store = service_of(fast).calibrations.store
    store.add(calibration("rig-7"), CalibrationRecord(missing_extra="report"), report={"id": "rig-7"})
    answer = fast.get(f"{CALIBRATIONS}/rig-7/report")
    assert is_problem(answer, 501)
    assert "pip install 'grabberd[report]'" in answer.json()["hint"]
    assert fast.get(f"{CALIBRATIONS}/rig-7/report.json").json() == {"id": "rig-7"}


def test_a_report_that_is_not_there_is_a_problem(fast: TestClient) -> None:
    stored(fast)
    store = service_of(fast).calibrations.store
    store.add(calibration("faulty"), CalibrationRecord(page_problem="KeyError: 'x'"), report={})
    for calibration_id in ("rig-7", CONFIGURED, "faulty", "nothing"):
        assert is_problem(fast.get(f"{CALIBRATIONS}/{calibration_id}/report"), 404)
    assert is_problem(fast.get(f"{CALIBRATIONS}/rig-7/report.json"), 404)


def test_what_is_not_there_is_a_problem_with_a_hint(calibrating: TestClient) -> None:
    capture_id = captured(calibrating)
    for order in (
        {"capture": "nothing"},
        {"capture": "../../etc/passwd"},
        {"capture": capture_id, "calibration_frame": "nothing"},
        {"capture": capture_id, "calibration_frame": "../objects/liner"},
        {"capture": capture_id, "device": "other"},
        {"document": calibration("rig-7"), "device": "other"},
    ):
        assert is_problem(calibrating.post(CALIBRATIONS, json=order), 404), order
    for choice in ({"id": "nothing"}, {"id": "../x"}, {"id": CONFIGURED, "device": "other"}):
        assert is_problem(calibrating.put(f"{CALIBRATIONS}/active", json=choice), 404), choice
    assert is_problem(calibrating.get(f"{CALIBRATIONS}/nothing"), 404)


def test_a_running_capture_is_not_calibrated_from(recording: TestClient) -> None:
    running = recording.post("/api/v1/captures", json={}).json()["id"]
    assert is_problem(recording.post(CALIBRATIONS, json={"capture": running}), 409)


@pytest.mark.parametrize(
    "order",
    [
        {},
        [],
        {"capture": "one", "document": {}},
        {"capture": "x" * 81},
        {"capture": "one", "options": {"weights": "fair"}},
        {"capture": "one", "options": {"free": ["; rm"]}},
        {"capture": "one", "options": {"colour": "red"}},
        {"capture": "one", "calibration_frame": 3},
        {"document": {"id": "one"}, "options": {"tied": True}},
        {"document": {}},
        {"document": calibration("a/b")},
        {"document": calibration("..")},
        {"document": calibration("one", created_utc="yesterday")},
        {"document": calibration("one", extra=1)},
        {"document": calibration("one"), "note": "x" * 2001},
    ],
)
def test_what_cannot_be_meant_is_refused(idle: TestClient, order: Any) -> None:
    assert is_problem(idle.post(CALIBRATIONS, json=order), 422)


@pytest.mark.parametrize("number", ["NaN", "1e999", "-Infinity"])
def test_numbers_that_are_none_are_refused(idle: TestClient, number: str) -> None:
    text = json.dumps({"document": calibration("one", details={"x": 12345})}).replace("12345", number)
    answer = idle.post(CALIBRATIONS, content=text, headers={"Content-Type": "application/json"})
    assert is_problem(answer, 422)


def test_half_a_character_is_refused_and_can_be_quoted(idle: TestClient) -> None:
    document = calibration("one") | {"\ud800": 1, "source": "\ud800"}
    text = json.dumps({"document": document})
    answer = idle.post(CALIBRATIONS, content=text, headers={"Content-Type": "application/json"})
    assert is_problem(answer, 422)


@pytest.mark.parametrize("calibration_id", ["..", "../index", "a/b", "%2e%2e%2findex", "x" * 200, "a.b"])
@pytest.mark.parametrize("what", ["", "/report", "/report.json"])
def test_no_id_reaches_the_file_system(idle: TestClient, calibration_id: str, what: str) -> None:
    assert idle.get(f"{CALIBRATIONS}/{calibration_id}{what}").status_code in (404, 422)


def test_the_daemon_does_not_draw(fast: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reports, "calibration_html", lambda _: pytest.fail("it did"))
    store = service_of(fast).calibrations.store
    store.add(calibration("rig-7"), report={"id": "rig-7"}, page="<p></p>")
    assert fast.get(f"{CALIBRATIONS}/rig-7/report").status_code == 200


def test_one_that_was_rejected_stays_in_the_list_with_its_note(fast: TestClient) -> None:
    stored(fast)
    answer = fast.put(f"{CALIBRATIONS}/rig-7/rejection", json={"note": "the frame was touched"})
    assert answer.status_code == 200
    rows = fast.get(CALIBRATIONS).json()["calibrations"]
    [row] = [row for row in rows if row["id"] == "rig-7"]
    assert row["rejected"]["note"] == "the frame was touched"
    assert not row["active"]
    assert fast.get(f"{CALIBRATIONS}/rig-7").json() == calibration("rig-7")


def test_activating_one_takes_its_rejection_back(fast: TestClient) -> None:
    stored(fast)
    fast.put(f"{CALIBRATIONS}/rig-7/rejection")
    row = fast.put(f"{CALIBRATIONS}/active", json={"id": "rig-7"}).json()
    assert (row["active"], row["rejected"]) == (True, None)


def test_the_active_one_cannot_be_rejected(fast: TestClient) -> None:
    assert is_problem(fast.put(f"{CALIBRATIONS}/{CONFIGURED}/rejection", json={}), 409)
    assert is_problem(fast.put(f"{CALIBRATIONS}/another/rejection", json={}), 404)


def test_a_calibration_that_no_longer_fits_its_device_says_why(fast: TestClient) -> None:
    other = calibration("rig-8", glass={"thickness_mm": 2.0, "refractive_index": 1.52})
    service_of(fast).calibrations.add(other, CalibrationRecord("simulated"))
    stored(fast)
    rows = {row["id"]: row for row in fast.get(CALIBRATIONS).json()["calibrations"]}
    assert "glass" in rows["rig-8"]["misfit"]
    assert rows["rig-7"]["misfit"] is None


def test_a_failed_one_is_refused_and_an_operator_cannot_overrule_that(calibrating: TestClient) -> None:
    assert calibrating.post(CALIBRATIONS, json={"document": failed("rig-7")}).status_code == 201
    answer = calibrating.put(f"{CALIBRATIONS}/active", json={"id": "rig-7"})
    assert is_problem(answer, 409)
    assert "the scale is off" in answer.json()["detail"]
    answer = calibrating.put(f"{CALIBRATIONS}/active", json={"id": "rig-7", "despite_failure": True})
    assert is_problem(answer, 403)
    assert calibrating.get(CALIBRATIONS).json()["calibrations"][0]["verdict"] == "failed"


def test_an_admin_can_use_a_failed_one(tmp_path: Path) -> None:
    setups = set_up(configuration({"pace": "free"}, object=None), default_config_file())
    service = Service(setups, tmp_path)
    service.job_contexts.calibrator = exact
    service.access.open()
    secret = service.access.add("chief", Role.ADMIN)
    with TestClient(create_app(service), "http://localhost", raise_server_exceptions=False) as client:
        wait_until_it_accepts(service)
        client.headers["Authorization"] = f"Bearer {secret}"
        assert client.post(CALIBRATIONS, json={"document": failed("rig-7")}).status_code == 201
        answer = client.put(f"{CALIBRATIONS}/active", json={"id": "rig-7", "despite_failure": True})
        assert (answer.status_code, answer.json()["active"]) == (200, True)
