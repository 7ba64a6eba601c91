"""State, health, and errors of the program itself."""

import pytest
from fastapi.testclient import TestClient


def test_the_daemon_says_that_it_serves(fast: TestClient) -> None:
    assert fast.get("/healthz").json()["status"] == "ok"


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


def test_a_wrong_method_is_a_problem(fast: TestClient) -> None:
    answer = fast.put("/api/v1/captures")
    assert answer.status_code == 405
    assert answer.headers["content-type"] == "application/problem+json"


def test_a_fault_of_the_program_is_a_problem_without_its_insides(
    fast: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = fast.app.state.service  # type: ignore[attr-defined]
    monkeypatch.setattr(service, "state", lambda: 1 / 0)
    answer = fast.get("/api/v1/state")
    assert answer.status_code == 500
    assert answer.json()["detail"] == "ZeroDivisionError while answering"


def test_the_api_describes_itself(fast: TestClient) -> None:
    paths = fast.get("/api/v1/openapi.json").json()["paths"]
    assert "/api/v1/captures/{capture_id}/stop" in paths
