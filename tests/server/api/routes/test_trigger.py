"""Armed captures wait for their trigger, and what was before it belongs to them."""

from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from grabberd.archive.capture.reader import CaptureReader
from grabberd.documents.requests import NewCapture
from server.api.conftest import sealed

CAPTURES = "/api/v1/captures"
LATE_NS = 200_000_000
"""A field's time is that of its exposure; it comes with its frame, and through a busy computer."""
ORDER = {"armed": True, "pre_trigger_fields": 10, "post_trigger_fields": 15}


def armed(client: TestClient, order: Any = None) -> str:
    answer = client.post(CAPTURES, json=order or ORDER)
    assert answer.status_code == 202, answer.json()
    assert answer.json()["state"] == "armed"
    capture_id: str = answer.json()["id"]
    return capture_id


def wait_for_fields(client: TestClient, count: int) -> None:
    """So many fields have come into the ring since it was asked for."""
    service = client.app.state.service  # type: ignore[attr-defined]
    reader = service.instrument(None).pipeline.ring.reader()
    for _ in range(count):
        assert reader.take(10) is not None


def triggered(client: TestClient, capture_id: str) -> Any:
    answer = client.post(f"{CAPTURES}/{capture_id}/trigger")
    assert answer.status_code == 202, answer.json()
    return sealed(client, capture_id)


def test_the_slots_before_the_trigger_belong_to_the_capture(paced: TestClient) -> None:
    capture_id = armed(paced)
    wait_for_fields(paced, 12)
    document = triggered(paced, capture_id)
    assert (document["state"], document["verdict"]) == ("sealed", "complete")
    assert (document["fields"], document["pre_trigger_fields"]) == (25, 10)
    path = paced.app.state.service.archive.path(capture_id)  # type: ignore[attr-defined]
    with CaptureReader(path) as reader:
        trigger, start_ns = reader.meta.extra["trigger"], reader.meta.start_ns
        times = {one.numbered.n: one.numbered.time_ns for one in reader.fields()}
    assert trigger["utc"] == document["trigger_utc"] > trigger["armed_utc"]
    assert trigger["n"] == 10
    assert times[8] < start_ns < times[9] + LATE_NS


def test_until_its_trigger_there_is_nothing_of_it_but_the_promise(paced: TestClient, tmp_path: Path) -> None:
    capture_id = armed(paced)
    document = paced.get(f"{CAPTURES}/{capture_id}").json()
    assert (document["state"], document["fields"], document["size_bytes"]) == ("armed", 0, 0)
    assert [one["id"] for one in paced.get(CAPTURES).json()["captures"]] == [capture_id]
    assert list((tmp_path / "captures").glob("*.grab*")) == []
    for what in ("file", "points", "points.csv", "fields/0.png"):
        assert paced.get(f"{CAPTURES}/{capture_id}/{what}").status_code == 409
    assert paced.delete(f"{CAPTURES}/{capture_id}").status_code == 409


def test_while_one_is_armed_no_other_starts(paced: TestClient) -> None:
    capture_id = armed(paced)
    for order in ({"fields": 5}, ORDER):
        refused = paced.post(CAPTURES, json=order)
        assert (refused.status_code, refused.json()["capture_id"]) == (409, capture_id)


def test_stopping_an_armed_one_leaves_nothing(paced: TestClient, tmp_path: Path) -> None:
    capture_id = armed(paced)
    stopped = paced.post(f"{CAPTURES}/{capture_id}/stop")
    assert (stopped.status_code, stopped.json()["state"]) == (202, "disarmed")
    assert paced.get(f"{CAPTURES}/{capture_id}").status_code == 404
    assert paced.post(f"{CAPTURES}/{capture_id}/trigger").status_code == 404
    assert list((tmp_path / "captures").glob("*.grab*")) == []
    assert paced.post(CAPTURES, json={"fields": 5}).status_code == 202


def test_a_trigger_works_once(paced: TestClient) -> None:
    capture_id = armed(paced)
    triggered(paced, capture_id)
    assert paced.post(f"{CAPTURES}/{capture_id}/trigger").status_code == 409


def test_without_a_length_it_records_until_it_is_stopped(paced: TestClient) -> None:
    capture_id = armed(paced, {"armed": True})
    assert paced.post(f"{CAPTURES}/{capture_id}/trigger").json()["state"] == "recording"
    assert paced.post(f"{CAPTURES}/{capture_id}/stop").status_code == 202
    assert sealed(paced, capture_id)["ended_because"] == "stopped by the operator"


def test_the_ring_is_kept_with_the_bits_it_wants(paced: TestClient) -> None:
    capture_id = armed(paced, {**ORDER, "bits": 4})
    wait_for_fields(paced, 12)
    document = triggered(paced, capture_id)
    assert (document["bits"], document["pre_trigger_fields"], document["fields"]) == (4, 10, 25)


def test_a_source_that_waits_for_its_reader_has_nothing_before_the_trigger(fast: TestClient) -> None:
    document = triggered(fast, armed(fast, {**ORDER, "bits": 2}))
    assert (document["pre_trigger_fields"], document["fields"]) == (0, 15)


def test_more_than_the_ring_has_is_refused(idle: TestClient) -> None:
    for order in ({**ORDER, "pre_trigger_fields": 33}, {"fields": 50, "pre_trigger_fields": 33}):
        refused = idle.post(CAPTURES, json=order)
        assert refused.status_code == 422
        assert "ring.slots" in refused.json()["hint"]


@pytest.mark.parametrize(("rate_hz", "fields"), [(25.0, 8), (50.0, 15), (60_000 / 1001, 18), (120.0, 36)])
@pytest.mark.parametrize("armed", [True, False])
def test_a_length_in_seconds_is_as_many_fields_as_the_device_gives(
    armed: bool, rate_hz: float, fields: int
) -> None:
    asked = NewCapture(armed=armed, duration_s=0.3)
    assert asked.of_rate(rate_hz).fields == fields


@pytest.mark.parametrize(
    "order", [{**ORDER, "fields": 50}, {**ORDER, "duration_s": 1}, {"post_trigger_fields": 5}]
)
def test_what_cannot_be_meant_is_refused(idle: TestClient, order: Any) -> None:
    assert idle.post(CAPTURES, json=order).status_code == 422
