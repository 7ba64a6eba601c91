"""Processor time of a request to the daemon, beside that of a bare server in the same run."""

import http.client
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from tests.proofs.faults.daemon import RECORDED, running
from tests.proofs.faults.failing import configuration

ROUNDS = 7
REQUESTS = 200
IDLE_S = 2.0
BARE = """
import uvicorn
from starlette.applications import Starlette
from starlette.responses import JSONResponse
from starlette.routing import Route
app = Starlette(routes=[Route("/", lambda _: JSONResponse({"status": "ok"}))])
uvicorn.run(app, port=0, access_log=False)
"""
PATHS = {
    "health": "/healthz",
    "state": "/api/v1/state",
    "settings": "/api/v1/settings",
    "points of the newest field": "/api/v1/devices/cup/points",
    "list of captures": "/api/v1/captures",
    "points of a recorded field": "/api/v1/captures/{capture}/points?first_n=0&end_n=1",
    "picture of a recorded field": "/api/v1/captures/{capture}/fields/1.png",
}

CHANGE = ("DELETE /api/v1/session",)
"""A request after which the state is made anew, though it changes nothing here."""


def table() -> str:
    """Milliseconds a request, least of all rounds; of the process for contents, too."""
    with _bare() as (pid, port):
        peer_ms = _least(pid, port, "/")
    rows = [
        "| request | processor time, ms | of a bare Starlette application's |",
        "|---|---|---|",
        f"| bare Starlette application, one line of JSON | {peer_ms:.2f} | 1 |",
    ]
    with tempfile.TemporaryDirectory() as folder, running(Path(folder), configuration(), RECORDED) as daemon:
        daemon.wait_until_ready()
        capture = daemon.start_capture(fields=20)
        daemon.sealed(capture)
        for name, path in PATHS.items():
            ms = _least(daemon.process.pid, daemon.port, path.format(capture=capture))
            rows.append(f"| {name} | {ms:.2f} | {ms / peer_ms:.1f} |")
        both_ms, change_ms = (
            _least(daemon.process.pid, daemon.port, *asked) for asked in ((*CHANGE, PATHS["state"]), CHANGE)
        )
        ms = both_ms - change_ms
        rows.append(f"| state, after a change | {ms:.2f} | {ms / peer_ms:.1f} |")
    return "\n".join(rows)


@contextmanager
def _bare() -> Iterator[tuple[int, int]]:
    with subprocess.Popen([sys.executable, "-c", BARE], stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        line = next(line for line in process.stderr if "running on" in line)
        try:
            yield process.pid, int(line.split(":")[-1].split()[0])
        finally:
            process.kill()


def _least(pid: int, port: int, *paths: str) -> float:
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=60)) as connection:
        return min(_round_ms(pid, connection, paths) for _ in range(ROUNDS))


def _round_ms(pid: int, connection: http.client.HTTPConnection, paths: tuple[str, ...]) -> float:
    """Cost of the requests, without what the process costs in the same time while nobody asks."""
    before_s, began_s = processor_s(pid), time.monotonic()
    time.sleep(IDLE_S)
    share = (processor_s(pid) - before_s) / (time.monotonic() - began_s)
    before_s, began_s = processor_s(pid), time.monotonic()
    for _ in range(REQUESTS):
        for path in paths:
            _ask(connection, path)
    idle_s = share * (time.monotonic() - began_s)
    return (processor_s(pid) - before_s - idle_s) / REQUESTS * 1e3


def _ask(connection: http.client.HTTPConnection, path: str) -> None:
    method, _, address = path.rpartition(" ")
    connection.request(method or "GET", address)
    response = connection.getresponse()
    response.read()
    assert response.status in (200, 204), (path, response.status)


def processor_s(pid: int) -> float:
    """Of a process and those that it has started."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    ticks = 0
    for one in (pid, *children):
        times = Path(f"/proc/{one}/stat").read_text().rpartition(")")[2].split()
        ticks += int(times[11]) + int(times[12])
    return ticks / os.sysconf("SC_CLK_TCK")
