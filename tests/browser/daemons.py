"""The daemon in a process of its own, that can be ended and started again on the same port."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from types import TracebackType
from typing import Any, Self

HERE = Path(__file__).parent
PATIENCE_S = 120.0
LONG_S = 600.0
LOOK_EVERY_S = 0.1
ACCEPTING = ("ready", "no_signal", "capturing")


class Daemon:
    """`serve.py` beside this file: the whole daemon on the simulated grabber, at the camera's pace but
    without the computer's delays, so that no field is lost because this computer is busy.

    Attributes:
        url: where it serves.
        folder: its state.
    """

    def __init__(self, folder: Path, **options: Any) -> None:
        """Options are those of the simulated grabber."""
        self.folder = folder
        self._options = options
        self._port = _free_port()
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self._port}"

    def start(self) -> None:
        """Returns when it serves; its device may not stream yet."""
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "STATE_DIRECTORY": str(self.folder)}
        command = [sys.executable, str(HERE / "serve.py"), str(self._port), json.dumps(self._options)]
        with (self.folder / "log.txt").open("ab") as log:
            self._process = subprocess.Popen(command, stdout=log, stderr=log, env=environment)
        until_s = time.monotonic() + PATIENCE_S
        while not self._serves():
            assert self._process.poll() is None, (self.folder / "log.txt").read_text()
            assert time.monotonic() < until_s, "the daemon does not serve"
            time.sleep(LOOK_EVERY_S)

    def stop(self) -> None:
        """As systemd ends it."""
        if self._process is not None:
            self._process.send_signal(signal.SIGTERM)
            self._process.wait(PATIENCE_S)
            self._process = None

    def add_token(self, name: str, role: str) -> str:
        """Makes a token and returns it."""
        from grabberd.archive.access import Access  # noqa: PLC0415
        from grabberd.documents.enums import Role  # noqa: PLC0415

        access = Access(self.folder)
        access.open()
        return access.add(name, Role(role))

    def ask(self, path: str, token: str | None = None, body: Any = None, method: str | None = None) -> Any:
        """A request below /api/v1; the answer's document."""
        headers = {"Content-Type": "application/json"} | (
            {"Authorization": f"Bearer {token}"} if token else {}
        )
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(f"{self.url}/api/v1{path}", data, headers, method=method)
        with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
            return json.loads(answer.read() or b"null")

    def capture(self, fields: int = 50, **order: Any) -> str:
        """Takes a capture, as soon as no other runs, and returns its id once it is sealed."""
        self.wait_until_it_streams()
        self.wait_until_none_runs()
        capture_id: str = self.ask("/captures", body={"fields": fields, **order})["id"]
        self.wait_until_sealed(capture_id)
        return capture_id

    def wait_until_none_runs(self) -> None:
        """Until the last capture of every device is sealed: a page may have started some of them."""
        until_s = time.monotonic() + PATIENCE_S
        while any(one["verdict"] is None for one in self.ask("/captures?limit=4")["captures"]):
            assert time.monotonic() < until_s, "a capture does not end"
            time.sleep(LOOK_EVERY_S)

    def wait_until_recorded(self, fields: int) -> None:
        """Until the newest capture has that many."""
        until_s = time.monotonic() + PATIENCE_S
        while self.ask("/captures?limit=1")["captures"][0]["fields"] < fields:
            assert time.monotonic() < until_s, "the capture gets no fields"
            time.sleep(LOOK_EVERY_S)

    def wait_until_sealed(self, capture_id: str) -> Any:
        """Waits for the end of a capture and returns its document."""
        until_s = time.monotonic() + PATIENCE_S
        while (capture := self.ask(f"/captures/{capture_id}"))["verdict"] is None:
            assert time.monotonic() < until_s, "the capture does not end"
            time.sleep(LOOK_EVERY_S)
        return capture

    def analyse(self, capture_id: str, **inputs: Any) -> None:
        """Analyses a capture, and returns once that is done."""
        self.wait_until_done(self.ask(f"/captures/{capture_id}/analysis", body={"inputs": inputs})["id"])

    def test(self, **order: Any) -> str:
        """Takes a capture for a guided test, and returns the test's id once it is made."""
        capture_id = self.capture(**order)
        until_s = time.monotonic() + PATIENCE_S
        while (analysis := self.ask(f"/captures/{capture_id}")["analysis"]) is None:
            assert time.monotonic() < until_s, "the test is not queued"
            time.sleep(LOOK_EVERY_S)
        result: dict[str, str] = self.wait_until_done(analysis["job"])
        return result["test"]

    def wait_until_done(self, job: str) -> Any:
        """Waits for the end of a job and returns its result."""
        found = self.wait_until_ended(job)
        assert found["state"] == "done", found
        return found["result"]

    def wait_until_ended(self, job: str) -> Any:
        """Waits for the end of a job, whatever that is, and returns its document."""
        until_s = time.monotonic() + LONG_S
        while (found := self.ask(f"/jobs/{job}"))["state"] in ("queued", "running"):
            assert time.monotonic() < until_s, "the job does not end"
            time.sleep(LOOK_EVERY_S)
        return found

    def wait_until_it_streams(self, token: str | None = None) -> None:
        """Until a capture can begin."""
        until_s = time.monotonic() + PATIENCE_S
        while not all(one["state"] in ACCEPTING for one in self.ask("/state", token)["devices"].values()):
            assert time.monotonic() < until_s, "the device does not stream"
            time.sleep(LOOK_EVERY_S)

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self.stop()

    def _serves(self) -> bool:
        try:
            with urllib.request.urlopen(f"{self.url}/healthz", timeout=PATIENCE_S):
                return True
        except OSError:
            return False


def _free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])
