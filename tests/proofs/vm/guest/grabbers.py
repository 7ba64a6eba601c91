"""Real drivers before emulated grabbers: what is in a capture, row by row, beside what the camera sent."""

import fcntl
import json
import os
import shutil
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
from proofs.vm.guest.emulated import PATIENCE_S, Grabber, family, plugged
from proofs.vm.guest.shell import run, wait_for
from proofs.vm.usb.camera import numbers_in

LEAD, APART = 100, 46
"""Fields before the first fault, and from one to the next."""
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
_USBDEVFS_RESET = 0x5514
_LINES = {"uvc": 480, "usbtv, 525 lines": 480}
_MORE = {"usbtv, 525 lines": {"standard": "NTSC"}}


def found() -> list[dict[str, Any]]:
    """What the program finds: of each device its verdict, and the node that its best option leads to."""
    return [
        {
            "verdict": str(one.verdict),
            "remarks": one.remarks,
            "device": one.options["device"],
            "node": os.path.realpath(one.options["device"]),
        }
        for one in discover()
    ]


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
    grabber = plugged[kind]
    with _service(kind) as (service, folder):
        service.capture_control.start(None, CaptureRequest())
        recording = service.instrument(None).captures.recording
        assert recording is not None
        skipped = grabber("state")["skipped"]
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
        "skipped": grabber("state")["skipped"] - skipped,
        "fields": len(rows),
    }


def filmed(kind: str, film: str, fields: int, bits: int, target: str) -> list[str]:
    """Captures before a camera that sees a film, into a file; what the ledger says."""
    copied = Path("/dev/shm/film")
    shutil.copy(film, copied)
    plugged[kind]("sees", str(copied))
    with _service(kind) as (service, folder):
        service.capture_control.start(None, CaptureRequest(fields=fields, bits=bits))
        recording = service.instrument(None).captures.recording
        assert recording is not None
        assert recording.sealed.wait(PATIENCE_S)
        (file,) = folder.rglob("*.grab")
        shutil.copy(file, target)
        return _told(recording.recorder.ledger.entries)


def through(kind: str, happens: Sequence[Any], ends: Sequence[Any], seconds: float) -> dict[str, Any]:
    """Captures while something happens to the device, and is over after so many seconds.

    Args:
        kind: Of the grabber.
        happens: What the device is told; `["reset"]` resets it as a program may, through usbfs.
        ends: The same, for the end; empty if it ends by itself.
        seconds: From one to the other.

    Returns:
        `entries` of the ledger; `causes` that the device's status named; `unseen`: rows that are called
        received and are of several fields, or not of a later field than those before; `after`: fields that
        were received after the end.
    """
    grabber = plugged[kind]
    with _service(kind) as (service, folder):
        service.capture_control.start(None, CaptureRequest())
        instrument = service.instrument(None)
        recording = instrument.captures.recording
        assert recording is not None
        _pass(grabber, LEAD)
        causes = [""]
        for words in (happens, ends):
            _happen(grabber, words)
            until = time.monotonic() + seconds
            while time.monotonic() < until:
                if instrument.board.now.cause != causes[-1]:
                    causes.append(instrument.board.now.cause)
                time.sleep(0.02)
        received = recording.recorder.ledger.received
        wait_for(lambda: recording.recorder.ledger.received > received + LEAD, PATIENCE_S)
        recording.stop("the test is over")
        assert recording.sealed.wait(PATIENCE_S)
        entries = recording.recorder.ledger.entries
        (file,) = folder.rglob("*.grab")
        rows = _rows(file)
    received_rows = [row for row in rows if row["outcome"] == "received"]
    shown = [row["shows"] for row in received_rows]
    return {
        "entries": _told(entries),
        "causes": [cause for cause in causes if cause],
        "unseen": [
            row
            for row, before in zip(received_rows, [-1, *shown], strict=False)
            if row["others"] or row["shows"] <= before
        ],
        "after": recording.recorder.ledger.received - received,
    }


def _happen(grabber: Grabber, words: Sequence[Any]) -> None:
    if list(words) == ["reset"]:
        (bus, number) = (run(f"cat {_device()}/{name}").strip() for name in ("busnum", "devnum"))
        with open(f"/dev/bus/usb/{int(bus):03}/{int(number):03}", "wb") as node:
            fcntl.ioctl(node, _USBDEVFS_RESET)
    elif words:
        grabber(*words)


def _device() -> Path:
    (node,) = Path("/sys/class/video4linux").glob("video0")
    return (node / "device").resolve().parent


def refused(kind: str, words: Sequence[Any] = (), seconds: float = 5.0) -> list[str]:
    """Reasons in turn why the daemon, which stays up, does not take a device that has been told something."""
    grabber = plugged[kind]
    if words:
        grabber(*words)
    with _service(kind, until_ready=False) as (service, _):
        board = service.instrument(None).board
        causes = [""]
        wait_for(lambda: board.now.cause, PATIENCE_S)
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            if board.now.cause not in ("", causes[-1]):
                causes.append(board.now.cause)
            time.sleep(0.02)
        return causes[1:]


def asleep(kind: str) -> dict[str, Any]:
    """Lets the bus put the device to sleep while nobody uses it; fields that come after it is woken."""
    power = _device() / "power"
    (power / "autosuspend_delay_ms").write_text("0")
    (power / "control").write_text("auto")
    status = power / "runtime_status"
    wait_for(lambda: status.read_text().strip() == "suspended", PATIENCE_S)
    with _service(kind) as (service, _):
        service.capture_control.start(None, CaptureRequest(fields=LEAD))
        recording = service.instrument(None).captures.recording
        assert recording is not None
        assert recording.sealed.wait(PATIENCE_S)
        return {
            "entries": _told(recording.recorder.ledger.entries),
            "received": recording.recorder.ledger.received,
        }


def opened_before_60_hz(kind: str, seconds: float) -> str:
    """What the daemon says of a camera of 60 Hz before a grabber that is set to 50."""
    grabber = plugged[kind]
    with _service(kind) as (service, _):
        grabber("60 Hz", True)
        board = service.instrument(None).board
        wait_for(lambda: board.now.cause, seconds)
        grabber("60 Hz", False)
        return str(board.now.cause)


def repeated(kind: str) -> dict[str, Any]:
    """Outcomes of pictures that come twice: how many, and how many different ones are received."""
    grabber = plugged[kind]
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
def _service(kind: str, until_ready: bool = True) -> Iterator[tuple[Service, Path]]:
    folder = Path(tempfile.mkdtemp(prefix="grabberd-", dir="/dev/shm"))
    file = folder / "cup.yaml"
    options = json.dumps({"usb": USB[family(kind)], **_MORE.get(kind, {})})
    file.write_text(_CONFIG.format(options=options, lines=_LINES.get(kind, _LINES.get(family(kind), 576))))
    service = Service(set_up(load_config(file), file), folder)
    service.start()
    try:
        if until_ready:
            wait_for(lambda: service.instrument(None).captures.accepts, PATIENCE_S)
        yield service, folder
    finally:
        service.stop()


def _pass(grabber: Grabber, fields: int) -> None:
    until = grabber("state")["field"] + fields
    wait_for(lambda: grabber("state")["field"] >= until, PATIENCE_S)
