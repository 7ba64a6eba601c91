"""QEMU's own control channel: plugging and unplugging."""

import json
import socket
import time
from typing import Any

ANSWER_TIMEOUT_S = 60.0


class Qmp:
    """Commands over QEMU's socket, answered one at a time; events are kept."""

    def __init__(self, connection: socket.socket) -> None:
        self._socket = connection
        self._socket.settimeout(ANSWER_TIMEOUT_S)
        self._lines = self._socket.makefile("rb")
        self.events: list[dict[str, Any]] = []
        self._next()
        self.command("qmp_capabilities")

    def command(self, name: str, **arguments: Any) -> Any:
        """A command's return value.

        Raises:
            RuntimeError: QEMU refused it.
        """
        self._socket.sendall(json.dumps({"execute": name, "arguments": arguments}).encode() + b"\n")
        while True:
            answer = self._next()
            if "event" in answer:
                self.events.append(answer)
            elif "error" in answer:
                raise RuntimeError(f"QEMU refused {name} {arguments}: {answer['error']}")
            else:
                return answer.get("return")

    def wait_for(self, event: str, timeout_s: float = ANSWER_TIMEOUT_S) -> dict[str, Any]:
        """The next event of this name; earlier ones are forgotten once they are returned."""
        until = time.monotonic() + timeout_s
        while time.monotonic() < until:
            for seen in self.events:
                if seen["event"] == event:
                    self.events.remove(seen)
                    return seen
            self.events.append(self._next())
        raise TimeoutError(f"QEMU said no {event} within {timeout_s} s")

    def close(self) -> None:
        """Lets go of the socket."""
        self._lines.close()
        self._socket.close()

    def _next(self) -> dict[str, Any]:
        line = self._lines.readline()
        if not line:
            raise ConnectionError("QEMU closed its control channel")
        message: dict[str, Any] = json.loads(line)
        return message
