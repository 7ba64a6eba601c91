"""Captures of several grabbers while other programs take the processors, and clients ask all the time."""

import http.client
import multiprocessing
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import closing, contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tests.proofs.faults.daemon import Daemon, running
from tests.proofs.faults.failing import configuration

from .busy import busy_loops
from .live import in_words_ms
from .witness import witness

REQUESTS_PER_S = 20
SETTLE_S = 3.0
TIMEOUT_S = 60.0
SEALED_WITHIN_S = 900.0
INSTALLED = (str(Path(sys.executable).with_name("grabberd")),)
PATHS = ("/api/v1/state", "/api/v1/devices/cup1/points", "/api/v1/captures", "/healthz")
"""What the client asks for, by turns."""


class Loaded(NamedTuple):
    """What came of it.

    Attributes:
        rows: Of a table.
        missing: Fields that the captures' ledgers miss.
    """

    rows: list[tuple[str, str]]
    missing: int

    def table(self) -> str:
        """As Markdown."""
        return "\n".join(["| | |", "|---|---|", *(f"| {name} | {text} |" for name, text in self.rows)])


def loaded(seconds: float, loops: int, devices: int) -> Loaded:
    """Captures all devices for so long, beside busy loops and a client."""
    config = configuration()
    one = config["devices"].pop("cup")
    names = [f"cup{number}" for number in range(1, devices + 1)]
    config["devices"] = dict.fromkeys(names, one)
    with tempfile.TemporaryDirectory() as folder, running(Path(folder), config, INSTALLED) as daemon:
        daemon.wait_until_ready()
        time.sleep(SETTLE_S)
        with busy_loops(loops), witness() as watching, _client(daemon.port) as waits_s:
            ids = [daemon.start_capture(device=name) for name in names]
            shares, load = _watched(daemon, seconds)
            for capture_id in ids:
                daemon.ask(f"/api/v1/captures/{capture_id}/stop", "POST")
            stalls = watching.stalls
        captures = [_sealed(daemon, capture_id) for capture_id in ids]
    counts = sum((Counter(one["ledger"]["counts"]) for one in captures), Counter())
    missing = counts.total() - counts["received"]
    rows = [
        (
            "length, devices, busy loops, requests",
            f"{seconds:.0f} s, {devices}, {loops}, {REQUESTS_PER_S} a second",
        ),
        ("load of the machine, processors", f"{load:.1f}, {os.cpu_count()}"),
        ("fields that are in the captures' accounts", str(counts.total())),
        ("of them not received (goal: none)", _in_words(captures) or "none"),
        ("share of a processor: the daemon", f"{shares[0]:.1%}"),
        ("the processes that it has started: the simulator's", f"{shares[1]:.1%}"),
        ("answers, p50 / p99 / max", in_words_ms(1e3 * np.array(waits_s))),
        ("longest stall of the machine, seen by a witness process", f"{stalls.longest_s * 1e3:.0f} ms"),
        ("points complete", ", ".join(f"{one['runs'][0]['state']}" for one in captures)),
    ]
    return Loaded(rows, missing)


def _watched(daemon: Daemon, seconds: float) -> tuple[tuple[float, float], float]:
    """Shares of a processor while it captures, its own and its processes', and the machine's load."""
    began_s, before = time.monotonic(), _processor_s(daemon.process.pid)
    time.sleep(seconds)
    passed_s, after = time.monotonic() - began_s, _processor_s(daemon.process.pid)
    own, others = ((now - then) / passed_s for now, then in zip(after, before, strict=True))
    return (own, others), os.getloadavg()[0]


def _processor_s(pid: int) -> tuple[float, float]:
    """Of a process, and of those that it has started and that still run."""
    threads = Path(f"/proc/{pid}/task").glob("*/children")  # each thread has children of its own
    children = [child for thread in threads for child in thread.read_text().split()]
    return _times_s(str(pid)), sum(map(_times_s, children))


def _times_s(pid: str) -> float:
    try:
        times = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except FileNotFoundError:  # it has ended since
        return 0.0
    return (int(times[11]) + int(times[12])) / os.sysconf("SC_CLK_TCK")


def _sealed(daemon: Daemon, capture_id: str) -> dict[str, Any]:
    """A capture's description once all its points are in."""
    end_s = time.monotonic() + SEALED_WITHIN_S
    while (capture := daemon.get(f"/api/v1/captures/{capture_id}"))["state"] in ("recording", "sealing"):
        assert time.monotonic() < end_s, f"{capture_id} is not sealed: {str(capture)[:500]}"
        time.sleep(0.5)
    assert isinstance(capture, dict)
    return capture


def _in_words(captures: list[dict[str, Any]]) -> str:
    causes: Counter[str] = Counter()
    for capture in captures:
        for entry in capture["ledger"]["entries"]:
            causes[f"{entry['outcome']}, {entry['reason']}"] += entry["count"]
    return "; ".join(f"{count} {what}" for what, count in causes.most_common())


@contextmanager
def _client(port: int) -> Iterator[list[float]]:
    """A process that asks until the end of the block; only then its waits for answers are in the list."""
    spawn = multiprocessing.get_context("spawn")
    here, there = spawn.Pipe()
    process = spawn.Process(target=_ask, args=(port, there), daemon=True)
    process.start()
    waits_s: list[float] = []
    try:
        yield waits_s
        here.send("end")
        waits_s += here.recv()
    finally:
        process.kill()
        process.join()


def _ask(port: int, there: Connection) -> None:
    waits_s: list[float] = []
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=TIMEOUT_S)) as connection:
        due_s = time.monotonic()
        while not there.poll(max(0.0, due_s - time.monotonic())):
            began_s = time.monotonic()
            connection.request("GET", PATHS[len(waits_s) % len(PATHS)])
            connection.getresponse().read()
            waits_s.append(time.monotonic() - began_s)
            due_s = max(due_s + 1 / REQUESTS_PER_S, began_s)
    there.send(waits_s)
