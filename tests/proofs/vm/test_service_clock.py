"""The time of day is set while a capture runs: by a time server that was found at last, or by hand."""

from collections.abc import Iterator

import pytest

from proofs.vm.guest import client, unit
from proofs.vm.machine import Machine
from proofs.vm.tables import Tables

FIELDS = 200


@pytest.fixture
def clock_restored(service: Machine) -> Iterator[list[float]]:
    """Hours by which the clock was set; they are taken back."""
    steps: list[float] = []
    yield steps
    service.call(unit.step_clock, hours=-sum(steps))


@pytest.mark.parametrize("hours", [1.0, -1.0])
def test_a_stepped_clock_costs_no_field_and_leaves_the_numbering_alone(
    service: Machine, service_tables: Tables, clock_restored: list[float], hours: float
) -> None:
    begun = service.call(client.begin, fields=FIELDS)["document"]
    service.call(client.until_received, capture_id=begun["id"], fields=50)
    clock_restored.append(hours)
    service.call(unit.step_clock, hours=hours)
    document = service.call(client.sealed, capture_id=begun["id"])
    inside = service.call(client.inside, capture_id=begun["id"])
    service_tables.add(
        "Clock set during a capture",
        "Captures of 200 fields; the time of day was set after 50.",
        hours=f"{hours:+.0f}",
        ledger=document["ledger"]["in_words"],
        last_number=inside["last_n"],
    )
    assert document["verdict"] == "complete", document
    assert (inside["received"], inside["last_n"]) == (FIELDS, FIELDS - 1)


def test_a_capture_is_stopped_while_the_clock_is_set(service: Machine, clock_restored: list[float]) -> None:
    capture_id = service.call(client.running, fields=25)
    for hours in (1.0, -2.0):
        clock_restored.append(hours)
        service.call(unit.step_clock, hours=hours)
    document = service.call(client.stopped, capture_id=capture_id)
    assert document["verdict"] == "complete", document
    assert document["ended_because"] == "stopped by the operator"
    assert service.call(unit.idle, seconds=35.0)["ActiveState"] == "active"
