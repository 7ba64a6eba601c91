"""The whole daemon at 50 Hz, with requests beside it and a witness of the machine's own stalls."""

import multiprocessing
import tempfile
import time
import urllib.request
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

import numpy as np

from grabberd.archive.capture.reader import CaptureReader
from grabberd.instrument.capture.capture_request import CaptureRequest

from .daemon import Cost, Daemon, daemon, resident_mb
from .witness import Witness, witness

REQUESTS_PER_S = 20
SETTLE_S = 3.0


def table(seconds: float) -> str:
    """Runs it and gives the figures as a Markdown table."""
    rows = measure(seconds)
    return "\n".join(["| | |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows)])


def measure(seconds: float) -> list[tuple[str, str]]:
    """One capture of that length; every figure is of this run."""
    with tempfile.TemporaryDirectory() as folder, daemon(Path(folder)) as running:
        time.sleep(SETTLE_S)
        with witness() as watching, _requests(running.port) as answered:
            time.sleep(SETTLE_S)
            return [*_run(running, seconds), *_beside(watching, answered)]


def _run(running: Daemon, seconds: float) -> list[tuple[str, str]]:
    instrument, service = running.instrument, running.service
    assert instrument.worker
    running.wait_until_ready()
    memory, cost = [resident_mb()], Cost(running.grabber)
    rounds: list[dict[str, float]] = []
    capture_id = service.capture_control.start(None, CaptureRequest(fields=round(seconds * 50))).id
    recording = instrument.captures.recording
    assert recording
    while not recording.sealed.wait(max(1.0, seconds / 20)):
        memory.append(resident_mb())
        rounds.append(cost.shares())
        cost = Cost(running.grabber)
    latency = instrument.worker.latency.milliseconds(round(seconds * 50))
    with CaptureReader(service.archive.path(capture_id)) as reader:
        ledger, points = reader.ledger, sum(len(one) for _, one in reader.points())
        size_mb = reader.path.stat().st_size / 1e6
    return [
        ("fields that should have come", str(ledger.total)),
        ("ledger", ledger.in_words(50.0)),
        ("points", f"{points} ({points / max(1, ledger.received):.1f} a field)"),
        ("field arrived → points published, p50 / p99 / max", in_words_ms(latency)),
        (
            "deepest ring use",
            f"{recording.recorder.reader.deepest} of {instrument.pipeline.ring.slots} slots",
        ),
        ("deepest backlog", f"{recording.recorder.backlog.deepest} fields"),
        *cost_rows(rounds or [cost.shares()]),
        (
            "resident memory, start / highest / end",
            " / ".join(f"{m:.0f} MB" for m in (memory[0], max(memory), memory[-1])),
        ),
        ("capture file", f"{size_mb:.1f} MB"),
    ]


def in_words_ms(latency: np.ndarray) -> str:
    """Percentiles of latencies in milliseconds."""
    p50, p99 = np.percentile(latency, (50, 99))
    return f"{p50:.2f} / {p99:.2f} / {latency.max():.1f} ms"


def cost_rows(rounds: Sequence[Mapping[str, float]]) -> list[tuple[str, str]]:
    """Shares of a core as rows of a table: the least of all rounds, and their median."""
    threads = {name for one in rounds for name in one} - {"everything", "the rendering"}
    by_thread = sorted(((_least_and_median(rounds, name), name) for name in threads), reverse=True)
    without = [{"": one["everything"] - one["the rendering"]} for one in rounds]
    return [
        ("share of a core, simulated rendering included", _least_and_median(rounds, "everything")[1]),
        ("share of a core without the rendering", _least_and_median(without, "")[1]),
        ("of it by thread", ", ".join(f"{name} {words}" for (_, words), name in by_thread)),
    ]


def _least_and_median(rounds: Sequence[Mapping[str, float]], name: str) -> tuple[float, str]:
    """The median of the rounds' shares, and both in words; a thread that hardly ran has no share."""
    shares = [one.get(name, 0.0) for one in rounds]
    median = float(np.median(shares))
    return median, f"{min(shares):.1%} / {median:.1%}" if len(shares) > 1 else f"{median:.1%}"


def _beside(watching: Witness, answered: Any) -> list[tuple[str, str]]:
    return [
        (f"requests answered at {REQUESTS_PER_S}/s", str(answered.value)),
        (
            "longest stall of the machine, seen by a witness process",
            f"{watching.stalls.longest_s * 1e3:.0f} ms",
        ),
        ("stalls over 20 ms that the witness saw", str(watching.stalls.long_ones)),
    ]


@contextmanager
def _requests(port: int) -> Iterator[Any]:
    """Requests from a process of its own; the value is how many were answered."""
    context = multiprocessing.get_context("spawn")
    answered, stop = context.Value("i", 0), context.Event()
    process = context.Process(target=_request, args=(port, answered, stop))
    process.start()
    try:
        yield answered
    finally:
        stop.set()
        process.join(10)


def _request(port: int, answered: Any, stop: Event) -> None:
    """Asks for state and captures in turn, twenty times a second."""
    paths = ["/api/v1/state", "/api/v1/captures", "/healthz", "/api/v1/state"]
    due = time.monotonic()
    while not stop.is_set():
        path = paths[answered.value % len(paths)]
        with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=10) as answer:
            answer.read()
        answered.value += 1
        due = max(due + 1 / REQUESTS_PER_S, time.monotonic() - 1)
        time.sleep(max(0.0, due - time.monotonic()))
