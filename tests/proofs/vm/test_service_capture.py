"""Captures over HTTP, by a daemon within the unit's sandbox."""

from proofs.vm.guest import client, unit
from proofs.vm.machine import Machine

FIELDS = 100


def test_a_capture_is_complete_and_its_file_holds_every_field(service: Machine) -> None:
    document = service.call(client.capture, fields=FIELDS)
    assert (document["state"], document["verdict"]) == ("sealed", "complete"), document
    inside = service.call(client.inside, capture_id=document["id"])
    assert (inside["received"], inside["last_n"]) == (FIELDS, FIELDS - 1)
    assert inside["integrity"] == "ok"


def test_the_thread_that_takes_fields_runs_in_real_time_and_no_other(service: Machine) -> None:
    counts = service.call(unit.count_real_time_threads)
    assert counts["real time"] == 1
    assert counts["ordinary"] > 1


def test_a_member_of_the_daemons_group_reads_it_and_a_stranger_does_not(service: Machine) -> None:
    capture_id = service.call(client.capture, fields=10)["id"]
    service.call(unit.add_user, name="researcher", group="grabberd")
    service.call(unit.add_user, name="stranger", group="video")
    path = f"{unit.STATE}/captures/{capture_id}.grab"
    assert service.call(unit.rights, path=path) == "640 grabberd grabberd"
    assert service.call(client.fields_read_by, user="researcher", capture_id=capture_id) == 10
    assert service.call(client.fields_read_by, user="stranger", capture_id=capture_id) is None


def test_a_viewers_token_looks_through_the_socket_but_does_not_capture(service: Machine) -> None:
    config = f"--config {unit.CONFIG}"
    made = service.call(unit.command, words=f"token add tablet --role viewer {config}")
    assert made["exit"] == 0, made
    token = made["out"].split()[-1]
    asked = {
        "nobody": service.call(client.ask, path="/api/v1/state"),
        "viewer": service.call(client.ask, path="/api/v1/state", token=token),
        "viewer's capture": service.call(
            client.ask, path="/api/v1/captures", body={"fields": 5}, token=token
        ),
    }
    removed = service.call(unit.command, words=f"token remove tablet {config}")
    assert removed["exit"] == 0, removed
    assert {who: answer["status"] for who, answer in asked.items()} == {
        "nobody": 401,
        "viewer": 200,
        "viewer's capture": 403,
    }
