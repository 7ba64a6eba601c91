"""The service's memory is used up: the kernel kills the job, and the capture beside it goes on."""

from collections.abc import Iterator

import pytest

from proofs.vm.guest import client, unit
from proofs.vm.machine import Machine
from proofs.vm.tables import Tables

ROOM_BYTES = 40_000_000
"""Less than a process of jobs takes to start."""


@pytest.fixture
def short_of_memory(service: Machine) -> Iterator[Machine]:
    """The service; afterwards it has the memory of its unit."""
    yield service
    service.call(unit.limit_memory, more_bytes=None)


def test_where_memory_is_used_up_the_job_is_killed_and_the_capture_goes_on(
    short_of_memory: Machine, service_tables: Tables
) -> None:
    machine = short_of_memory
    pid, killed = machine.call(unit.main_pid), machine.call(unit.count_killed_for_memory)
    earlier = machine.call(client.capture, fields=25)["id"]
    capture_id = machine.call(client.running, fields=25)
    machine.call(unit.limit_memory, more_bytes=ROOM_BYTES)
    ordered = machine.call(client.ask, path=f"/api/v1/captures/{earlier}/analysis", body={})
    assert ordered["status"] == 202, ordered
    job = machine.call(client.job_ended, job_id=ordered["document"]["id"], timeout_s=600)
    machine.call(client.until_received, capture_id=capture_id, fields=_received(machine, capture_id) + 50)
    document = machine.call(client.stopped, capture_id=capture_id)
    service_tables.add(
        "Memory that is used up",
        "MemoryMax= of the service is set to 40 MB more than its programs hold, in the midst of a capture.",
        the_job=f"{job['state']}: {job['problem']['message']}",
        killed=machine.call(unit.count_killed_for_memory) - killed,
        the_capture=document["verdict"],
    )
    assert job["state"] == "failed"
    assert "memory" in job["problem"]["message"] + job["problem"]["hint"]
    assert machine.call(unit.main_pid) == pid
    assert document["state"] == "sealed", document


def _received(machine: Machine, capture_id: str) -> int:
    """How many it has so far."""
    count: int = machine.call(client.received, capture_id=capture_id)
    return count
