"""Faults of the machine: a slow disk, a full one, a clock that is set, a process that is killed."""

import json
import os
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from grabberd.core.ledger import Outcome

from .daemon import PATIENCE_S, Daemon
from .evidence import Evidence, evidence_of
from .finding import Finding, nothing_lost, unless

QUEUE_S = 2.0
"""The recorder's queue in these tests; ten seconds where nobody says otherwise."""


class Machine:
    """A daemon, and the controls of its disk and clock."""

    def __init__(self, daemon: Daemon, controls: Path) -> None:
        self.daemon = daemon
        self._controls = controls

    @contextmanager
    def told(self, **controls: Any) -> Iterator[None]:
        """Disk and clock do this while the block lasts."""
        self._tell(controls)
        try:
            yield
        finally:
            self._tell({})

    def _tell(self, controls: Mapping[str, Any]) -> None:
        new = self._controls.with_suffix(".new")
        new.write_text(json.dumps(controls))
        new.rename(self._controls)

    def evidence(self, told: dict[str, Any]) -> Evidence:
        """Of a capture that has been sealed."""
        return evidence_of(self.daemon.take_home(told["id"], self.daemon.folder), told)

    def whole_capture(self) -> tuple[str, ...]:
        """What is wrong with a short capture now; nothing, where the daemon has recovered."""
        told = self.daemon.sealed(self.daemon.start_capture(fields=25))
        return nothing_lost(self.evidence(told))

    def end_captures(self) -> None:
        """Has all end that run: what is played next begins as if nothing had been before it."""
        for capture in self.daemon.get("/api/v1/captures")["captures"]:
            if capture["state"] in ("recording", "sealing"):
                self.daemon.stop_capture(capture["id"])

    def since_serving(self, begin_s: float) -> float:
        """Until a capture began again, and ended whole."""
        while self.daemon.ask("/api/v1/captures", "POST", {"fields": 10}).status != 202:
            assert time.monotonic() < begin_s + PATIENCE_S
            time.sleep(0.05)
        took_s = time.monotonic() - begin_s
        self.daemon.wait_for("/api/v1/captures", lambda page: page["captures"][0]["state"] == "sealed")
        return took_s


def disk_stalls_briefly(machine: Machine) -> Finding:
    """For half the length of the recorder's queue."""
    capture_id = machine.daemon.start_capture()
    time.sleep(1.0)
    with machine.told(stall=True):
        time.sleep(QUEUE_S / 2)
    time.sleep(0.5)
    evidence = machine.evidence(machine.daemon.stop_capture(capture_id))
    return Finding("nothing is lost", None, None, nothing_lost(evidence))


def disk_stalls_long(machine: Machine) -> Finding:
    """Until the recorder's queue is full, and for a second more."""
    daemon = machine.daemon
    capture_id = daemon.start_capture()
    time.sleep(1.0)
    begin_s = time.monotonic()
    with machine.told(stall=True):
        held = _until_it_holds_no_more(daemon, capture_id)
    stalled_s, end_s = time.monotonic() - begin_s, time.monotonic()
    path = f"/api/v1/captures/{capture_id}"
    daemon.wait_for(path, lambda one: one["ledger"]["counts"]["received"] > held)
    recovered_s = time.monotonic() - end_s
    evidence = machine.evidence(daemon.stop_capture(capture_id))
    overrun = evidence.ledger.counts()[Outcome.OVERRUN]
    problems = unless((overrun > 0, f"no field is overrun in a stall of {stalled_s:.1f} s"))
    behaviour = "what the queue cannot hold is overrun, and the capture continues"
    lost = nothing_lost(evidence, "disk too slow")
    return Finding(behaviour, None, recovered_s, (*problems, *lost))


def _until_it_holds_no_more(daemon: Daemon, capture_id: str) -> int:
    """How many fields have been taken when for a second no further one is."""
    received, since_s, begin_s = -1, time.monotonic(), time.monotonic()
    while time.monotonic() < since_s + 1.0:
        assert time.monotonic() < begin_s + PATIENCE_S
        now = daemon.get(f"/api/v1/captures/{capture_id}")["ledger"]["counts"]["received"]
        received, since_s = now, since_s if now == received else time.monotonic()
        time.sleep(0.1)
    return received


def capture_file_full(machine: Machine) -> Finding:
    """The disk has no page left for a capture that runs."""
    # More than a recorder that has waited for a busy computer commits at once: its queue, 7 pages a field.
    with machine.told(max_pages={".grab.part": round(QUEUE_S * 50 * 7 * 1.5)}):
        begin_s = time.monotonic()
        told = machine.daemon.sealed(machine.daemon.start_capture())
        noticed_s = time.monotonic() - begin_s
    recovered_s = machine.since_serving(time.monotonic())
    evidence = machine.evidence(told)
    problems = unless(
        (told["verdict"] == "incomplete", f"its verdict is {told['verdict']}"),
        ("full" in (told["ended_because"] or ""), f"it ended because: {told['ended_because']}"),
        (evidence.ledger.received > 0, "nothing that was recorded before is there"),
    )
    behaviour = "the capture ends, is sealed with what was written, and says why; the next one is complete"
    lost = nothing_lost(evidence, "not written to disk")
    return Finding(behaviour, noticed_s, recovered_s, (*problems, *lost))


def index_full(machine: Machine) -> Finding:
    """A capture ends while the index cannot be written."""
    begin_s = time.monotonic()
    with machine.told(full=["index.sqlite"]):
        capture_id = machine.daemon.start_capture(fields=25)
        time.sleep(2.0)
        noticed_s = time.monotonic() - begin_s
        state = machine.daemon.get("/api/v1/state")["devices"]["cup"]["state"]
    recovered_s = machine.since_serving(time.monotonic())
    answer = machine.daemon.ask(f"/api/v1/captures/{capture_id}")
    problems = unless(
        (state == "ready", f"the device is {state} when its capture has ended"),
        (answer.status == 200, f"the capture is not found again: {answer}"),
        ((machine.daemon.captures / f"{capture_id}.grab").exists(), "it is not sealed"),
    )
    if answer.status == 200:
        problems += nothing_lost(machine.evidence(answer.document))
    return Finding(
        "the capture is sealed, and listed as soon as there is space", noticed_s, recovered_s, problems
    )


def state_full(machine: Machine) -> Finding:
    """Something is to be kept while the state cannot be written."""
    daemon = machine.daemon
    capture_id = daemon.sealed(daemon.start_capture(fields=10))["id"]
    path, note = f"/api/v1/captures/{capture_id}", {"note": "after the full disk"}
    begin_s = time.monotonic()
    with machine.told(full=["state.sqlite"]):
        refused = daemon.ask(path, "PATCH", note)
        noticed_s = time.monotonic() - begin_s
        problems = machine.whole_capture()
    begin_s = time.monotonic()
    accepted = daemon.ask(path, "PATCH", note)
    recovered_s = time.monotonic() - begin_s
    problems += unless(
        (refused.status in (503, 507), f"the order is answered by {refused}"),
        ("hint" in refused.document, "nothing is said about what to do"),
        (accepted.status == 200, f"with room, it is answered by {accepted}"),
    )
    behaviour = f"the request is refused ({refused.status}, with a hint); captures continue"
    return Finding(behaviour, noticed_s, recovered_s, problems)


def clock_set_on(machine: Machine) -> Finding:
    """The wall clock is set on by an hour while a capture runs."""
    return _clock_set(machine, 3600.0)


def clock_set_back(machine: Machine) -> Finding:
    """The wall clock is set back by an hour while a capture runs."""
    return _clock_set(machine, -3600.0)


def _clock_set(machine: Machine, step_s: float) -> Finding:
    daemon = machine.daemon
    capture_id = daemon.start_capture()
    time.sleep(0.6)
    with machine.told(step_s=step_s):
        time.sleep(0.6)
        evidence = machine.evidence(daemon.stop_capture(capture_id))
        problems = machine.whole_capture()
        problems += unless((daemon.ask("/healthz").status == 200, "it does not serve"))
    problems += machine.whole_capture()
    behaviour = "nothing is lost, and field times do not jump"
    return Finding(behaviour, None, None, (*problems, *nothing_lost(evidence)))


def job_killed(machine: Machine) -> Finding:
    """The process of jobs is killed while it measures a capture again: the job begins anew."""
    daemon = machine.daemon
    told = daemon.sealed(daemon.start_capture(fields=100))
    job = measured_again(daemon, told["id"])
    daemon.wait_for(f"/api/v1/jobs/{job}", lambda one: one["state"] == "running" and one["progress"] > 0)
    begin_s = time.monotonic()
    os.kill(job_process(daemon.process.pid), signal.SIGKILL)
    daemon.wait_for(f"/api/v1/jobs/{job}", lambda one: one["attempts"] == 2 or one["state"] == "failed")
    noticed_s = time.monotonic() - begin_s
    before = machine.evidence(daemon.get(f"/api/v1/captures/{told['id']}"))
    done = daemon.wait_for(f"/api/v1/jobs/{job}", lambda one: one["state"] not in ("queued", "running"))
    recovered_s = time.monotonic() - begin_s
    after = daemon.get(f"/api/v1/captures/{told['id']}")
    problems = unless(
        ((done["state"], done["attempts"]) == ("done", 2), f"the job is {done}"),
        ([run["state"] for run in after["runs"]] == ["done", "done"], f"the runs are {after['runs']}"),
    )
    lost = (*nothing_lost(before), *nothing_lost(machine.evidence(after)))
    behaviour = "a new process restarts the job and finishes it, adding one run"
    return Finding(behaviour, noticed_s, recovered_s, (*problems, *lost))


def measured_again(daemon: Daemon, capture_id: str) -> str:
    answer = daemon.ask(f"/api/v1/captures/{capture_id}/measure", "POST")
    assert answer.status == 202, answer
    job: str = answer.document["id"]
    return job


def job_process(parent: int) -> int:
    """The daemon's child that does jobs."""
    until_s = time.monotonic() + 5.0
    while time.monotonic() < until_s:  # the kernel may leave one out while another ends
        children = Path(f"/proc/{parent}/task").glob("*/children")
        for pid in (pid for children_of in children for pid in children_of.read_text().split()):
            with suppress(OSError):
                command = Path(f"/proc/{pid}/cmdline").read_bytes()
                if b"grabberd.work.child" in command and b"parent=0" not in command:
                    return int(pid)
        time.sleep(0.05)
    raise AssertionError("the daemon has no process for jobs")


FAULTS: Mapping[str, Callable[[Machine], Finding]] = {
    f"the disk stalls for {QUEUE_S / 2:g} s, the recorder's queue holds {QUEUE_S:g} s": disk_stalls_briefly,
    f"the disk stalls for longer than the recorder's queue holds, here {QUEUE_S:g} s": disk_stalls_long,
    "the disk becomes full during a capture": capture_file_full,
    "the disk is full when the index is written": index_full,
    "the disk is full when the state is written": state_full,
    "the wall clock is set forward by an hour": clock_set_on,
    "the wall clock is set back by an hour": clock_set_back,
    "the job process is killed": job_killed,
}
