"""Calibration frames over HTTP: those known, and their targets in a capture."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from running import PATIENCE_S, configuration, wait_until_it_accepts

from grabberd.config import default_config_file
from grabberd.instrument.setup import set_up
from grabberd.server.api import create_app
from grabberd.server.daemon.service import Service

FRAMES = "/api/v1/calibration-frames"


@pytest.fixture(params=["calibration_frame", "liner"])
def looking(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[tuple[TestClient, str]]:
    """A client, and what stands before the camera."""
    config = configuration({"pace": "free", "scene": request.param})
    service = Service(set_up(config, default_config_file()), tmp_path)
    with TestClient(create_app(service), "http://localhost", raise_server_exceptions=False) as client:
        wait_until_it_accepts(service)
        yield client, request.param


def identified(client: TestClient, **order: Any) -> dict[str, Any]:
    service: Service = client.app.state.service  # type: ignore[attr-defined]
    capture_id = client.post("/api/v1/captures", json={"fields": 6, "bits": 8}).json()["id"]
    recording = service.instrument(None).captures.recording
    assert recording
    assert recording.sealed.wait(PATIENCE_S)
    asked = client.post(f"/api/v1/captures/{capture_id}/identification", json=order)
    assert asked.status_code == 202, asked.json()
    service.jobs.wait(asked.json()["id"], PATIENCE_S)
    job: dict[str, Any] = client.get(asked.headers["Location"]).json()
    assert (job["kind"], job["subject"], job["state"]) == ("identify", capture_id, "done"), job
    result: dict[str, Any] = job["result"]
    return result


def test_a_capture_shows_its_targets_or_why_not(looking: tuple[TestClient, str]) -> None:
    client, scene = looking
    result = identified(client, calibration_frame="paper-108")
    assert result["of"] == 108
    shown = client.get(f"/api/v1/captures/{result['capture']}/fields/{result['picture']['field']}.png")
    assert shown.headers["content-type"] == "image/png"
    for name, first, end in (("left", 0, 360), ("right", 360, 720)):
        view = result["views"][name]
        assert len(view["found"]) + len(view["missing"]) == 108
        assert all(first <= one["x_px"] < end for one in (*view["found"], *view["other"]))
        assert len(view["found"]) == (108 if scene == "calibration_frame" else 0)
    assert (result["problem"] is None) == (scene == "calibration_frame")


def test_those_that_come_with_the_program_are_listed_by_name(idle: TestClient) -> None:
    [frame] = idle.get(FRAMES).json()["calibration_frames"]
    assert (frame["name"], frame["targets"], frame["target_diameter_mm"]) == ("paper-108", 108, 1.5)
    assert frame["size_mm"] == [107.3, 52.0] or frame["size_mm"][0] > frame["size_mm"][1]


def test_an_unknown_calibration_frame_is_refused_with_those_known(captured: tuple[TestClient, str]) -> None:
    client, capture_id = captured
    order = {"calibration_frame": "another"}
    answer = client.post(f"/api/v1/captures/{capture_id}/identification", json=order)
    assert answer.status_code == 404
    assert "paper-108" in answer.json()["hint"]


def test_an_unknown_capture_is_not_found(idle: TestClient) -> None:
    assert idle.post("/api/v1/captures/another/identification").status_code == 404
