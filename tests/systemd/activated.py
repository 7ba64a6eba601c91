"""The daemon as systemd starts it: its socket handed over, a notify socket, its unit's filters in force."""

import json
import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
SANDBOX = ROOT / "tests" / "systemd" / "sandbox.py"
SERVICE = ROOT / "systemd" / "grabberd.service"
PATIENCE_S = 60.0
HAND_OVER = 'exec 3<&"$1"; shift; export LISTEN_FDS=1 LISTEN_PID=$$; exec "$@"'
GRABBERD = (sys.executable, "-c", "from grabberd.cli import main; main()")


def without_network() -> list[str]:
    """The command before a command that takes its network away; none where this machine forbids it."""
    for command in (["unshare", "--net"], ["unshare", "--map-root-user", "--net"]):
        if shutil.which("unshare") and not subprocess.run([*command, "true"], check=False).returncode:
            return command
    return []


class Daemon:
    """A daemon that runs, and what systemd would have heard of it."""

    def __init__(self, folder: Path, config: Path, watchdog_s: float) -> None:
        self.folder = folder
        self._ear = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._ear.bind(str(folder / "notify"))
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.url = "http://{}:{}".format(*self._listening.getsockname())
        self.heard: list[str] = []
        self.process = self._start(config, watchdog_s)

    def _start(self, config: Path, watchdog_s: float) -> "subprocess.Popen[bytes]":
        number = self._listening.fileno()
        sandboxed = [sys.executable, SANDBOX, SERVICE, *GRABBERD, "serve", "--config", config]
        command = ["bash", "-c", HAND_OVER, "bash", number, *without_network(), *sandboxed]
        environment = {
            **os.environ,
            "NOTIFY_SOCKET": str(self.folder / "notify"),
            "WATCHDOG_USEC": str(round(watchdog_s * 1e6)),
            "STATE_DIRECTORY": str(self.folder / "state"),
        }
        with (self.folder / "journal").open("w") as journal:
            return subprocess.Popen(
                list(map(str, command)), pass_fds=[number], env=environment, stderr=journal
            )

    def hear(self, word: str) -> str:
        """Listens until a word was said, and returns it with what follows it."""
        end_s = time.monotonic() + PATIENCE_S
        while True:
            self._ear.settimeout(max(0.01, end_s - time.monotonic()))
            self.heard.append(self._ear.recv(4096).decode())
            if self.heard[-1].startswith(word):
                return self.heard[-1]

    def ask(self, path: str, document: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """GETs, or POSTs a document."""
        data = None if document is None else json.dumps(document).encode()
        request = urllib.request.Request(self.url + path, data, {"Content-Type": "application/json"})
        with urllib.request.urlopen(request, timeout=PATIENCE_S) as response:
            answer: dict[str, Any] = json.load(response)
        return answer

    def wait_for(self, path: str, key: str, *values: str) -> dict[str, Any]:
        """Asks until an answer's key has one of these values."""
        end_s = time.monotonic() + PATIENCE_S
        while (answer := self.ask(path))[key] not in values:
            assert time.monotonic() < end_s, answer
            time.sleep(0.05)
        return answer

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        self._ear.close()
        self._listening.close()


@contextmanager
def activated(folder: Path, config: Path, watchdog_s: float = 30.0) -> Iterator[Daemon]:
    """A daemon from start to end."""
    daemon = Daemon(folder, config, watchdog_s)
    try:
        yield daemon
    finally:
        daemon.close()
