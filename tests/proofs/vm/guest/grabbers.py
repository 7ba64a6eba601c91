"""Real drivers before emulated grabbers: what is in a capture, row by row, beside what the camera sent."""

import atexit
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from grabberd.config import load_config
from grabberd.core.ledger import LedgerEntry
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.instrument.setup import set_up
from grabberd.library.capture import open_capture
from grabberd.server.daemon.service import Service
from grabberd_v4l2.discovery import discover
from proofs.vm.guest.shell import run, wait_for
from proofs.vm.usb.camera import numbers_in

PATIENCE_S = 120.0
LEAD, APART = 100, 46
"""Fields before the first fault, and from one to the next."""
MODULES = {"usbtv": "usbtv", "stk1160": "stk1160", "uvc": "uvcvideo"}
USB = {"usbtv": "1b71:3002", "stk1160": "05e1:0408", "uvc": "1d6b:0102"}
"""By the kind of a device, without the format of its pictures."""
_CONFIG = """
devices:
  cup:
    driver: v4l2
    options: {options}
    threshold: {{kind: fixed, value: 128}}
    rig: {{columns: 720, lines: {lines}}}
"""
_LINES = {"uvc": 480, "usbtv, 525 lines": 480}
_MORE = {"usbtv, 525 lines": {"standard": "NTSC"}}


class Grabber:
    """An emulated device, in a process of its own."""

    def __init__(self, kind: str, port: int) -> None:
        command = [sys.executable, "-m", "proofs.vm.usb", kind, str(port)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        atexit.register(self.end)

    def __call__(self, *words: Any) -> Any:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(words) + "\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())

    def end(self) -> None:
        """Its process ends; what it had plugged in is gone."""
        self._process.kill()
        self._process.wait()


_plugged: dict[str, Grabber] = {}
_alike: list[Grabber] = []


def plug_in(kind: str) -> dict[str, Any]:
    """Plugs one in; says what the kernel and the program make of it."""
    run(f"modprobe -a vhci-hcd {MODULES[_family(kind)]}")
    grabber = _plugged[kind] = Grabber(kind, 0)
    grabber("in")
    seconds = wait_for(_nodes, PATIENCE_S)
    run("udevadm settle")
    return {
        "seconds": seconds,
        "nodes": _nodes(),
        "found": [
            {
                "card": one.card,
                "verdict": str(one.verdict),
                "options": dict(one.options),
                "remarks": one.remarks,
            }
            for one in discover()
        ],
        "kernel": [line for line in run("dmesg").splitlines() if kind in line or "BOGUS" in line][-8:],
    }


def plug_in_alike(kind: str, ports: Sequence[int]) -> dict[str, str]:
    """Plugs several of a kind into these ports, one after the other; the node that each option leads to."""
    run(f"modprobe -a vhci-hcd {MODULES[kind]}")
    for count, port in enumerate(ports, 1):
        _alike.append(Grabber(kind, port))
        _alike[-1]("in")
        wait_for(lambda: len(_nodes()) == count, PATIENCE_S)  # noqa: B023 - waited for at once
        run("udevadm settle")
    options = [str(found.options["device"]) for found in discover()]
    return {option: os.path.realpath(option) for option in options}


def unplug_alike() -> None:
    """Takes all of them away."""
    while _alike:
        grabber = _alike.pop()
        grabber("out")
        grabber.end()
    wait_for(lambda: not _nodes(), PATIENCE_S)


def unplug(kind: str) -> None:
    """Takes it away."""
    grabber = _plugged.pop(kind)
    grabber("out")
    grabber.end()
    wait_for(lambda: not _nodes(), PATIENCE_S)


def judged(kind: str, cases: Sequence[tuple[str, Sequence[Sequence[Any]]]]) -> dict[str, Any]:
    """Captures while faults happen, one after the other, and compares each row with what the camera sent.

    Args:
        kind: Of the grabber.
        cases: Name and faults of each, as `Emulated.script` takes them.

    Returns:
        `cases`: of each name what is `said` of the fields about its fault, in words; how many of them are
        `unseen`: received, though a row is of another field; and `spared`: not received, though all rows are
        right. `elsewhere`: the same of all other fields. `skipped`: fields that the
        emulation was too slow for.
    """
    grabber = _plugged[kind]
    with _service(kind) as (service, folder):
        service.capture_control.start(None, CaptureRequest())
        recording = service.instrument(None).captures.recording
        assert recording is not None
        _pass(grabber, LEAD)
        made = []
        for name, faults in cases:
            fields = APART + max(fault[0] for fault in faults)
            made.append((name, grabber("script", *faults)))
            _pass(grabber, fields)
        recording.stop("the test is over")
        assert recording.sealed.wait(PATIENCE_S)
        entries = recording.recorder.ledger.entries
        (file,) = folder.rglob("*.grab")
        rows = _rows(file)
    ahead = Counter(row["shows"] - row["n"] for row in rows).most_common(1)[0][0]
    ends = [*(base for _, base in made[1:]), rows[-1]["n"] + ahead + 3]
    found = {
        name: _about(rows, entries, ahead, base, end) for (name, base), end in zip(made, ends, strict=True)
    }
    elsewhere = _about(rows, entries, ahead, 0, made[0][1])
    return {
        "cases": found,
        "elsewhere": elsewhere,
        "skipped": grabber("state")["skipped"],
        "fields": len(rows),
    }


def replugged(kind: str, seconds: float) -> dict[str, Any]:
    """Captures while the connection breaks, and is there again after so many seconds; see `judged`."""
    grabber = _plugged[kind]
    with _service(kind) as (service, folder):
        service.capture_control.start(None, CaptureRequest())
        recording = service.instrument(None).captures.recording
        assert recording is not None
        _pass(grabber, LEAD)
        broken = grabber("state")["field"]
        grabber("cut")
        time.sleep(seconds)
        grabber("in")
        received = recording.recorder.ledger.received
        wait_for(lambda: recording.recorder.ledger.received > received + LEAD, PATIENCE_S)
        recording.stop("the test is over")
        assert recording.sealed.wait(PATIENCE_S)
        entries = recording.recorder.ledger.entries
        (file,) = folder.rglob("*.grab")
        rows = _rows(file)
    before = [row for row in rows if row["shows"] < broken]
    ahead = Counter(row["shows"] - row["n"] for row in before).most_common(1)[0][0]
    return {
        **_about(before, entries, ahead, 0, broken),
        "entries": _told(entries),
        "after": len(rows) - len(before),
    }


def without_a_camera(kind: str, seconds: float) -> list[str]:
    """Captures while the camera's signal is away for so long; what the ledger says."""
    grabber = _plugged[kind]
    with _service(kind) as (service, _):
        service.capture_control.start(None, CaptureRequest())
        recording = service.instrument(None).captures.recording
        assert recording is not None
        _pass(grabber, LEAD)
        grabber("signal", False)
        time.sleep(seconds)
        grabber("signal", True)
        _pass(grabber, LEAD)
        recording.stop("the test is over")
        assert recording.sealed.wait(PATIENCE_S)
        return _told(recording.recorder.ledger.entries)


def opened_before_60_hz(kind: str, seconds: float) -> str:
    """What the daemon says of a camera of 60 Hz before a grabber that is set to 50."""
    grabber = _plugged[kind]
    with _service(kind) as (service, _):
        grabber("60 Hz", True)
        board = service.instrument(None).board
        wait_for(lambda: board.now.cause, seconds)
        grabber("60 Hz", False)
        return str(board.now.cause)


def repeated(kind: str) -> dict[str, Any]:
    """Outcomes of pictures that come twice: how many, and how many different ones are received."""
    grabber = _plugged[kind]
    with _service(kind) as (service, folder):
        service.capture_control.start(None, CaptureRequest(fields=2 * LEAD))
        recording = service.instrument(None).captures.recording
        assert recording is not None
        assert recording.sealed.wait(PATIENCE_S)
        (file,) = folder.rglob("*.grab")
        rows = _rows(file)
    received = [row["shows"] for row in rows if row["outcome"] == "received"]
    reasons = Counter(row["reason"] for row in rows if row["outcome"] == "damaged")
    return {
        "received": len(received),
        "different": len(set(received)),
        "damaged": dict(reasons),
        **grabber("state"),
    }


def _told(entries: Sequence[LedgerEntry]) -> list[str]:
    return [f"{entry.count} {entry.outcome} ({entry.reason})" for entry in entries]


def _about(rows: Any, entries: Sequence[LedgerEntry], ahead: int, first: int, end: int) -> dict[str, Any]:
    """What is said of the fields from one to another number of the camera's, and what is true."""
    near = [row for row in rows if first - 2 <= row["n"] + ahead < end - 2]
    right = [row for row in near if row["shows"] == row["n"] + ahead and not row["others"]]
    received = [row for row in near if row["outcome"] == "received"]
    return {
        "said": _told([entry for entry in entries if first - 2 <= entry.first_n + ahead < end - 2]),
        "unseen": [row for row in received if row not in right],
        "spared": sum(row not in received for row in right),
    }


def _rows(file: Path) -> list[dict[str, Any]]:
    found = []
    with open_capture(file) as capture:
        for one in capture.fields:
            numbers = Counter(numbers_in(np.asarray(one.picture)))
            shows, count = numbers.most_common(1)[0]
            found.append(
                {
                    "n": one.n,
                    "outcome": str(one.outcome),
                    "reason": one.reason,
                    "shows": shows,
                    "others": sum(numbers.values()) - count,
                }
            )
    return found


@contextmanager
def _service(kind: str) -> Iterator[tuple[Service, Path]]:
    folder = Path(tempfile.mkdtemp(prefix="grabberd-", dir="/dev/shm"))
    file = folder / "cup.yaml"
    options = json.dumps({"usb": USB[_family(kind)], **_MORE.get(kind, {})})
    file.write_text(_CONFIG.format(options=options, lines=_LINES.get(kind, _LINES.get(_family(kind), 576))))
    service = Service(set_up(load_config(file), file), folder)
    service.start()
    try:
        wait_for(lambda: service.instrument(None).captures.accepts, PATIENCE_S)
        yield service, folder
    finally:
        service.stop()


def _pass(grabber: Grabber, fields: int) -> None:
    until = grabber("state")["field"] + fields
    wait_for(lambda: grabber("state")["field"] >= until, PATIENCE_S)


def _family(kind: str) -> str:
    return kind.partition(",")[0]


def _nodes() -> list[str]:
    return sorted(str(path) for path in Path("/dev").glob("video*"))
