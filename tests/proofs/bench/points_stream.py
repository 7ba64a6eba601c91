"""The points of every field over the WebSocket: latency from publication to clients, and processor time."""

import tempfile
import threading
import time
from contextlib import closing
from pathlib import Path

import numpy as np
from tests.proofs.faults.daemon import RECORDED, Daemon, running
from tests.proofs.faults.failing import configuration

from grabberd.client.daemon import Daemon as Address
from grabberd.client.points_stream import follow_points

from .requests import processor_s

CLIENTS = (1, 4)
ROUNDS = 8
ROUND_S = 4.0
SETTLE_S = 1.0


def table() -> str:
    """For each number of clients: milliseconds from a field's publication until a client has it, and cost."""
    rows = [
        "| clients | fields each | skipped | p50 / p99, ms, quietest | median round | processor ms a field |",
        "|---|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as folder, running(Path(folder), configuration(), RECORDED) as daemon:
        daemon.wait_until_ready()
        idle = min(_share(daemon.process.pid) for _ in range(ROUNDS))
        rows.extend(_row(daemon, count, idle) for count in CLIENTS)
    return "\n".join(rows)


class _Follower(threading.Thread):
    """A client that notes how late fields come."""

    def __init__(self, url: str) -> None:
        super().__init__(daemon=True)
        self.latencies_ms: list[float] = []
        self.skipped = 0
        self._url = url
        self._ended = threading.Event()

    def run(self) -> None:
        with closing(follow_points(Address(self._url))) as fields:  # type: ignore[type-var]
            for one in fields:
                self.latencies_ms.append((time.monotonic_ns() - one.frame.published_ns) / 1e6)
                self.skipped += one.skipped
                if self._ended.is_set():
                    return

    def end(self) -> None:
        self._ended.set()
        self.join(10)


def _row(daemon: Daemon, count: int, idle: float) -> str:
    followers = [_Follower(f"http://127.0.0.1:{daemon.port}") for _ in range(count)]
    for one in followers:
        one.start()
    time.sleep(SETTLE_S)
    rounds, shares = [], []
    for _ in range(ROUNDS):
        begun = [len(one.latencies_ms) for one in followers]
        shares.append(_share(daemon.process.pid))
        of_round = [one.latencies_ms[n:] for one, n in zip(followers, begun, strict=True)]
        rounds.append(np.percentile(np.concatenate(of_round), (50, 99)).tolist())
    for one in followers:
        one.end()
    rounds.sort(key=lambda percentiles: percentiles[1])
    late = [f"{p50:.2f} / {p99:.2f}" for p50, p99 in (rounds[0], rounds[ROUNDS // 2])]
    fields, skipped = len(followers[0].latencies_ms), sum(one.skipped for one in followers)
    return f"| {count} | {fields} | {skipped} | {' | '.join(late)} | {(min(shares) - idle) / 50 * 1e3:.2f} |"


def _share(pid: int) -> float:
    """Share of a core that a process takes in a round."""
    before_s, began_s = processor_s(pid), time.monotonic()
    time.sleep(ROUND_S)
    return (processor_s(pid) - before_s) / (time.monotonic() - began_s)
