"""A client of the application over a service on the simulated grabber, as fast as its reader goes."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from running import PATIENCE_S, configuration, wait_until_it_accepts

from grabberd.config import LocationConfig, default_config_file
from grabberd.instrument.setup import set_up
from grabberd.server.api import create_app
from grabberd.server.daemon.service import Service


def service_in(folder: Path, **options: object) -> Service:
    """Targets are located in the quickest way: how well is not the subject here."""
    config = configuration(options, location=LocationConfig(method="centroid"))
    return Service(set_up(config, default_config_file()), folder)


@pytest.fixture
def fast(tmp_path: Path) -> Iterator[TestClient]:
    """Captures are over in no time."""
    service = service_in(tmp_path, pace="free")
    with TestClient(create_app(service), "http://localhost", raise_server_exceptions=False) as client:
        wait_until_it_accepts(service)
        yield client


@pytest.fixture(scope="session")
def idle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """Shared by the tests of requests that change nothing."""
    service = service_in(tmp_path_factory.mktemp("idle"), pace="free")
    with TestClient(create_app(service), "http://localhost", raise_server_exceptions=False) as client:
        wait_until_it_accepts(service)
        yield client


@pytest.fixture
def paced(tmp_path: Path) -> Iterator[TestClient]:
    """Captures last as long as they last."""
    service = service_in(tmp_path, pace="real")
    with TestClient(create_app(service), "http://localhost", raise_server_exceptions=False) as client:
        wait_until_it_accepts(service)
        yield client


def sealed(client: TestClient, capture_id: str) -> dict[str, object]:
    """The capture's document once it is sealed."""
    sealed_in(client.app.state.service)  # type: ignore[attr-defined]
    document: dict[str, object] = client.get(f"/api/v1/captures/{capture_id}").json()
    return document


def sealed_in(service: Service) -> None:
    """Waits until the latest capture is sealed."""
    recording = service.instrument(None).captures.recording
    assert recording is not None
    assert recording.sealed.wait(PATIENCE_S)


@pytest.fixture
def captured(fast: TestClient) -> tuple[TestClient, str]:
    """A client and the id of a sealed capture of 20 fields."""
    return fast, _sealed_capture(fast)


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[TestClient, str]]:
    """The same for a file's tests that change nothing of it."""
    service = service_in(tmp_path_factory.mktemp("kept"), pace="free")
    with TestClient(create_app(service), "http://localhost", raise_server_exceptions=False) as client:
        wait_until_it_accepts(service)
        yield client, _sealed_capture(client)


def _sealed_capture(client: TestClient) -> str:
    capture_id: str = client.post("/api/v1/captures", json={"fields": 20, "labels": {"cow": "112"}}).json()[
        "id"
    ]
    sealed(client, capture_id)
    return capture_id
