"""Clients that come and go: each looks at something for a while, and leaves, not always politely."""

import http.client
import json
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping
from contextlib import closing
from random import Random
from typing import Any, NamedTuple

from websockets.sync.client import connect

TIMEOUT_S = 20.0
LONGEST_S = 4.0
"""A stream is watched for so long at most."""


class Visit(NamedTuple):
    """Who came: what the client wanted, how long it took, and what went wrong, if anything."""

    what: str
    seconds: float
    failure: str | None = None
    refused: bool = False


class Host(NamedTuple):
    """The daemon, as a client knows it."""

    port: int

    def get(self, path: str) -> bytes:
        """The body of an answer."""
        with urllib.request.urlopen(f"http://127.0.0.1:{self.port}{path}", timeout=TIMEOUT_S) as answer:
            return bytes(answer.read())

    def json(self, path: str) -> Any:
        """The document of an answer."""
        return json.loads(self.get(path))

    def post(self, path: str, document: Any = None) -> Any:
        """The document of what was ordered."""
        body = json.dumps(document or {}).encode()
        url, headers = f"http://127.0.0.1:{self.port}{path}", {"Content-Type": "application/json"}
        asked = urllib.request.Request(url, body, headers, method="POST")
        with urllib.request.urlopen(asked, timeout=TIMEOUT_S) as answer:
            return json.loads(answer.read())


def visit(host: Host, random: Random) -> Visit:
    """One client's visit, whatever it wants."""
    what = random.choice(list(WANTS))
    begin = time.monotonic()
    try:
        WANTS[what](host, random)
    except urllib.error.HTTPError as error:
        failure = f"{what}: HTTP {error.code}" if error.code >= 500 else None
        return Visit(what, time.monotonic() - begin, failure, refused=error.code < 500)
    except Exception as error:
        return Visit(what, time.monotonic() - begin, f"{what}: {type(error).__name__}: {error}")
    return Visit(what, time.monotonic() - begin)


def _events(host: Host, random: Random) -> None:
    """Reads the stream for a while, or leaves at once."""
    until = time.monotonic() + random.choice([0.0, random.uniform(0.2, LONGEST_S)])
    with closing(http.client.HTTPConnection("127.0.0.1", host.port, timeout=TIMEOUT_S)) as connection:
        connection.request("GET", "/api/v1/events", headers={"Accept": "text/event-stream"})
        answer = connection.getresponse()
        if answer.status != 200:
            raise http.client.HTTPException(f"{answer.status} {answer.read(200)!r}")
        while time.monotonic() < until:
            if not answer.readline():
                raise http.client.HTTPException("the stream ended")


def _preview(host: Host, random: Random) -> None:
    """Watches the preview, at times slowly."""
    until, pause_s = time.monotonic() + random.uniform(0.2, LONGEST_S), random.choice([0.0, 0.3])
    with connect(f"ws://127.0.0.1:{host.port}/api/v1/preview", open_timeout=TIMEOUT_S) as socket:
        while time.monotonic() < until:
            assert len(socket.recv(TIMEOUT_S)) > 16, "an empty preview"
            time.sleep(pause_s)


def _picture(host: Host, _: Random) -> None:
    assert host.get("/api/v1/preview.png").startswith(b"\x89PNG"), "no picture"


def _list(host: Host, random: Random) -> None:
    host.json(
        random.choice(["/api/v1/captures", "/api/v1/captures?limit=5", "/api/v1/state", "/api/v1/devices"])
    )


def _download(host: Host, random: Random) -> None:
    """Something of a capture, of the running one at times."""
    captures = host.json("/api/v1/captures?limit=10")["captures"]
    if captures:
        own = f"/api/v1/captures/{random.choice(captures)['id']}"
        host.get(
            own + random.choice(["", "/file", "/points.csv", "/points", "/fields/0.png", "/fields/40.png"])
        )


WANTS: Mapping[str, Callable[[Host, Random], None]] = {
    "events": _events,
    "preview": _preview,
    "picture": _picture,
    "list": _list,
    "download": _download,
}
"""What a client can want."""
