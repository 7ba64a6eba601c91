"""One calibration from captures of the calibration frame in several poses, over HTTP."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from calibrators import exact
from fastapi.testclient import TestClient

from grabberd.documents.requests import CalibrationOptions
from grabberd.library.jobs.calibration_jobs import CalibrationJob
from server.api.routes.test_calibrations import CALIBRATIONS, captured, client_of, is_problem, service_of

pytestmark = pytest.mark.usefixtures("importable")
"""By the job process, whose calibrator is one of the tests."""


@pytest.fixture
def calibrating(tmp_path: Path) -> Iterator[TestClient]:
    """Captures are over in no time, and the calibrator knows the answer."""
    with client_of(tmp_path, "free", exact) as client:
        yield client


def made_from(client: TestClient, order: dict[str, Any]) -> dict[str, Any]:
    """The job that calibrates, and the details of the calibration that it made."""
    answer = client.post(CALIBRATIONS, json=order)
    assert answer.status_code == 202, answer.json()
    service_of(client).jobs.wait(answer.json()["id"], 60)
    job = client.get(answer.headers["Location"]).json()
    assert job["state"] == "done", job
    document = client.get(f"{CALIBRATIONS}/{job['result']['calibration']}").json()
    return {"subject": job["subject"], **document["details"]}


def test_captures_of_several_poses_make_one_calibration_in_their_order(calibrating: TestClient) -> None:
    poses = [captured(calibrating) for _ in range(3)]
    order = [poses[1], poses[0], poses[2]]
    made = made_from(calibrating, {"captures": order, "note": "three poses"})
    assert (made["subject"], made["captures"], made["note"]) == (order[0], order, "three poses")
    rows = calibrating.get(CALIBRATIONS).json()["calibrations"]
    assert [row["capture"] for row in rows if row["note"] == "three poses"] == [order[0]]


def test_a_single_capture_may_be_named_either_way(calibrating: TestClient) -> None:
    one, other = captured(calibrating), captured(calibrating)
    assert made_from(calibrating, {"capture": one})["captures"] == [one]
    assert made_from(calibrating, {"captures": [other]})["captures"] == [other]


def test_every_capture_has_to_be_there_and_none_may_run(tmp_path: Path) -> None:
    with client_of(tmp_path, "real", exact) as client:
        first = captured(client)
        assert is_problem(client.post(CALIBRATIONS, json={"captures": [first, "nothing"]}), 404)
        running = client.post("/api/v1/captures", json={}).json()["id"]
        assert is_problem(client.post(CALIBRATIONS, json={"captures": [first, running]}), 409)


@pytest.mark.parametrize(
    "order",
    [
        {"captures": []},
        {"captures": ["a", "b", "a"]},
        {"captures": ["../a"]},
        {"captures": [f"c{n}" for n in range(17)]},
        {"captures": ["a"], "capture": "a"},
        {"captures": ["a"], "document": {}},
    ],
)
def test_what_cannot_be_meant_is_refused(idle: TestClient, order: dict[str, Any]) -> None:
    assert is_problem(idle.post(CALIBRATIONS, json=order), 422)


def test_a_job_names_the_captures_of_all_its_poses_so_that_they_are_kept_until_it_has_ended() -> None:
    frame: dict[str, Any] = {"targets": []}
    job = CalibrationJob(
        subject="a", further=("b", "c"), calibration_frame=frame, options=CalibrationOptions(), device="x"
    )
    assert job.captures == ("a", "b", "c")


def test_a_job_that_was_stored_by_an_earlier_version_has_one_capture() -> None:
    stored = {"subject": "a", "calibration_frame": {}, "options": {}, "device": "x"}
    assert CalibrationJob.model_validate(stored).captures == ("a",)
