"""What an operator's page is told by the event stream, and when."""

import http.client
import json
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

from tests.support.merge_patch import merged

from .daemon import PATIENCE_S


class Seen(NamedTuple):
    """The state as it was shown at a moment of CLOCK_MONOTONIC."""

    at_s: float
    state: Mapping[str, Any]


class Observer(threading.Thread):
    """Follows the event stream of a daemon from its own start on; keeps all it has seen."""

    def __init__(self, port: int) -> None:
        super().__init__(name="observer", daemon=True)
        self._connection = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE_S)
        self._connection.request("GET", "/api/v1/events")
        self._answer = self._connection.getresponse()
        self._seen: list[Seen] = []
        self._changed = threading.Condition()

    def run(self) -> None:
        """Until the daemon or the test ends it."""
        state: dict[str, Any] = {}
        kind = ""
        try:
            for line in self._answer:
                key, _, value = line.decode().rstrip("\n").partition(": ")
                if key == "event":
                    kind = value
                elif key == "data":
                    news = json.loads(value)
                    state = news if kind == "state" else merged(state, news)
                    self._see(state)
        except (OSError, ValueError, AttributeError, http.client.HTTPException):
            return  # it was closed

    def _see(self, state: Mapping[str, Any]) -> None:
        with self._changed:
            self._seen.append(Seen(time.monotonic(), state))
            self._changed.notify_all()

    def of(self, device: str) -> list[Seen]:
        """What was seen of a device, in order."""
        with self._changed:
            return [Seen(at_s, state["devices"][device]) for at_s, state in self._seen]

    def of_start(self) -> float:
        """When it first saw anything."""
        with self._changed:
            assert self._changed.wait_for(lambda: bool(self._seen), PATIENCE_S)
            return self._seen[0].at_s

    def wait_for(self, device: str, reached: Callable[[list[Seen]], bool], timeout_s: float) -> bool:
        """Whether what was seen of a device becomes as it has to be, in time."""
        with self._changed:
            return self._changed.wait_for(lambda: bool(self._seen) and reached(self.of(device)), timeout_s)

    def close(self) -> None:
        """Looks no more."""
        self._connection.close()


@contextmanager
def observing(port: int) -> Iterator[Observer]:
    """An observer for as long as the block lasts."""
    observer = Observer(port)
    observer.start()
    try:
        yield observer
    finally:
        observer.close()
