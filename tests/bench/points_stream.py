"""The points of every field over the WebSocket: latency from publication to clients, and processor time."""

import tempfile
import threading
import time
from contextlib import closing
from pathlib import Path

import numpy as np
from tests.faults.daemon import RECORDED, Daemon, running
from tests.faults.failing import configuration

from grabberd.cli.remote.client import Daemon as Address
from grabberd.cli.remote.points_stream import follow_points

from .requests import processor_s

CLIENTS = (1, 4)
SECONDS = 20.0
SETTLE_FIELDS = 50


def table() -> str:
    """For each number of clients: milliseconds from a field's publication until a client has it, and cost."""
    rows = [
        "| clients | fields each | skipped | from publication, ms: p50 / p99 / max | processor ms a field |",
        "|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as folder, running(Path(folder), configuration(), RECORDED) as daemon:
        daemon.wait_until_ready()
        for count in CLIENTS:
            rows.append(_row(daemon, count))
    return "\n".join(rows)


class _Follower(threading.Thread):
    """A client that notes when fields come."""

    def __init__(self, url: str) -> None:
        super().__init__(daemon=True)
        self.latencies_ms: list[float] = []
        self.skipped = 0
        self._url = url
        self._ended = threading.Event()

    def run(self) -> None:
        with closing(follow_points(Address(self._url))) as fields:  # type: ignore[type-var]
            for number, one in enumerate(fields):
                if number >= SETTLE_FIELDS:
                    self.latencies_ms.append((time.monotonic_ns() - one.frame.published_ns) / 1e6)
                    self.skipped += one.skipped
                if self._ended.is_set():
                    return

    def end(self) -> None:
        self._ended.set()
        self.join(10)


def _row(daemon: Daemon, count: int) -> str:
    pid = daemon.process.pid
    idle = _share(pid, SECONDS / 2)
    followers = [_Follower(f"http://127.0.0.1:{daemon.port}") for _ in range(count)]
    for one in followers:
        one.start()
    time.sleep(SETTLE_FIELDS / 50)
    share = _share(pid, SECONDS)
    for one in followers:
        one.end()
    latencies_ms = np.concatenate([one.latencies_ms for one in followers])
    p50, p99 = np.percentile(latencies_ms, (50, 99))
    fields, skipped = len(latencies_ms) // count, sum(one.skipped for one in followers)
    cost_ms = (share - idle) / 50 * 1e3
    late = f"{p50:.2f} / {p99:.2f} / {latencies_ms.max():.1f}"
    return f"| {count} | {fields} | {skipped} | {late} | {cost_ms:.2f} |"


def _share(pid: int, seconds: float) -> float:
    """Share of a core that a process takes."""
    before_s, began_s = processor_s(pid), time.monotonic()
    time.sleep(seconds)
    return (processor_s(pid) - before_s) / (time.monotonic() - began_s)
