"""Memory of the daemon and of its process of jobs, as the unit's limits have to leave it to them."""

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import yaml
from tests.proofs.faults.daemon import Daemon, running
from tests.proofs.faults.machine import job_process

from grabberd.config import shipped_configs

IDLE_S, BUSY_S = 60.0, 40.0
"""Of idling: the locators' tables are made as the liner shows new sizes, all within a minute."""
FIELDS = (200, 1000)
GRABBERD = (sys.executable, "-c", "from grabberd.cli import main; main()")


def table(busy_s: float = BUSY_S) -> str:
    """What each holds, by the kernel's account.

    The most that was resident is VmHWM; the share of what is resident, if libraries and other shared pages
    are divided by those who share them, is Pss; VmData is what RLIMIT_DATA limits.
    """
    rows = [
        "| | most resident, MB | its share at the end, MB | private data at the end, MB |",
        "|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as name, running(Path(name), _config(), GRABBERD) as daemon:
        daemon.wait_until_ready()
        time.sleep(IDLE_S)
        rows.append(_row("the daemon, idle, measuring at 50 Hz", daemon.process.pid))
        _be_busy(daemon, busy_s)
        rows.append(
            _row(f"the daemon after {busy_s:.0f} s of capture, 20 requests a second", daemon.process.pid)
        )
        for fields in FIELDS:
            rows.append(_of_job(daemon, fields))
        rows.append(_row("the daemon at the end", daemon.process.pid))
    return "\n".join(rows)


def _config() -> dict[str, Any]:
    """The simulated grabber as `make run` has it: one bit, doubled."""
    document = yaml.safe_load((shipped_configs() / "fake.yaml").read_text())
    for device in document["devices"].values():
        for key in ("calibration", "object"):
            if key in device:
                device[key] = str(shipped_configs() / device[key])
    assert isinstance(document, dict)
    return document


def _be_busy(daemon: Daemon, seconds: float) -> None:
    capture_id = daemon.start_capture()
    until = time.monotonic() + seconds
    paths = ("/api/v1/state", "/api/v1/captures", f"/api/v1/captures/{capture_id}", "/api/v1/preview.png")
    asked = 0
    while time.monotonic() < until:
        daemon.ask(paths[asked % len(paths)])
        asked += 1
        time.sleep(0.05)
    daemon.stop_capture(capture_id)


def _of_job(daemon: Daemon, fields: int) -> str:
    capture_id = daemon.sealed(daemon.start_capture(fields=fields))["id"]
    for what in ("measure", "analysis"):
        answer = daemon.ask(f"/api/v1/captures/{capture_id}/{what}", "POST", {})
        assert answer.status == 202, answer
        job = f"/api/v1/jobs/{answer.document['id']}"
        ended = {"done", "failed"}
        while (now := daemon.get(job))["state"] not in ended:
            time.sleep(0.1)
        assert now["state"] == "done", now
    return _row(
        f"the process of jobs, {fields} fields measured again and analysed", job_process(daemon.process.pid)
    )


def _row(what: str, pid: int) -> str:
    status, shares = (_account(pid, file) for file in ("status", "smaps_rollup"))
    return f"| {what} | {status['VmHWM']:.0f} | {shares['Pss']:.0f} | {status['VmData']:.0f} |"


def _account(pid: int, file: str) -> dict[str, float]:
    """MB, by name."""
    pairs = (line.split(":", 1) for line in Path(f"/proc/{pid}/{file}").read_text().splitlines()[1:])
    return {name: int(value.split()[0]) / 1000 for name, value in pairs if value.endswith(" kB")}
