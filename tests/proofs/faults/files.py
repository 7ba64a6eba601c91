"""Faults of the daemon's own files: index, state database, folder of captures, and no descriptor left."""

import resource
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from .daemon import PATIENCE_S, Answer, ask_over
from .finding import Finding, nothing_lost, unless
from .machine import Machine

GARBAGE = b"garbage " * 2000


def index_damaged(machine: Machine) -> Finding:
    """The index of captures is overwritten while a capture runs."""
    return _index(machine, lambda path: path.write_bytes(GARBAGE))


def index_deleted(machine: Machine) -> Finding:
    """The index of captures is deleted while a capture runs."""
    return _index(machine, Path.unlink)


def _index(machine: Machine, harm: Callable[[Path], object]) -> Finding:
    daemon = machine.daemon
    known = {daemon.sealed(daemon.start_capture(fields=10))["id"], daemon.start_capture()}
    time.sleep(1.0)
    before = _rebuilds(machine)
    harm(daemon.captures / "index.sqlite")
    begin_s = time.monotonic()
    while (answer := daemon.ask("/api/v1/captures")).status == 503:
        time.sleep(0.05)
    recovered_s = time.monotonic() - begin_s
    evidence = machine.evidence(daemon.stop_capture(max(known)))
    problems = unless(
        (answer.status == 200, f"the list is {answer}"),
        (known <= {one["id"] for one in answer.document["captures"]}, "not all captures are listed"),
        (_rebuilds(machine) == before + 1, "it was not rebuilt once"),
    )
    behaviour = "the list is rebuilt from the files, and the capture continues"
    return Finding(behaviour, None, recovered_s, (*problems, *nothing_lost(evidence)))


def _rebuilds(machine: Machine) -> float:
    lines = machine.daemon.ask("/metrics").body.decode().splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("grabberd_index_rebuilds_total"))


def state_damaged(machine: Machine) -> Finding:
    """The state database is overwritten while a capture runs."""
    daemon = machine.daemon
    kept = {"threshold": {"kind": "fixed", "value": 77}}
    assert daemon.ask("/api/v1/settings", "PUT", kept).status == 200
    capture_id = daemon.start_capture()
    time.sleep(1.0)
    begin_s = time.monotonic()
    (daemon.captures.parent / "state.sqlite").write_bytes(GARBAGE)
    fault = _fault(machine, "settings_restored")
    noticed_s = time.monotonic() - begin_s
    accepted = daemon.ask(f"/api/v1/captures/{capture_id}", "PATCH", {"pinned": True})
    recovered_s = time.monotonic() - begin_s
    evidence = machine.evidence(daemon.stop_capture(capture_id))
    settings = daemon.get("/api/v1/settings")["devices"]["cup"]["threshold"]
    problems = unless(
        ("are those of" in fault["message"], f"it says {fault['message']}"),
        (accepted.status == 200, f"a pin is answered by {accepted}"),
        (settings["value"] == 77, f"the threshold is {settings}"),
        (bool(list(daemon.captures.parent.glob("state.sqlite.damaged-*"))), "the damaged file is gone"),
    )
    assert daemon.ask("/api/v1/settings", "PUT", {"threshold": None}).status == 200
    behaviour = "it is restored from its newest backup, whose time is shown; the capture continues"
    return Finding(behaviour, noticed_s, recovered_s, (*problems, *nothing_lost(evidence)))


def folder_renamed(machine: Machine) -> Finding:
    """The folder of captures is renamed for 2 s while a capture runs; an empty one stands in its place."""
    daemon = machine.daemon
    folder, away = daemon.captures, daemon.captures.with_name("away")
    capture_id = daemon.start_capture()
    time.sleep(1.0)
    begin_s = time.monotonic()
    folder.rename(away)
    folder.mkdir()
    fault = _fault(machine, "captures_missing")
    noticed_s = time.monotonic() - begin_s
    refused = [daemon.ask("/api/v1/captures"), daemon.ask("/api/v1/captures", "POST", {"fields": 10})]
    time.sleep(2.0)
    written = [path.name for path in folder.iterdir()]
    folder.rmdir()
    away.rename(folder)
    recovered_s = machine.since_serving(time.monotonic())
    told = daemon.wait_for(f"/api/v1/captures/{capture_id}", lambda one: one["state"] == "sealed")
    evidence = machine.evidence(told)
    problems = unless(
        ("unmounted" in fault["message"], f"it says {fault['message']}"),
        ([one.status for one in refused] == [507, 507], f"who asks is answered by {refused}"),
        (not written, f"{written} was written into the folder in its place"),
        (told["verdict"] == "incomplete", f"the capture that was cut off is {told['verdict']}"),
        (evidence.ledger.received > 0, "nothing that was recorded before is there"),
    )
    behaviour = (
        "the capture ends, and nothing is written in its place (507, with a hint); when it is back, the "
        "capture is sealed with what was written, and all goes on"
    )
    return Finding(behaviour, noticed_s, recovered_s, problems)


def descriptors_gone(machine: Machine) -> Finding:
    """For 5 s the daemon can open no file, and a capture is to be sealed."""
    daemon, pid = machine.daemon, machine.daemon.process.pid
    capture_id = daemon.start_capture()
    time.sleep(1.0)
    soft, hard = resource.prlimit(pid, resource.RLIMIT_NOFILE)
    lines = len(daemon.journal.read_text().splitlines())
    with daemon.connection() as kept:
        ask_over(kept, "/healthz")
        # Those that are open stay so, this connection among them: no further one is given out.
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (3, hard))
        begin_s, records = time.monotonic(), True
        # A disk that lets a commit wait for longer than that hides the fault from the recorder.
        while time.monotonic() < begin_s + (PATIENCE_S if records else 5.0):
            time.sleep(0.1)
            records = _records(ask_over(kept, "/api/v1/state"))
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (soft, hard))
    begin_s = time.monotonic()
    path, end_s = f"/api/v1/captures/{capture_id}", begin_s + PATIENCE_S
    while (answer := daemon.ask(path)).status in (503, 507) and time.monotonic() < end_s:
        time.sleep(0.1)
    told = daemon.wait_for(path, lambda one: one["state"] == "sealed")
    recovered_s = time.monotonic() - begin_s
    evidence = machine.evidence(told)
    logged = len(daemon.journal.read_text().splitlines()) - lines
    problems = unless(
        (answer.status == 200, f"who asks for it then is answered by {answer}"),
        (evidence.ledger.received > 0, "nothing that was recorded before is there"),
        (logged < 50, f"the log has {logged} lines more"),
    )
    problems += machine.whole_capture()
    behaviour = (
        "the capture ends, and is sealed as soon as files can be opened; the log grows by a few lines only"
    )
    return Finding(behaviour, None, recovered_s, problems)


def _records(answer: Answer) -> bool:
    return answer.status == 200 and answer.document["devices"]["cup"]["state"] == "capturing"


def _fault(machine: Machine, cause: str) -> dict[str, Any]:
    """A fault of the daemon as soon as it is told."""
    state = machine.daemon.wait_for(
        "/api/v1/state", lambda one: any(fault["cause_code"] == cause for fault in one["faults"])
    )
    fault: dict[str, Any] = next(one for one in state["faults"] if one["cause_code"] == cause)
    return fault


FAULTS: Mapping[str, Callable[[Machine], Finding]] = {
    "the index of captures is damaged during a capture": index_damaged,
    "the index of captures is deleted during a capture": index_deleted,
    "state.sqlite is damaged during a capture": state_damaged,
    "an empty folder replaces the folder of captures for 2 s": folder_renamed,
    "the daemon cannot open files for 5 s during a capture": descriptors_gone,
}
