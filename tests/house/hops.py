"""Files of the program that one request and one captured field pass through, traced while they happen.

The profiling hook notes the file and the thread of every function call. A file counts as soon as one of its
functions has run; being imported is not enough.
"""

import inspect
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

from fastapi.testclient import TestClient

from grabberd.config import default_config_file, load_config
from grabberd.instrument.setup import set_up
from grabberd.server.api import create_app
from grabberd.server.daemon.service import Service

from .source import ROOT, relative

SOURCE = ROOT / "src"
FIELDS = 100
PATIENCE_S = 60.0
# The threads of a field's way, and those that choose a threshold or look after files once a second, whoever
# asks for what meanwhile; all others answer a request or wait.
FIELD_THREADS = ("capture-", "recorder-", "writer-", "worker-")
BACKGROUND_THREADS = ("threshold-", "upkeep", "index")
STEADY_FIELDS = 150
"""Fields well inside a capture: three fits of the rig's health, six commits."""
SETTLE_S = 1.0


class Trace:
    """Own files by the name of the thread in which one of their functions ran."""

    def __init__(self) -> None:
        self._files: dict[str, set[str]] | None = None

    def __call__(self, frame: FrameType, event: str, _: Any) -> None:
        """The interpreter's profiling hook."""
        files = self._files
        # Bodies of modules and classes run when they are imported, and are not optimised as functions are.
        if files is not None and event == "call" and frame.f_code.co_flags & inspect.CO_OPTIMIZED:
            files[threading.current_thread().name].add(frame.f_code.co_filename)

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Watches this thread, and every one that starts inside the block."""
        threading.setprofile(self)
        sys.setprofile(self)
        try:
            yield
        finally:
            sys.setprofile(None)
            threading.setprofile(None)  # type: ignore[arg-type]  # the stubs know no None

    @contextmanager
    def story(self) -> Iterator[dict[str, set[str]]]:
        """Collects the files that are passed inside the block."""
        found: dict[str, set[str]] = defaultdict(set)
        self._files = found
        try:
            yield found
        finally:
            self._files = None


def stories() -> dict[str, list[str]]:
    """Own files, relative to the package, that each story passes."""
    trace = Trace()
    with tempfile.TemporaryDirectory() as folder, trace.watching(), _client(Path(folder)) as client:
        with trace.story() as starting:
            answer = client.post("/api/v1/captures", json={"fields": FIELDS}).raise_for_status().json()
        with trace.story() as recording:
            _wait_until_sealed(client, answer["id"])
        endless = client.post("/api/v1/captures", json={}).raise_for_status().json()
        time.sleep(SETTLE_S)
        with trace.story() as steady:
            _wait_for_points(client.app.state.service, STEADY_FIELDS)  # type: ignore[attr-defined]
        client.post(f"/api/v1/captures/{endless['id']}/stop").raise_for_status()
        _wait_until_sealed(client, endless["id"])
    others = FIELD_THREADS + BACKGROUND_THREADS
    return {
        "POST /captures": _own(starting, lambda thread: not thread.startswith(others)),
        "a captured field, from device to disk": _own(recording, _is_of_a_field),
        "a captured field amid a capture, which neither starts nor is sealed": _own(steady, _is_of_a_field),
    }


def _is_of_a_field(thread: str) -> bool:
    return thread.startswith(FIELD_THREADS)


@contextmanager
def _client(folder: Path) -> Iterator[TestClient]:
    config = load_config(default_config_file())
    service = Service(set_up(config, default_config_file()), folder)
    with TestClient(create_app(service), "http://localhost") as client:
        deadline = time.monotonic() + PATIENCE_S
        while client.get("/readyz").status_code != 200 and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(SETTLE_S)
        yield client


def _wait_for_points(service: Service, fields: int) -> None:
    """Waits until so many more fields of the running capture have been measured."""
    worker, first_n = service.instrument(None).worker, None
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        live = worker.live
        first_n = live.measured.n if first_n is None and live is not None else first_n
        if live is not None and first_n is not None and live.measured.n >= first_n + fields:
            return
        time.sleep(0.1)
    raise TimeoutError(f"{fields} fields were not measured in {PATIENCE_S} s")


def _wait_until_sealed(client: TestClient, capture_id: str) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        if client.get(f"/api/v1/captures/{capture_id}").json()["verdict"] is not None:
            return
        time.sleep(0.1)
    raise TimeoutError(f"capture {capture_id} was not sealed in {PATIENCE_S} s")


def _own(found: Mapping[str, set[str]], wanted: Any) -> list[str]:
    files = {file for thread, some in found.items() if wanted(thread) for file in some}
    return own(files)


def own(files: Iterable[str]) -> list[str]:
    """Those that are the program's own, without its drivers, as the docs name them."""
    return sorted({relative(Path(file)) for file in files if Path(file).is_relative_to(SOURCE)})


if __name__ == "__main__":
    for story, passed in stories().items():
        print(f"{story}: {len(passed)}")
        for one in passed:
            print(f"    {one}")
