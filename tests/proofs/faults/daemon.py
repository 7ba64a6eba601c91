"""The daemon as it is installed, but for recorded pictures: a process of its own, reached over HTTP."""

import http.client
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import yaml

PATIENCE_S = 90.0
RECORDED = (sys.executable, str(Path(__file__).with_name("recorded.py")))
_LISTENING = re.compile(r"listening on http://127\.0\.0\.1:(\d+)")


class Answer(NamedTuple):
    """What the daemon says to a request."""

    status: int
    body: bytes

    @property
    def document(self) -> Any:
        """The body, where it is JSON."""
        return json.loads(self.body)


class Daemon:
    """A process that serves; `command` starts it, with `serve …` behind."""

    def __init__(
        self, folder: Path, config: Mapping[str, Any], command: tuple[str, ...], variables: Mapping[str, str]
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self.captures = folder / "state" / "captures"
        self.journal = folder / "journal"
        file = folder / "grabberd.yaml"
        file.write_text(yaml.safe_dump(dict(config)), encoding="utf-8")
        environment = {
            **os.environ,
            "OPENBLAS_NUM_THREADS": "1",
            "STATE_DIRECTORY": str(folder / "state"),
            **variables,
        }
        with self.journal.open("w") as journal:
            self.process = subprocess.Popen(
                [*command, "serve", "--config", str(file), "--port", "0"], env=environment, stderr=journal
            )
        try:
            self.port = self._wait_for_port()
        except BaseException:
            self.process.kill()
            self.process.wait()
            raise

    def _wait_for_port(self) -> int:
        end_s = time.monotonic() + PATIENCE_S
        while (found := _LISTENING.search(self.journal.read_text())) is None:
            assert self.process.poll() is None, self.journal.read_text()
            assert time.monotonic() < end_s, "the daemon does not serve"
            time.sleep(0.02)
        return int(found[1])

    def connection(self) -> closing[http.client.HTTPConnection]:
        """One that is kept for several requests."""
        return closing(http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE_S))

    def ask(self, path: str, method: str = "GET", document: Mapping[str, Any] | None = None) -> Answer:
        """One request and its answer, whatever that is."""
        with self.connection() as connection:
            return ask_over(connection, path, method, document)

    def get(self, path: str) -> Any:
        """The document at a path."""
        answer = self.ask(path)
        assert answer.status == 200, answer
        return answer.document

    def start_capture(self, **order: Any) -> str:
        """Begins a capture, and returns its id."""
        answer = self.ask("/api/v1/captures", "POST", order)
        assert answer.status == 202, answer
        capture_id: str = answer.document["id"]
        return capture_id

    def stop_capture(self, capture_id: str) -> dict[str, Any]:
        """Has a capture end, if it has not yet; its description once it is sealed."""
        answer = self.ask(f"/api/v1/captures/{capture_id}/stop", "POST")
        assert answer.status in (202, 409), answer
        return self.sealed(capture_id)

    def sealed(self, capture_id: str) -> dict[str, Any]:
        """The description of a capture when it is recorded no more."""
        path = f"/api/v1/captures/{capture_id}"
        return self.wait_for(path, lambda document: document["state"] not in ("recording", "sealing"))

    def wait_for(self, path: str, reached: Any) -> dict[str, Any]:
        """The document at a path as soon as it is as it has to be."""
        end_s = time.monotonic() + PATIENCE_S
        while not reached(document := self.get(path)):
            assert time.monotonic() < end_s, str(document)[:500]
            time.sleep(0.05)
        assert isinstance(document, dict)
        return document

    def wait_until_ready(self) -> None:
        """Every device streams."""
        self.wait_for("/api/v1/state", lambda state: all(map(_streams, state["devices"].values())))

    def take_home(self, capture_id: str, folder: Path) -> Path:
        """Downloads a capture's file."""
        answer = self.ask(f"/api/v1/captures/{capture_id}/file")
        assert answer.status == 200, answer
        path = folder / f"{capture_id}.grab"
        path.write_bytes(answer.body)
        return path

    def end(self) -> int:
        """Ends it as systemd does; its exit code."""
        self.process.terminate()
        try:
            return self.process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.process.wait()


def ask_over(
    connection: http.client.HTTPConnection,
    path: str,
    method: str = "GET",
    document: Mapping[str, Any] | None = None,
) -> Answer:
    """A request over a connection that is there already, and its answer, whatever that is."""
    body = None if document is None else json.dumps(document)
    connection.request(method, path, body, {"Content-Type": "application/json"})
    response = connection.getresponse()
    return Answer(response.status, response.read())


def _streams(device: Mapping[str, Any]) -> bool:
    return device["state"] in ("ready", "no_signal") and device["fields"]["received"] > 0


@contextmanager
def running(
    folder: Path,
    config: Mapping[str, Any],
    command: tuple[str, ...] = RECORDED,
    variables: Mapping[str, str] | None = None,
) -> Iterator[Daemon]:
    """A daemon from its start to its end; it has to end in order."""
    daemon = Daemon(folder, config, command, variables or {})
    try:
        yield daemon
        assert daemon.process.poll() is None, daemon.journal.read_text()
    finally:
        code = daemon.end()
    assert code in (0, -15), daemon.journal.read_text()
