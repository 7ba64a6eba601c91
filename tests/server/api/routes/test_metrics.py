"""Numbers for Prometheus."""

import threading

from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families

from grabberd.documents.enums import DeviceState
from server.api.conftest import sealed


def metrics(client: TestClient) -> dict[tuple[str, ...], float]:
    """Every sample, by its name and the values of its labels."""
    answer = client.get("/metrics")
    assert answer.headers["content-type"].startswith("text/plain")
    families = text_string_to_metric_families(answer.text)
    return {
        (sample.name, *sample.labels.values()): sample.value
        for family in families
        for sample in family.samples
    }


def test_fields_are_counted_by_what_became_of_them(captured: tuple[TestClient, str]) -> None:
    found = metrics(captured[0])
    assert found["grabberd_fields_total", "simulated", "received"] >= 20
    assert found["grabberd_fields_total", "simulated", "lost"] == 0


def test_a_device_is_in_one_state_and_was_opened_once(idle: TestClient) -> None:
    found = metrics(idle)
    states = {state: found["grabberd_device_state", "simulated", state] for state in DeviceState}
    assert sum(states.values()) == states[DeviceState.READY] == 1
    assert found["grabberd_device_openings_total", "simulated"] == 1
    assert found["grabberd_device_recoveries_total", "simulated", "reset"] == 0


def test_captures_are_counted_by_their_verdict(captured: tuple[TestClient, str]) -> None:
    client, _ = captured
    first = metrics(client)
    assert first["grabberd_captures_total", "simulated", "complete"] == 1
    verdicts = ("measured_well", "measured_with_gaps", "not_measured")
    assert sum(first["grabberd_captures_measured_total", "simulated", one] for one in verdicts) == 1
    assert first["grabberd_capture_running", "simulated"] == 0
    sealed(client, client.post("/api/v1/captures", json={"fields": 5}).json()["id"])
    assert metrics(client)["grabberd_captures_total", "simulated", "complete"] == 2


def test_the_ring_the_disk_and_the_process_are_seen(idle: TestClient) -> None:
    found = metrics(idle)
    assert found["grabberd_ring_slots", "simulated"] == 32
    assert 0 <= found["grabberd_ring_waiting_slots", "simulated"] <= 32
    assert found["grabberd_disk_free_bytes",] > 0
    assert found["process_resident_memory_bytes",] > 1e6
    assert found["grabberd_streams",] == 0


def test_the_latency_is_a_histogram(paced: TestClient) -> None:
    worker = paced.app.state.service.instrument(None).worker  # type: ignore[attr-defined]
    with worker.published:
        assert worker.published.wait_for(lambda: worker.live is not None, 30)
    found = metrics(paced)
    assert found["grabberd_latency_seconds_bucket", "simulated", "+Inf"] >= 1
    assert found["grabberd_latency_seconds_sum", "simulated"] > 0


def test_two_who_ask_at_once_are_both_answered(idle: TestClient) -> None:
    threads = [threading.Thread(target=lambda: answers.append(metrics(idle))) for _ in range(2)]
    answers: list[dict[tuple[str, ...], float]] = []
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(answers) == 2
