"""A real MQTT broker on a loopback port, and somebody who hears what it is told."""

import json
import os
import shutil
import socket
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from running import PATIENCE_S

paho = pytest.importorskip("paho.mqtt.client", reason="aiomqtt is missing: pip install 'grabberd[mqtt]'")
from paho.mqtt.packettypes import PacketTypes  # noqa: E402
from paho.mqtt.properties import Properties  # noqa: E402

MOSQUITTO = shutil.which("mosquitto", path=f"{os.environ.get('PATH', '')}:/usr/sbin")
needs_mosquitto = pytest.mark.skipif(
    MOSQUITTO is None, reason="mosquitto is missing: sudo apt-get install mosquitto"
)


class Mosquitto:
    """The broker; what it has taken is on the disk, as it has to be for receivers that come back later.

    Args:
        folder: for its files.
        lines: of its configuration, beside the listener and the log.
    """

    def __init__(self, folder: Path, *lines: str) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port: int = free.getsockname()[1]
        self.log_file = folder / "mosquitto.log"
        self._config = folder / "mosquitto.conf"
        known = lines or ("allow_anonymous true",)
        kept = ["persistence true", f"persistence_location {folder}/", "autosave_on_changes true"]
        kept.append("autosave_interval 1")
        said = [f"listener {self.port} 127.0.0.1", "log_type all", "log_dest stderr", *kept, *known]
        if os.geteuid() == 0:
            said.append("user root")
        self._config.write_text("\n".join([*said, ""]))
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def log(self) -> str:
        return self.log_file.read_text()

    def taken(self, topic: str) -> int:
        """How many messages of the daemon have come."""
        ours = [line for line in self.log.splitlines() if "Received PUBLISH from grabberd-" in line]
        return sum(f"'{topic}'" in line for line in ours)

    def start(self) -> None:
        assert MOSQUITTO is not None
        with self.log_file.open("ab") as log:
            self._process = subprocess.Popen([MOSQUITTO, "-c", str(self._config)], stderr=log)

    def signal(self, number: int) -> None:
        assert self._process is not None
        self._process.send_signal(number)

    def kill(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait(PATIENCE_S)
            self._process = None


@contextmanager
def broker(folder: Path, *lines: str) -> Iterator[Mosquitto]:
    one = Mosquitto(folder, *lines)
    one.start()
    try:
        yield one
    finally:
        one.kill()


class Receiver:
    """Hears all topics; comes back after the broker by itself, and hears what it has missed.

    Attributes:
        heard: every message, by its topic, in order, None if it is empty; and whether it was a retained one.
    """

    def __init__(self, port: int, name: str = "receiver", **access: Any) -> None:
        self.heard: list[tuple[str, Any, bool]] = []
        self._changed = threading.Condition()
        self._subscribed = False
        self._client = paho.Client(paho.CallbackAPIVersion.VERSION2, name, protocol=paho.MQTTv5)
        if "user" in access:
            self._client.username_pw_set(access["user"], access["password"])
        if "tls" in access:
            self._client.tls_set(*map(str, access["tls"].values()))
        self._client.reconnect_delay_set(1, 1)
        self._client.on_connect = lambda client, *_: client.subscribe("#", 1)
        self._client.on_subscribe = lambda *_: self._now_subscribed()
        self._client.on_message = lambda _, __, message: self._hear(message)
        session = Properties(PacketTypes.CONNECT)
        session.SessionExpiryInterval = 3600
        host = "localhost" if "tls" in access else "127.0.0.1"
        self._client.connect_async(host, port, clean_start=False, properties=session)
        self._client.loop_start()
        self.until(lambda: self._subscribed)

    def close(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()

    def until(self, done: Any) -> None:
        """Waits until something is true of what was heard."""
        with self._changed:
            assert self._changed.wait_for(done, PATIENCE_S), self.heard

    def latest(self, ending: str) -> dict[str, Any] | None:
        found = [document for topic, document, _ in self.heard if topic.endswith(ending)]
        return found[-1] if found else None

    def captures(self) -> list[str]:
        return [
            str(document["capture_id"]) for topic, document, _ in self.heard if topic.endswith("/captures")
        ]

    def _hear(self, message: Any) -> None:
        with self._changed:
            document = json.loads(message.payload) if message.payload else None
            self.heard.append((message.topic, document, bool(message.retain)))
            self._changed.notify_all()

    def _now_subscribed(self) -> None:
        with self._changed:
            self._subscribed = True
            self._changed.notify_all()


@contextmanager
def receiver(port: int, name: str = "receiver", **access: Any) -> Iterator[Receiver]:
    one = Receiver(port, name, **access)
    try:
        yield one
    finally:
        with suppress(OSError):
            one.close()
