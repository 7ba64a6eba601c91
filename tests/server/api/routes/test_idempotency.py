"""An order that comes again with its key takes effect once."""

from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from running import wait_until_it_accepts

from grabberd.server.api import create_app
from grabberd.server.api.routes.dependencies import KeptSince
from server.api.conftest import sealed, service_in

CAPTURES = "/api/v1/captures"
KEY = {"Idempotency-Key": "f81d4fae-7dec"}


def count(client: TestClient) -> int:
    return len(client.get(CAPTURES).json()["captures"])


def started(client: TestClient, order: Any = None, key: dict[str, str] = KEY) -> Any:
    return client.post(CAPTURES, json=order or {"fields": 5}, headers=key)


def test_the_same_order_gets_the_same_answer_and_no_second_capture(fast: TestClient) -> None:
    first = started(fast)
    sealed(fast, first.json()["id"])
    again = started(fast)
    assert (again.status_code, again.json()) == (202, first.json())
    assert again.headers["Location"] == first.headers["Location"]
    assert again.headers["Idempotent-Replayed"] == "true"
    assert "Idempotent-Replayed" not in first.headers
    assert count(fast) == 1


def test_it_does_not_matter_how_the_order_is_written(fast: TestClient) -> None:
    first = started(fast, {"fields": 5, "bits": 1})
    sealed(fast, first.json()["id"])
    again = fast.post(
        CAPTURES, content='{ "bits":1,  "fields": 5}', headers={**KEY, "Content-Type": "application/json"}
    )
    assert again.json() == first.json()


def test_another_order_with_the_same_key_is_refused(fast: TestClient) -> None:
    first = started(fast)
    sealed(fast, first.json()["id"])
    refused = started(fast, {"fields": 6})
    assert refused.status_code == 422
    assert refused.json()["type"].endswith("idempotency-key-reused")
    assert count(fast) == 1


def test_another_key_is_another_order(fast: TestClient) -> None:
    sealed(fast, started(fast).json()["id"])
    assert started(fast, key={"Idempotency-Key": "other"}).status_code == 202
    assert count(fast) == 2


def test_a_key_outlives_the_daemon(tmp_path: Path) -> None:
    answers = []
    for _ in range(2):
        service = service_in(tmp_path, pace="free")
        with TestClient(create_app(service), "http://localhost") as client:
            wait_until_it_accepts(service)
            answers.append(started(client).json())
            assert count(client) == 1
    assert answers[0] == answers[1]


def test_orders_that_come_at_once_make_one_capture(paced: TestClient) -> None:
    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda _: started(paced, {}), range(8)))
    assert {answer.status_code for answer in answers} == {202}
    assert len({answer.json()["id"] for answer in answers}) == 1


def test_a_refused_order_may_come_again(paced: TestClient) -> None:
    running = paced.post(CAPTURES, json={}).json()["id"]
    assert started(paced).status_code == 409
    paced.post(f"{CAPTURES}/{running}/stop")
    sealed(paced, running)
    assert started(paced).status_code == 202


def test_an_order_that_was_never_answered_is_not_carried_out_again(fast: TestClient) -> None:
    sealed(fast, started(fast).json()["id"])
    service = fast.app.state.service  # type: ignore[attr-defined]
    with service.idempotency.transaction() as connection:
        connection.execute("UPDATE idempotency SET status = NULL")
    refused = started(fast)
    assert refused.status_code == 409
    assert refused.json()["type"].endswith("outcome-unknown")
    assert count(fast) == 1


def test_keys_belong_to_what_is_ordered(captured: tuple[TestClient, str]) -> None:
    client, capture_id = captured
    jobs = [client.post(f"{CAPTURES}/{capture_id}/measure", headers=KEY).json()["id"] for _ in range(2)]
    assert jobs[0] == jobs[1]
    assert started(client).status_code == 202


@pytest.mark.parametrize("key", ["", "x" * 129, "a b", "ü".encode()])
def test_a_key_that_cannot_be_meant_is_refused(idle: TestClient, key: str | bytes) -> None:
    assert started(idle, {"fields": 0}, {"Idempotency-Key": key}).status_code == 422  # type: ignore[dict-item]
    refused = idle.post(CAPTURES, json={"fields": 5}, headers={"Idempotency-Key": key})  # type: ignore[dict-item]
    assert refused.status_code == 422
    assert "Idempotency-Key" in refused.json()["detail"]


class Steps:
    """Clocks of a computer: time passes for both, and the one of the day can be set."""

    def __init__(self) -> None:
        self.ns, self.utc = 0, datetime(2026, 3, 1, 9, tzinfo=UTC)

    def now_ns(self) -> int:
        return self.ns

    def utc_now(self) -> datetime:
        return self.utc

    def passes(self, time: timedelta) -> None:
        self.ns += round(time.total_seconds() * 1e9)
        self.utc += time


def test_a_clock_that_is_set_on_makes_no_key_older() -> None:
    clock = Steps()
    since, stored = KeptSince(clock), clock.utc
    clock.utc += timedelta(days=9000)
    clock.passes(timedelta(hours=23))
    assert since() < stored
    clock.passes(timedelta(hours=2))
    assert since() > stored


def test_a_clock_that_is_set_back_keeps_keys_for_longer() -> None:
    clock = Steps()
    since = KeptSince(clock)
    clock.utc -= timedelta(days=9000)
    stored = clock.utc
    clock.passes(timedelta(hours=23))
    assert since() < stored
    clock.passes(timedelta(hours=2))
    assert since() > stored
