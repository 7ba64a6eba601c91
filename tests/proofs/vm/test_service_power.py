"""The power goes while a capture runs."""

from proofs.vm.guest import client, unit
from proofs.vm.installed import Installed
from proofs.vm.tables import Tables
from proofs.vm.test_service_death import RATE_HZ


def test_a_power_cut_costs_at_most_the_last_second_and_the_service_starts_at_boot(
    installed: Installed, service_tables: Tables
) -> None:
    machine = installed.machine
    machine.call(unit.until_ready, timeout_s=600)
    machine.call(unit.settle_disks)
    capture_id = machine.call(client.running, fields=150)
    machine.call(client.write_clock, path="/share/clock")
    machine.call(client.until_received, capture_id=capture_id, fields=200)
    cut_ns = int(installed.power_cut().split()[-2])
    installed.boot()
    seconds = installed.machine.call(unit.until_ready, timeout_s=600)
    document = installed.machine.call(client.sealed, capture_id=capture_id)
    inside = installed.machine.call(client.inside, capture_id=capture_id)
    lost_s = (cut_ns - inside["last_ns"]) / 1e9
    service_tables.add(
        "A power cut during a capture",
        "The machine loses its power at once and is booted again from its disks.",
        ready_after_boot=f"{seconds:.0f} s",
        recorded=inside["received"],
        lost=round(lost_s * RATE_HZ),
        integrity_check=inside["integrity"],
        verdict=document["verdict"],
    )
    assert (document["state"], document["verdict"]) == ("sealed", "incomplete"), document
    assert inside["integrity"] == "ok"
    assert inside["received"] >= 150
    assert inside["last_n"] == inside["received"] - 1
    assert lost_s <= 1.0
    assert capture_id in installed.machine.call(client.listed)
