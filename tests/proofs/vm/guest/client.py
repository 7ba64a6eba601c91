"""One who asks the installed service over HTTP, and looks into the files that it leaves."""

import json
import sqlite3
import subprocess
import threading
import time
import urllib.error
import urllib.request
from contextlib import suppress
from pathlib import Path
from typing import Any

from proofs.vm.guest import vivid
from proofs.vm.guest.shell import wait_for

ADDRESS = "http://127.0.0.1:8050"
CAPTURES = Path("/var/lib/grabberd/captures")
PATIENCE_S = 120.0
RUNNING = ("recording", "sealing")


def ask(path: str, body: dict[str, Any] | None = None, token: str | None = None) -> dict[str, Any]:
    """Status and document of an answer, whatever it is."""
    data = None if body is None else json.dumps(body).encode()
    head = {"Content-Type": "application/json"} | ({"Authorization": f"Bearer {token}"} if token else {})
    request = urllib.request.Request(ADDRESS + path, data, head)
    try:
        with urllib.request.urlopen(request, timeout=300) as answer:
            return {"status": answer.status, "document": json.load(answer)}
    except urllib.error.HTTPError as error:
        return {"status": error.code, "document": json.load(error)}


def capture(fields: int) -> dict[str, Any]:
    """A capture from its start to its seal."""
    begun = begin(fields=fields)
    assert begun["status"] == 202, begun
    return sealed(begun["document"]["id"])


def begin(**order: Any) -> dict[str, Any]:
    """Asks for a capture; the grabber shows a picture that is none of those without a signal."""
    vivid.show_picture()
    return ask("/api/v1/captures", order)


def running(fields: int) -> str:
    """Begins a capture without a length; its id, once so many fields have been received."""
    begun = begin()
    assert begun["status"] == 202, begun
    capture_id: str = begun["document"]["id"]
    wait_for(lambda: received(capture_id) >= fields, PATIENCE_S)
    return capture_id


def received(capture_id: str) -> int:
    """How many fields a capture has so far."""
    return int(document(capture_id)["ledger"]["counts"]["received"])


def document(capture_id: str) -> dict[str, Any]:
    """A capture's, as it is now."""
    answer = ask(f"/api/v1/captures/{capture_id}")
    assert answer["status"] == 200, answer
    now: dict[str, Any] = answer["document"]
    return now


def sealed(capture_id: str) -> dict[str, Any]:
    """A capture's document once it has ended."""
    wait_for(lambda: document(capture_id)["state"] not in RUNNING, PATIENCE_S, 0.1)
    return document(capture_id)


def stopped(capture_id: str) -> dict[str, Any]:
    """Stops a capture; its document once it has ended."""
    answer = ask(f"/api/v1/captures/{capture_id}/stop", {})
    assert answer["status"] == 202, answer
    return sealed(capture_id)


def job_ended(job_id: str) -> dict[str, Any]:
    """A job's document once it has ended."""
    path = f"/api/v1/jobs/{job_id}"
    wait_for(lambda: ask(path)["document"]["state"] not in ("queued", "running"), 4 * PATIENCE_S, 0.2)
    now: dict[str, Any] = ask(path)["document"]
    return now


def deleted(capture_id: str) -> int:
    """Deletes a capture; the status of the answer."""
    request = urllib.request.Request(f"{ADDRESS}/api/v1/captures/{capture_id}", method="DELETE")
    try:
        with urllib.request.urlopen(request, timeout=300) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code


def alarms(within_s: float) -> list[str]:
    """What the state still complains of after so long; nothing as soon as it does not."""

    def found() -> list[str]:
        state = ask("/api/v1/state")["document"]
        of_devices = [device["cause"] for device in state["devices"].values() if device["cause"]]
        return [fault["message"] for fault in state["faults"]] + of_devices

    with suppress(TimeoutError):
        wait_for(lambda: not found(), within_s, 0.2)
    return found()


def inside(capture_id: str) -> dict[str, Any]:
    """What a capture's file holds, seen without any of our own code."""
    path = CAPTURES / f"{capture_id}.grab"
    with sqlite3.connect(f"file:{path}?mode=ro", uri=True) as file:
        count, last_n, last_ns = file.execute(
            "SELECT COUNT(*), MAX(n), MAX(time_ns) FROM fields WHERE outcome = 'received'"
        ).fetchone()
        (integrity,) = file.execute("PRAGMA integrity_check").fetchone()
    return {"received": count, "last_n": last_n, "last_ns": last_ns, "integrity": integrity}


def fields_read_by(user: str, capture_id: str) -> int | None:
    """How many fields another user of the machine counts in a capture's file; None: it may not be read."""
    program = (
        "import sqlite3; file = sqlite3.connect('file:{}?mode=ro', uri=True); "
        "print(*file.execute('SELECT COUNT(*) FROM fields').fetchone())"
    ).format(CAPTURES / f"{capture_id}.grab")
    command = ["runuser", "-u", user, "--", "/usr/bin/python3", "-I", "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    return None if done.returncode else int(done.stdout)


def listed() -> list[str]:
    """The captures that the index lists."""
    return [one["id"] for one in ask("/api/v1/captures")["document"]["captures"]]


def until_received(capture_id: str, fields: int) -> float:
    """Seconds until a capture has so many fields."""
    return wait_for(lambda: received(capture_id) >= fields, PATIENCE_S)


def ask_until(path: str, not_state: str) -> dict[str, Any]:
    """Asks until the answer's document has another state, or is a problem; the last answer, with what
    `/api/v1/state` says of the disk and `/readyz` of everything."""
    answers: list[dict[str, Any]] = []

    def has_changed() -> bool:
        answers[:] = [ask(path)]
        return answers[0]["document"].get("state") != not_state

    wait_for(has_changed, PATIENCE_S, 0.1)
    state = ask("/api/v1/state")
    return {"answer": answers[0], "state": state, "ready": ask("/readyz")}


def write_clock(path: str) -> None:
    """Writes CLOCK_MONOTONIC into a shared file, from now on until the machine ends."""

    def go_on() -> None:
        with open(path, "w", buffering=1) as file:
            while True:
                file.write(f"{time.monotonic_ns()}\n")
                time.sleep(0.01)

    threading.Thread(target=go_on, daemon=True).start()
