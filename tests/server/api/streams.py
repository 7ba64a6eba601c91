"""The whole application on a real socket, and clients of its streams."""

import http.client
import json
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any, NamedTuple

from running import PATIENCE_S, wait_until_it_accepts

from grabberd.config import HttpLimits
from grabberd.server.api import create_app
from grabberd.server.api.guard.front import Front, bind
from grabberd.server.api.serving import server_of
from grabberd.server.daemon.service import Service


class Served(NamedTuple):
    """A service that is reached at an address; `stop` has its server end."""

    service: Service
    address: tuple[str, int]
    app: Any
    server: Any
    thread: threading.Thread

    def stop(self) -> bool:
        """Whether the server has ended by itself."""
        self.server.should_exit = True
        self.thread.join(PATIENCE_S)
        return not self.thread.is_alive()


@contextmanager
def served(service: Service, limits: HttpLimits | None = None) -> Iterator[Served]:
    front = Front(limits=limits or HttpLimits())
    app = create_app(service, front)
    server = server_of(app, front)
    [listening] = bind("127.0.0.1", 0)
    address = listening.getsockname()
    thread = threading.Thread(target=server.run, args=([listening],))
    thread.start()
    one = Served(service, address, app, server, thread)
    try:
        wait_until_it_accepts(service)
        yield one
    finally:
        assert one.stop()


class Event(NamedTuple):
    id: str
    event: str
    data: Any


class EventClient:
    """Reads one event after the other; comments are gathered apart."""

    def __init__(self, answer: http.client.HTTPResponse) -> None:
        self._answer = answer
        self.headers = answer.headers
        self.status = answer.status
        self.comments: list[str] = []

    def __iter__(self) -> Iterator[Event]:
        event: dict[str, str] = {}
        for line in self._answer:
            key, _, value = line.decode().rstrip("\n").partition(": ")
            if key == "" and value:
                self.comments.append(value)
            elif key == "" and "data" in event:
                yield Event(event["id"], event["event"], json.loads(event["data"]))
                event = {}
            else:
                event[key] = value

    def next(self) -> Event:
        return next(iter(self))


@contextmanager
def events(address: tuple[str, int], last_id: str | None = None) -> Iterator[EventClient]:
    headers = {} if last_id is None else {"Last-Event-ID": last_id}
    with closing(http.client.HTTPConnection(*address, timeout=PATIENCE_S)) as connection:
        connection.request("GET", "/api/v1/events", headers=headers)
        with closing(connection.getresponse()) as answer:
            yield EventClient(answer)
