"""The daemon is killed, or stands still, in mid-capture: systemd starts it again, it seals what it left."""

import pytest

from proofs.vm.guest import client, unit
from proofs.vm.machine import Machine
from proofs.vm.tables import Tables

NOTE = (
    "During a capture at 50 Hz, under the unit as shipped (watchdog 30 s, restart after 5 s). "
    "Lost: fields between the last one in the file and the event."
)
TITLE = "The daemon is killed or hangs during a capture"
RATE_HZ = 50
WATCHDOG_S = 30


@pytest.mark.parametrize(("name", "what"), [("SIGKILL", "killed"), ("SIGSTOP", "hangs")])
def test_a_daemon_that_is_gone_comes_back_and_at_most_the_last_second_is_missing(
    service: Machine, service_tables: Tables, name: str, what: str
) -> None:
    capture_id = service.call(client.running, fields=150)
    struck = service.call(unit.struck, name=name, timeout_s=600)
    document = service.call(client.sealed, capture_id=capture_id)
    inside = service.call(client.inside, capture_id=capture_id)
    lost_s = (struck["at_ns"] - inside["last_ns"]) / 1e9
    service_tables.add(
        TITLE,
        NOTE,
        what=f"the daemon is {what}" if name == "SIGKILL" else f"the daemon {what}",
        ended_after=f"{struck['gone_s']:.1f} s",
        ready_again_after=f"{struck['back_s']:.1f} s",
        recorded=inside["received"],
        lost=round(lost_s * RATE_HZ),
    )
    assert struck["restarts"] >= 1
    assert (struck["gone_s"] > WATCHDOG_S / 2) == (name == "SIGSTOP")
    assert (document["state"], document["verdict"]) == ("sealed", "incomplete"), document
    assert inside["integrity"] == "ok"
    # A host that stands still for a second costs fields in mid-capture; the ledger then has each of them.
    entries = document["ledger"]["entries"]
    named = sum(entry["count"] for entry in entries if entry["first_n"] < inside["last_n"])
    assert inside["last_n"] + 1 == inside["received"] + named, (inside, entries)
    assert inside["received"] > 100
    assert 0 <= lost_s <= 1.0
    assert capture_id in service.call(client.listed)
