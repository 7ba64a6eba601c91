"""The disk of the captures is full, or the kernel finds it faulty and lets nobody write it."""

from collections.abc import Iterator

import pytest

from proofs.vm.guest import client, unit
from proofs.vm.machine import Machine
from proofs.vm.tables import Tables

TITLE = "Full or faulty disk"
BELOW_RESERVE = 150_000_000
LAST_SECOND = 50
"""Fields that were not committed yet have no room where there is none at all."""


@pytest.fixture
def room(service: Machine) -> Iterator[Machine]:
    """The service; afterwards its disk has room again."""
    yield service
    service.call(unit.free_disk)


@pytest.mark.parametrize("leave_bytes", [BELOW_RESERVE, 0])
def test_a_disk_that_fills_ends_the_capture_with_all_that_was_recorded(
    room: Machine, service_tables: Tables, leave_bytes: int
) -> None:
    pid = room.call(unit.main_pid)
    capture_id = room.call(client.running, fields=100)
    room.call(unit.fill_disk, leave_bytes=leave_bytes)
    document = room.call(client.sealed, capture_id=capture_id)
    refused = room.call(client.begin, fields=100)
    inside = room.call(client.inside, capture_id=capture_id)
    room.call(unit.free_disk)
    service_tables.add(
        TITLE,
        what="fills up to the reserve" if leave_bytes else "fills up to the last byte",
        the_capture=f"{document['verdict']}: {document['ended_because']}",
        ledger=document["ledger"]["in_words"],
        the_next_one=f"{refused['status']}: {refused['document'].get('detail')}",
    )
    assert (document["state"], document["verdict"]) == ("sealed", "incomplete")
    assert inside["received"] == document["ledger"]["counts"]["received"]
    assert inside["received"] >= (100 if leave_bytes else 100 - LAST_SECOND)
    assert inside["integrity"] == "ok"
    assert refused["status"] == 507
    assert refused["document"]["hint"]
    assert room.call(client.capture, fields=25)["verdict"] == "complete"
    assert room.call(unit.main_pid) == pid


@pytest.fixture
def mended(service: Machine) -> Iterator[Machine]:
    """The service; afterwards its disk has been checked, and it runs again."""
    yield service
    service.call(unit.mend_disk, timeout_s=600)
    service.call(unit.systemctl, verb="start", timeout_s=600)
    service.call(unit.until_ready, timeout_s=600)


def test_a_faulty_disk_is_told_to_the_operator_and_mending_it_seals_what_was_recorded(
    mended: Machine, service_tables: Tables
) -> None:
    pid = mended.call(unit.main_pid)
    capture_id = mended.call(client.running, fields=150)
    broken_ns = mended.call(unit.break_disk)
    seen = mended.call(client.ask_until, path=f"/api/v1/captures/{capture_id}", not_state="recording")
    refused = mended.call(client.begin, fields=100)
    still = mended.call(unit.main_pid)
    mended.call(unit.mend_disk, timeout_s=600)
    mended.call(unit.systemctl, verb="start", timeout_s=600)
    mended.call(unit.until_ready, timeout_s=600)
    document = mended.call(client.sealed, capture_id=capture_id)
    inside = mended.call(client.inside, capture_id=capture_id)
    lost_s = (broken_ns - inside["last_ns"]) / 1e9
    service_tables.add(
        TITLE,
        what="becomes read-only",
        the_capture=f"{document['verdict']}: {document['ended_because']}",
        ledger=document["ledger"]["in_words"],
        the_next_one=f"{refused['status']}: {refused['document'].get('detail')}",
    )
    assert still == pid, seen
    assert refused["status"] == 507
    assert refused["document"]["hint"]
    assert (document["state"], document["verdict"]) == ("sealed", "incomplete")
    assert inside["integrity"] == "ok"
    assert lost_s <= 1.0


@pytest.fixture
def read_only(service: Machine) -> Iterator[Machine]:
    """The service, stopped, with a disk that nobody can write; afterwards as before."""
    service.call(unit.systemctl, verb="stop")
    service.call(unit.mount_read_only, wanted=True)
    yield service
    service.call(unit.mount_read_only, wanted=False)
    service.call(unit.systemctl, verb="start", timeout_s=600)
    service.call(unit.until_ready, timeout_s=600)


def test_on_a_read_only_disk_the_service_ends_once_and_says_why(
    read_only: Machine, service_tables: Tables
) -> None:
    read_only.call(unit.systemctl, verb="start", timeout_s=600)
    failed = read_only.call(unit.until_failed, timeout_s=600)
    later = read_only.call(unit.idle, seconds=60.0)
    journal = read_only.call(unit.journal)
    assert failed["ExecMainStatus"] == "74", journal
    assert (later["ActiveState"], later["NRestarts"], later["MainPID"]) == ("failed", "0", "0")
    assert "Read-only file system" in journal
    assert "hint: " in journal
    service_tables.add(
        "Failed starts",
        what="a disk that is read-only",
        exit_code=failed["ExecMainStatus"],
        restarts=later["NRestarts"],
        the_journal_names="the file, and what to do",
    )
