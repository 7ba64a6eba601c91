"""Calibration frames over HTTP: those known, and their targets in a capture."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from running import PATIENCE_S, configuration, wait_until_it_accepts

from grabberd.config import default_config_file, shipped_configs
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


@pytest.fixture
def beside(tmp_path: Path) -> Iterator[tuple[TestClient, Path]]:
    """A client, and the file of a calibration frame beside the configuration; nothing is captured."""
    file = tmp_path / "calibration-frames" / "of-the-barn.yaml"
    file.parent.mkdir()
    shutil.copy(shipped_configs() / "calibration-frames" / "paper-108.yaml", file)
    config = configuration({"pace": "free"}).model_copy(update={"state_directory": tmp_path})
    service = Service.from_config(
        config, set_up(config, default_config_file()), file=tmp_path / "grabberd.yaml"
    )
    with TestClient(create_app(service), "http://localhost", raise_server_exceptions=False) as client:
        yield client, file


def test_those_beside_the_configuration_take_the_place_of_the_programs(
    beside: tuple[TestClient, Path],
) -> None:
    client, file = beside
    [frame] = client.get(FRAMES).json()["calibration_frames"]
    assert (frame["name"], frame["targets"]) == ("of-the-barn", 108)
    file.unlink()
    [frame] = client.get(FRAMES).json()["calibration_frames"]
    assert frame["name"] == "paper-108"


def test_a_file_with_a_fault_is_named_with_the_fault_beside_the_good_ones(
    beside: tuple[TestClient, Path],
) -> None:
    client, file = beside
    wrong, away = file.with_name("wrong.yaml"), file.with_name("away.yaml")
    wrong.write_text(file.read_text("utf-8").replace("x_mm", "x_cm"), "utf-8")
    away.symlink_to(file.with_name("nowhere"))
    answer = client.get(FRAMES)
    assert answer.status_code == 200
    assert [one["name"] for one in answer.json()["calibration_frames"]] == ["of-the-barn"]
    first, second = answer.json()["unusable"]
    assert (first["name"], second["name"]) == ("away", "wrong")
    assert "No such file" in first["problem"]
    assert str(wrong) in second["problem"]
    assert "x_mm" in second["problem"]


def test_many_are_listed_page_by_page(beside: tuple[TestClient, Path]) -> None:
    client, file = beside
    for name in ("\u00c5 b~c.yaml", "z.yaml"):
        shutil.copy(file, file.with_name(name))
    file.with_name("bad.yaml").write_text("[]")
    names, cursor = [], ""
    while cursor is not None:
        page = client.get(FRAMES, params={"limit": 1, **({"cursor": cursor} if cursor else {})}).json()
        [one] = page["calibration_frames"] + page["unusable"]
        names.append(one["name"])
        cursor = page["next"]
    assert sorted(names) == ["bad", "of-the-barn", "z", "\u00c5 b~c"]


def test_a_check_with_an_unknown_calibration_frame_captures_nothing(
    looking: tuple[TestClient, str],
) -> None:
    client, _ = looking
    answer = client.post("/api/v1/devices/simulated/check", json={"calibration_frame": "another"})
    assert answer.status_code == 404
    assert client.get("/api/v1/captures").json()["captures"] == []


def test_an_unknown_calibration_frame_is_refused_with_those_known(captured: tuple[TestClient, str]) -> None:
    client, capture_id = captured
    order = {"calibration_frame": "another"}
    answer = client.post(f"/api/v1/captures/{capture_id}/identification", json=order)
    assert answer.status_code == 404
    assert "paper-108" in answer.json()["hint"]


def test_an_unknown_capture_is_not_found(idle: TestClient) -> None:
    assert idle.post("/api/v1/captures/another/identification").status_code == 404
