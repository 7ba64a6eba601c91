"""Documents that are made once for everybody who asks meanwhile, and never hide what somebody changed."""

import asyncio
import threading
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from pydantic import BaseModel
from running import PATIENCE_S

from grabberd.documents.enums import Role
from grabberd.documents.points_frame import NewestPoints
from grabberd.documents.state import HealthDocument, SettingsDocument, StateDocument
from grabberd.server.api import create_app, snapshots
from grabberd.server.api.snapshots import STATE_S, Shared, Snapshot, Snapshots
from grabberd.server.daemon.service import Service
from server.api.conftest import sealed, service_in
from server.api.gates import Ticks, is_problem

STATE, POINTS = "/api/v1/state", "/api/v1/devices/simulated/points"
DOCUMENTS = {
    STATE: StateDocument,
    POINTS: NewestPoints,
    "/api/v1/settings": SettingsDocument,
    "/healthz": HealthDocument,
}


class Numbered(BaseModel):
    number: int


class Maker:
    """Makes numbered documents, or fails."""

    def __init__(self) -> None:
        self.revision = 0
        self.clock = Ticks()
        self.fault: Exception | None = None
        self.may_go_on = threading.Event()
        self.may_go_on.set()
        self._numbers = count(1)
        self.shared = Shared(self.make, lambda: self.revision, 1.0, self.clock)

    def make(self) -> Numbered:
        self.may_go_on.wait(10)
        if self.fault is not None:
            raise self.fault
        return Numbered(number=next(self._numbers))

    async def number(self) -> int:
        return Numbered.model_validate_json((await self.shared.get()).content).number


@pytest.fixture
def maker() -> Maker:
    return Maker()


def test_all_who_ask_at_the_same_time_get_one_document(maker: Maker) -> None:
    async def ask() -> list[int]:
        return await asyncio.gather(*(maker.number() for _ in range(20)))

    assert asyncio.run(ask()) == [1] * 20


def test_it_is_made_again_when_it_is_old(maker: Maker) -> None:
    async def ask() -> list[int]:
        numbers = [await maker.number()]
        for seconds in (0.9, 0.2):
            maker.clock.now_s += seconds
            numbers.append(await maker.number())
        return numbers

    assert asyncio.run(ask()) == [1, 1, 2]


def test_a_change_is_in_it_though_one_is_being_made(maker: Maker) -> None:
    async def ask() -> tuple[int, int]:
        maker.may_go_on.clear()
        before = asyncio.create_task(maker.number())
        await asyncio.sleep(0.05)
        maker.revision += 1
        after = asyncio.create_task(maker.number())
        await asyncio.sleep(0.05)
        maker.may_go_on.set()
        return await before, await after

    assert sorted(asyncio.run(ask())) == [1, 2]


def test_what_fails_is_tried_again_by_the_next_who_asks(maker: Maker) -> None:
    async def ask() -> int:
        maker.fault = OSError("the disk is gone")
        with pytest.raises(OSError, match="gone"):
            await maker.number()
        maker.fault = None
        return await maker.number()

    assert asyncio.run(ask()) == 1


def test_one_who_leaves_does_not_take_it_from_the_others(maker: Maker) -> None:
    async def ask() -> int:
        maker.may_go_on.clear()
        first, second = (asyncio.create_task(maker.number()) for _ in range(2))
        await asyncio.sleep(0.05)
        first.cancel()
        await asyncio.sleep(0.05)
        maker.may_go_on.set()
        return await second

    assert asyncio.run(ask()) == 1


def test_its_etag_is_that_of_its_content() -> None:
    one, same, other = (Snapshot.of(Numbered(number=number)) for number in (1, 1, 2))
    assert one == same
    assert one.etag != other.etag
    assert one.response(None).body == b'{"number":1}'
    assert one.response(one.etag).status_code == 304
    assert one.response(other.etag).status_code == 200


@pytest.fixture
def paced(paced: TestClient) -> TestClient:
    """It has measured a field."""
    worker = service_of(paced).instrument(None).worker
    with worker.published:
        assert worker.published.wait_for(lambda: worker.live is not None, PATIENCE_S)
    return paced


def service_of(client: TestClient) -> Service:
    service: Service = client.app.state.service  # type: ignore[attr-defined]
    return service


def captured_id(client: TestClient) -> Any:
    [device] = client.get(STATE).json()["devices"].values()
    return device["capture_id"]


def test_who_changes_something_finds_it_in_the_next_state(paced: TestClient) -> None:
    paced.app.state.snapshots.state._life_s = 3600.0  # type: ignore[attr-defined]
    assert captured_id(paced) is None
    for threshold in (90, 70):
        capture_id = paced.post("/api/v1/captures", json={}).json()["id"]
        assert captured_id(paced) == capture_id
        paced.post(f"/api/v1/captures/{capture_id}/stop")
        sealed(paced, capture_id)
        assert captured_id(paced) is None
        new = {"device": "simulated", "threshold": {"kind": "fixed", "value": threshold}}
        assert paced.put("/api/v1/settings", json=new).status_code == 200
        assert paced.get(STATE).json()["devices"]["simulated"]["ring"]["threshold"] == threshold


def test_the_state_is_not_older_than_a_fifth_of_a_second(paced: TestClient) -> None:
    before = paced.get(STATE).json()["devices"]["simulated"]["live"]["n"]
    worker = service_of(paced).instrument(None).worker
    with worker.published:
        assert worker.published.wait_for(lambda: worker.live and worker.live.measured.n > before, PATIENCE_S)
    threading.Event().wait(STATE_S)
    assert paced.get(STATE).json()["devices"]["simulated"]["live"]["n"] > before


def test_the_points_are_made_once_a_field(paced: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []
    make: Callable[..., NewestPoints] = snapshots.newest_points

    def counted(*arguments: Any) -> NewestPoints:
        document = make(*arguments)
        made.append(document.n)
        return document

    monkeypatch.setattr(snapshots, "newest_points", counted)
    for _ in range(100):
        paced.get(POINTS)
    assert 0 < len(made) == len(set(made)) < 100


@pytest.mark.parametrize("path", DOCUMENTS)
def test_a_shortcut_is_a_described_route_with_that_document(
    paced: TestClient, idle: TestClient, path: str
) -> None:
    answer = paced.get(path)
    assert answer.headers["content-type"] == "application/json"
    DOCUMENTS[path].model_validate_json(answer.content)
    described = idle.get("/api/v1/openapi.json").json()["paths"][path.replace("simulated", "{name}")]
    schema = described["get"]["responses"]["200"]["content"]["application/json"]["schema"]
    assert schema["$ref"].endswith(f"/{DOCUMENTS[path].__name__}")


@pytest.mark.parametrize("path", [STATE, POINTS])
def test_what_the_client_has_is_not_sent_again(paced: TestClient, path: str) -> None:
    known = {paced.get(path).headers["etag"]}
    statuses = set()
    for _ in range(20):
        again = paced.get(path, headers={"If-None-Match": ", ".join(known)})
        assert (again.status_code == 304) == (again.headers["etag"] in known)
        known.add(again.headers["etag"])
        statuses.add(again.status_code)
    assert 304 in statuses


def test_shortcuts_lie_behind_the_gate(tmp_path: Path) -> None:
    service = service_in(tmp_path, pace="free")
    with TestClient(create_app(service), "http://localhost") as client:
        secret = service.access.add("tablet", Role.VIEWER)
        for path in client.app.state.snapshots.shortcuts():  # type: ignore[attr-defined]
            if path != "/healthz":
                assert is_problem(client.get(path), 401, "unauthorized")
                assert client.get(path, headers={"Host": "evil.example"}).status_code == 421
                assert client.get(path, headers={"Origin": "http://evil.example"}).status_code == 403
        headers = {"Authorization": f"Bearer {secret}"}
        assert client.get(STATE, headers=headers).status_code == 200
        service.access.remove("tablet")
        assert client.get(STATE, headers=headers).status_code == 401


def test_where_there_is_no_snapshot_the_route_says_why(tmp_path: Path) -> None:
    service = service_in(tmp_path, pace="free")
    service.access.open()
    client = TestClient(create_app(service), "http://localhost")  # the service has not been started
    assert is_problem(client.get(POINTS), 409, "not-ready")


@pytest.mark.parametrize("path", DOCUMENTS)
def test_the_route_answers_as_its_shortcut_does(
    paced: TestClient, path: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Snapshots, "shortcuts", lambda _: {})
    routed = TestClient(create_app(service_of(paced)), "http://localhost").get(path)
    short = paced.get(path)
    assert routed.status_code == short.status_code == 200
    assert routed.headers["content-type"] == short.headers["content-type"]
    assert routed.json().keys() == short.json().keys()
    if path in ("/healthz", "/api/v1/settings"):
        assert routed.json() == short.json()
    else:
        assert {"etag", "cache-control"} <= routed.headers.keys() & short.headers.keys()
