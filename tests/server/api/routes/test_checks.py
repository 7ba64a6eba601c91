"""A check over HTTP."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from running import PATIENCE_S, configuration, wait_until_it_accepts

from grabberd.config import default_config_file
from grabberd.instrument.setup import set_up
from grabberd.server.api import create_app
from grabberd.server.daemon.service import Service


@pytest.fixture
def before_the_frame(tmp_path: Path) -> Iterator[TestClient]:
    config = configuration({"pace": "free", "scene": "calibration_frame"})
    service = Service(set_up(config, default_config_file()), tmp_path)
    with TestClient(create_app(service), "http://localhost", raise_server_exceptions=False) as client:
        wait_until_it_accepts(service)
        yield client


def test_a_check_is_a_job_with_a_verdict(before_the_frame: TestClient) -> None:
    order = {"duration_s": 0.4, "in_place": True}
    asked = before_the_frame.post("/api/v1/devices/simulated/check", json=order)
    assert asked.status_code == 202
    assert asked.headers["Location"].endswith(f"/api/v1/jobs/{asked.json()['id']}")
    service = before_the_frame.app.state.service  # type: ignore[attr-defined]
    service.jobs.wait(asked.json()["id"], PATIENCE_S)
    result = before_the_frame.get(f"/api/v1/jobs/{asked.json()['id']}").json()["result"]
    assert result["verdict"] == "fits"
    assert result["in_place"]


def test_an_unknown_device_is_not_found(idle: TestClient) -> None:
    assert idle.post("/api/v1/devices/another/check").status_code == 404
