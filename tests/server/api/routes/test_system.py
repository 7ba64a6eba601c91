"""State, health, and errors of the program itself."""

from dataclasses import replace

import pytest
from fastapi.testclient import TestClient
from slots import ManualClock


def test_the_daemon_says_that_it_serves(fast: TestClient) -> None:
    assert fast.get("/healthz").json()["status"] == "ok"


def test_the_daemon_says_that_it_does_not_go_on_by_itself(
    fast: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = fast.app.state.service  # type: ignore[attr-defined]
    board = service.instrument(None).board
    monkeypatch.setattr(board, "beat", lambda: None)
    monkeypatch.setattr(board, "_clock", ManualClock(2**62))
    for second in range(3):
        service.liveness.look(float(second))
    answer = fast.get("/healthz")
    assert answer.status_code == 503
    assert answer.json()["detail"] == "the capture thread of simulated does not answer"
    state = fast.get("/api/v1/state").json()["devices"]["simulated"]
    assert (state["state"], state["cause_code"]) == ("failed", "capture_stuck")
    assert fast.get("/readyz").status_code == 503


def test_a_glance_shows_every_device_with_its_newest_points(paced: TestClient) -> None:
    service = paced.app.state.service  # type: ignore[attr-defined]
    worker = service.instrument(None).worker
    with worker.published:
        assert worker.published.wait_for(lambda: worker.live is not None, 30)
    state = paced.get("/api/v1/state").json()
    device = state["devices"]["simulated"]
    assert device["state"] == "ready"
    assert device["live"]["points"] > 60
    assert device["ring"]["slots"] == 32
    assert paced.get("/api/v1/devices/simulated").json()["name"] == "simulated"


def test_a_device_says_what_was_done_to_have_it_deliver(fast: TestClient) -> None:
    device = fast.get("/api/v1/devices/simulated").json()
    assert device["recoveries"] == {"restart": 0, "reopen": 0, "reset": 0, "retry": 0}
    assert (device["last_failure"], device["last_failure_utc"], device["hint"]) == (None, None, None)


def test_what_a_person_has_to_know_of_a_device_is_among_its_warnings(fast: TestClient) -> None:
    board = fast.app.state.service.instrument(None).board  # type: ignore[attr-defined]
    board.opened(replace(board.now.stream, remarks=("This grabber delivers 25 fields a second.",)))
    assert fast.get("/api/v1/state").json()["devices"]["simulated"]["warnings"] == [
        "This grabber delivers 25 fields a second."
    ]


def test_a_wrong_method_is_a_problem(fast: TestClient) -> None:
    answer = fast.put("/api/v1/captures")
    assert answer.status_code == 405
    assert answer.headers["content-type"] == "application/problem+json"


def test_a_fault_of_the_program_is_a_problem_without_its_insides(
    fast: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = fast.app.state.snapshots.state  # type: ignore[attr-defined]
    monkeypatch.setattr(state, "_make", lambda: 1 / 0)
    answer = fast.get("/api/v1/state")
    assert answer.status_code == 500
    assert answer.json()["detail"] == "ZeroDivisionError while responding"


def test_the_api_describes_itself(idle: TestClient) -> None:
    paths = idle.get("/api/v1/openapi.json").json()["paths"]
    assert "/api/v1/captures/{capture_id}/stop" in paths
