"""The whole daemon at 50 Hz, with requests beside it and a witness of the machine's own stalls."""

import multiprocessing
import socket
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

import uvicorn

from grabberd.acquisition.device import GrabbedField, Grabber, Signal, StreamInfo
from grabberd.api import create_app
from grabberd.config import default_config_file, load_config
from grabberd.service.recorder import CaptureRequest
from grabberd.service.service import Service
from grabberd.service.setup import set_up
from grabberd.storage import CaptureReader

REQUESTS_PER_S = 20
WITNESS_PERIOD_S = 0.005
SETTLE_S = 3.0


class TimedGrabber:
    """Another grabber, with what its dequeueing costs of the processor's time."""

    def __init__(self, grabber: Grabber) -> None:
        self._grabber = grabber
        self.cpu_s = 0.0

    def open(self) -> StreamInfo:
        return self._grabber.open()

    def dequeue(self, timeout_s: float) -> AbstractContextManager[Sequence[GrabbedField]]:
        return self._timed(timeout_s)

    @contextmanager
    def _timed(self, timeout_s: float) -> Iterator[Sequence[GrabbedField]]:
        before = time.thread_time()
        with self._grabber.dequeue(timeout_s) as fields:
            self.cpu_s += time.thread_time() - before
            yield fields

    def signal(self) -> Signal:
        return self._grabber.signal()

    def close(self) -> None:
        self._grabber.close()


def table(seconds: float) -> str:
    """Runs it and gives the figures as a Markdown table."""
    rows = measure(seconds)
    return "\n".join(["| | |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows)])


def measure(seconds: float) -> list[tuple[str, str]]:
    """One capture of that length; every figure is of this run."""
    sys.setswitchinterval(0.001)
    with tempfile.TemporaryDirectory() as folder, _service(Path(folder)) as (service, timed, port):
        time.sleep(SETTLE_S)
        with _beside(port) as witness:
            return _run(service, timed, witness, seconds)


def _run(service: Service, timed: TimedGrabber, witness: Any, seconds: float) -> list[tuple[str, str]]:
    instrument = service.instrument(None)
    assert instrument.worker
    with instrument.board.changed:
        instrument.board.changed.wait_for(lambda: instrument.accepts, 30)
    memory = [_resident_mb()]
    rendering, cpu, start = timed.cpu_s, time.process_time(), time.monotonic()
    capture_id = service.start_capture(None, CaptureRequest(fields=round(seconds * 50)))
    session = instrument.session
    assert session
    while not session.sealed.wait(max(1.0, seconds / 20)):
        memory.append(_resident_mb())
    wall = time.monotonic() - start
    share = (time.process_time() - cpu) / wall
    drawing = (timed.cpu_s - rendering) / wall
    latency = instrument.worker.latency.milliseconds(round(seconds * 50))
    with CaptureReader(service.archive.path(capture_id)) as reader:
        ledger, points = reader.ledger, sum(len(one) for _, one in reader.points())
        size_mb = reader.path.stat().st_size / 1e6
    import numpy as np  # noqa: PLC0415

    p50, p99 = np.percentile(latency, (50, 99))
    return [
        ("fields that should have come", str(ledger.total)),
        ("ledger", ledger.in_words(50.0)),
        ("points", f"{points} ({points / max(1, ledger.received):.1f} a field)"),
        (
            "field arrived → points published, p50 / p99 / max",
            f"{p50:.2f} / {p99:.2f} / {latency.max():.1f} ms",
        ),
        ("deepest ring use", f"{session.deepest_ring} of {instrument.intake.armed.ring.slots} slots"),
        ("deepest backlog", f"{session.deepest_backlog} fields"),
        ("share of a core, simulated rendering included", f"{share:.1%}"),
        ("share of a core without the rendering", f"{share - drawing:.1%}"),
        ("of it the rendering", f"{drawing:.1%}"),
        (f"requests answered at {REQUESTS_PER_S}/s", str(witness[2])),
        ("longest stall of the machine, seen by a witness process", f"{witness[0] * 1e3:.0f} ms"),
        ("stalls over 20 ms that the witness saw", str(int(witness[1]))),
        (
            "resident memory, start / highest / end",
            " / ".join(f"{m:.0f} MB" for m in (memory[0], max(memory), memory[-1])),
        ),
        ("capture file", f"{size_mb:.1f} MB"),
    ]


@contextmanager
def _service(folder: Path) -> Iterator[tuple[Service, TimedGrabber, int]]:
    file = default_config_file()
    setups = set_up(load_config(file), file)
    name, setup = next(iter(setups.items()))
    timed = TimedGrabber(setup.grabber)
    object.__setattr__(setup, "grabber", timed)
    service = Service({name: setup}, folder)
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        server = uvicorn.Server(uvicorn.Config(create_app(service), log_level="warning"))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
        thread.start()
        try:
            yield service, timed, listening.getsockname()[1]
        finally:
            server.should_exit = True
            thread.join(30)


@contextmanager
def _beside(port: int) -> Iterator[Any]:
    """Requests and the witness in processes of their own; the array is [longest stall, stalls, requests]."""
    context = multiprocessing.get_context("spawn")
    seen, stop = context.Array("d", 3), context.Event()
    processes = [
        context.Process(target=_witness, args=(seen, stop)),
        context.Process(target=_request, args=(port, seen, stop)),
    ]
    for process in processes:
        process.start()
    try:
        time.sleep(SETTLE_S)
        yield seen
    finally:
        stop.set()
        for process in processes:
            process.join(10)


def _witness(seen: Any, stop: Event) -> None:
    """Sleeps five milliseconds at a time and notes by how much it overslept."""
    last = time.monotonic()
    while not stop.is_set():
        time.sleep(WITNESS_PERIOD_S)
        now = time.monotonic()
        late = now - last - WITNESS_PERIOD_S
        seen[0] = max(seen[0], late)
        seen[1] += late > 0.02
        last = now


def _request(port: int, seen: Any, stop: Event) -> None:
    """Asks for state and captures in turn, twenty times a second."""
    paths = ["/api/v1/state", "/api/v1/captures", "/healthz", "/api/v1/state"]
    due = time.monotonic()
    while not stop.is_set():
        path = paths[int(seen[2]) % len(paths)]
        with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=10) as answer:
            answer.read()
        seen[2] += 1
        due = max(due + 1 / REQUESTS_PER_S, time.monotonic() - 1)
        time.sleep(max(0.0, due - time.monotonic()))


def _resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6
