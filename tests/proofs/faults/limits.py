"""Limits of the system: few file descriptors, little memory, for the daemon or for its process of jobs."""

import resource
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from .clients import answered, connected
from .daemon import Answer, Daemon
from .failing import failing_machine
from .finding import Finding, nothing_lost, unless
from .machine import Machine, job_process, measured_again

FEW, CLIENTS = 64, 40
MOST_MB = 300
"""What answers may take in all: with the daemon and a job less than `MemoryMax` of the unit."""


def few_descriptors(machine: Machine) -> Finding:
    """A daemon that may have 64 descriptors from its start on, and forty clients that stay."""
    with failing_machine(machine.daemon.folder / "few", f"--nofile={FEW}:{FEW}") as few:
        capture_id = few.daemon.start_capture()
        with connected(few.daemon.port, CLIENTS, "/api/v1/events") as sockets:
            refused = answered(sockets, b"too-many-connections", time.monotonic() + 2.0)
        begin_s = time.monotonic()
        told = few.daemon.stop_capture(capture_id)
        recovered_s = few.since_serving(begin_s)
        problems = (*nothing_lost(few.evidence(told)), *few.whole_capture())
        says = few.daemon.journal.read_text()
    problems += unless(
        (refused > 0, "no client was refused"),
        ("connections are served at most" in says, "the log does not say how many can be served"),
        ("Traceback" not in says, "the log has a traceback"),
    )
    behaviour = f"{refused} of {CLIENTS} clients are refused with a message (503); nothing is lost"
    return Finding(behaviour, None, recovered_s, problems)


def much_at_once(machine: Machine) -> Finding:
    """For 4 s, twenty clients ask for the largest answers there are, while a capture runs.

    A library of the daemon's ends it where memory cannot be had, so it has to need little: the unit's limit
    is for the daemon, this, and a job.
    """
    daemon, pid = machine.daemon, machine.daemon.process.pid
    large = daemon.sealed(daemon.start_capture(fields=400))["id"]
    capture_id = daemon.start_capture()
    time.sleep(1.0)
    Path(f"/proc/{pid}/clear_refs").write_text("5")  # the most resident is counted from now on
    before_kb = _kb(pid, "VmHWM")
    answers = _asked_for_much(daemon, large, 4.0)
    grown_mb = (_kb(pid, "VmHWM") - before_kb) / 1000
    evidence = machine.evidence(daemon.stop_capture(capture_id))
    statuses = sorted({one.status for one in answers})
    problems = (*nothing_lost(evidence), *machine.whole_capture())
    problems += unless(
        (set(statuses) <= {200, 503}, f"it answers by {statuses}"),
        (grown_mb < MOST_MB, f"it has grown by {grown_mb:.0f} MB"),
    )
    behaviour = f"{len(answers)} answers ({' and '.join(map(str, statuses))}) take {grown_mb:.0f} MB at most"
    return Finding(behaviour, None, None, problems)


def little_memory_for_jobs(machine: Machine) -> Finding:
    """The process of jobs gets no more memory than it has, in the midst of a job."""
    daemon = machine.daemon
    told = daemon.sealed(daemon.start_capture(fields=200))
    job = measured_again(daemon, told["id"])
    daemon.wait_for(f"/api/v1/jobs/{job}", lambda one: one["state"] == "running" and one["progress"] > 0)
    begin_s = time.monotonic()
    capture_id = daemon.start_capture()
    _limit_to_what_it_has(job_process(daemon.process.pid))
    failed = daemon.wait_for(f"/api/v1/jobs/{job}", lambda one: one["state"] not in ("queued", "running"))
    noticed_s, begin_s = time.monotonic() - begin_s, time.monotonic()
    again = measured_again(daemon, told["id"])
    done = daemon.wait_for(f"/api/v1/jobs/{again}", lambda one: one["state"] in ("done", "failed"))
    recovered_s = time.monotonic() - begin_s
    evidence = machine.evidence(daemon.stop_capture(capture_id))
    problems = unless(
        (failed["state"] == "failed", f"the job is {failed['state']}"),
        ("memory" in str(failed["problem"]), f"it says {failed['problem']}"),
        (done["state"] == "done", f"measured again, the job says {done['problem']}"),
    )
    behaviour = "the job fails with a message; the running capture continues, the next job gets a new process"
    return Finding(behaviour, noticed_s, recovered_s, (*problems, *nothing_lost(evidence)))


def _limit_to_what_it_has(pid: int) -> None:
    """No further private memory for a process."""
    _, hard = resource.prlimit(pid, resource.RLIMIT_DATA)
    resource.prlimit(pid, resource.RLIMIT_DATA, (_kb(pid, "VmData") * 1024, hard))


def _kb(pid: int, key: str) -> int:
    status = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    return int(status[key].split()[0])


def _asked_for_much(daemon: Daemon, capture_id: str, seconds: float) -> list[Answer]:
    """The answers to many clients at once, each asked at least one time."""
    base = f"/api/v1/captures/{capture_id}"
    paths = [
        f"{base}/points",
        f"{base}/points.csv",
        f"{base}/fields/9.png",
        f"{base}/file",
        "/api/v1/preview.png?device=cup",
    ]
    until_s = time.monotonic() + seconds

    def ask(path: str) -> list[Answer]:
        found = [daemon.ask(path)]
        while time.monotonic() < until_s:
            found.append(daemon.ask(path))
        return found

    with ThreadPoolExecutor(4 * len(paths)) as pool:
        return [one for found in pool.map(ask, 4 * paths) for one in found]


FAULTS: Mapping[str, Callable[[Machine], Finding]] = {
    f"the daemon may open {FEW} files, and {CLIENTS} clients connect": few_descriptors,
    "twenty clients request the largest responses at once for 4 s": much_at_once,
    "the job process gets no more memory": little_memory_for_jobs,
}
